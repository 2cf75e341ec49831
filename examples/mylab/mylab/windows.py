"""Neighbourhoods of pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def windows(image: NDArray[np.float64], radius: int) -> NDArray[np.float64]:
    """The (2 radius + 1)^2 neighbours of every pixel, NaN beyond the edge; shape (M, N, neighbours)."""
    padded = np.pad(image, radius, constant_values=np.nan)
    side = 2 * radius + 1
    view = np.lib.stride_tricks.sliding_window_view(padded, (side, side))
    return view.reshape(*image.shape, side * side)
