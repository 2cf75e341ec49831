"""Values, records and files on disk: written whole, found by their content, checked when they are read."""
