"""What commands do beside running and reviewing: list and show, export, debug, clean."""
