"""From YAML to a checked graph: nothing runs before every name, type, setting and edge is known to be right."""
