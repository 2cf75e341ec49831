"""Maps of gratings as dots that a printer can make."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64Array = NDArray[np.float64]
IntArray = NDArray[np.intp]


def cells_under(count: int, pitch: float, cells: int, cell_pitch: float) -> IntArray:
    """Along one axis, the cell of one grid in which each point of another lies, both centred on the same place.

    Parameters
    ----------
    count, pitch : int and float
        Of the points.
    cells, cell_pitch : int and float
        Of the cells; points outside belong to the outermost.
    """
    place = (np.arange(count) + 0.5 - count / 2) * pitch / cell_pitch + cells / 2
    # Where a point lies on the line between two cells, rounding shall not choose.
    return np.clip(np.floor(place + 1e-9).astype(np.intp), 0, cells - 1)


def nearest_angles(orientation_deg: ArrayLike, step_deg: float) -> Float64Array:
    """Axial angles brought to the nearest multiple of a step that divides 180, in [0, 180); NaN stays."""
    steps = round(180 / step_deg)
    return np.mod(np.round(np.asarray(orientation_deg, np.float64) / 180 * steps), steps) * 180 / steps


def nearest_of(values: ArrayLike, allowed: ArrayLike) -> Float64Array:
    """Each value brought to the nearest of those that are allowed, the smaller of two; NaN stays."""
    choices = np.unique(np.asarray(allowed, np.float64))
    wanted = np.asarray(values, np.float64)
    chosen = choices[np.searchsorted((choices[1:] + choices[:-1]) / 2, np.nan_to_num(wanted))]
    return np.where(np.isfinite(wanted), chosen, np.nan)


def nearest_multiples(values: ArrayLike, step: float) -> Float64Array:
    """Each value above 0 brought to the nearest multiple of a step above 0, no less than the step; NaN stays."""
    return np.maximum(np.round(np.asarray(values, np.float64) / step), 1) * step
