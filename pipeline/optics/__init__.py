"""Physics as pure functions: arrays in, arrays out, no state, no files."""
