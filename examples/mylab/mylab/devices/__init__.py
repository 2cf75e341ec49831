"""Devices of the laboratory."""
