"""Pictures computed from maps."""
