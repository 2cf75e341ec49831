"""What source code says, and whether it is what this process runs."""
