"""A flat sheet of gratings in the plane z = 0, its light and its viewer: x right, y up, z towards them, in mm."""
