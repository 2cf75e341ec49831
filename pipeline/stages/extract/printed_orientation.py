"""The orientations of a print."""

from __future__ import annotations

import numpy as np

from pipeline.data.gratings import OrientationMap
from pipeline.data.printing import PrintLayout


def printed_orientation(layout: PrintLayout) -> OrientationMap:
    """Take the orientations of a print's dots as a map, so that the print can be rendered before it is made.

    Parameters
    ----------
    layout : PrintLayout
        Of M x N dots.

    Returns
    -------
    OrientationMap
        Of shape (M, N), a pixel a dot, absolute.
    """
    angles = np.deg2rad(layout.orientation_deg).astype(np.float32)
    return OrientationMap.of_angles(angles, pixel_mm=layout.dot_mm, absolute=True)
