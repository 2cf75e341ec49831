"""A graph carried out: what has to run and why, where, and how it ended."""
