"""Synthetic samples with known truth."""
