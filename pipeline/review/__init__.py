"""Looking at runs that others made: recomputed, compared, handed on, taken in, run again."""
