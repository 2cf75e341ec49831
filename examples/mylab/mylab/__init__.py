"""Stages and devices of a laboratory."""
