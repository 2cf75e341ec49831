"""Stages of the laboratory."""
