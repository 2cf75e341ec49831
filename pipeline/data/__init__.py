"""The values that stages hand to each other.

Small frozen dataclasses. Arrays are indexed (row, column[, channel]) with row 0 at the top of the photograph; in-plane
angles are anticlockwise from +x with y up, as seen in the displayed photograph. Lengths carry their unit in the name.
Fields may be arrays, ``str``, ``int``, ``float``, ``bool``, ``None``, and tuples or string-keyed dicts of these.
"""
