"""Where a light has to stand to show directions that were not seen yet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

BINS = 60
"""Of directions, over half a turn."""


def directions_seen(
    azimuth_rad: NDArray[np.floating], length: NDArray[np.floating], width_rad: float, lit: tuple[float, float]
) -> BoolArray:
    """Whether a tangent of each direction would have shown itself, shape (P, BINS).

    Parameters
    ----------
    azimuth_rad, length : ndarray of shape (O, P)
        Half vectors of the views of each pixel; NaN where nothing could be read.
    width_rad : float
        Angle from the tangent at which a pixel is still found bright.
    lit : tuple of float
        Lengths of the half vector between which gratings are bright.
    """
    pixels = azimuth_rad.shape[1]
    usable = (length > lit[0]) & (length < lit[1])
    view, pixel = np.nonzero(usable)
    middle = np.floor(np.mod(azimuth_rad[view, pixel], np.pi) / np.pi * BINS).astype(int)
    reach = int(width_rad / np.pi * BINS)
    seen = np.zeros((pixels, BINS), bool)
    for step in range(-reach, reach + 1):
        seen[pixel, (middle + step) % BINS] = True
    return seen
