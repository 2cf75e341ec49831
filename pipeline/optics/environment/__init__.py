"""A sheet of gratings under light from everywhere, given as a light probe.

A probe is a picture in latitude and longitude of all that is seen from the sheet: row 0 is straight up, and the middle
of the picture is what lies straight behind the viewer. Its columns run to the right as one sees them who stands at the
sheet and looks at the viewer. In the frame of the world (x right, y up, z level and towards the viewer, as the viewer
of an upright sheet sees them) the middle is +z, a quarter of the picture further right is -x.
"""
