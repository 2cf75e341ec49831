"""Model fits: from photographs to maps."""
