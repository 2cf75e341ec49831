"""Maps derived from fitted maps."""
