"""Smoothing of maps."""
