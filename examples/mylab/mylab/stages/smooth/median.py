"""Medians of maps of angles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mylab.windows import windows
from pipeline.data.gratings import OrientationMap
from pipeline.errors import InputError


def axial_median(orientation: OrientationMap, *, radius_px: int = 2) -> OrientationMap:
    """Replace each orientation by the direction of the mean of its neighbours' double angles, each component's median.

    Parameters
    ----------
    orientation : OrientationMap
        The map; masked pixels take no part and stay masked.
    radius_px : int
        Half width of the square window.
    """
    known = np.isfinite(orientation.orientation_rad)
    double = 2 * np.asarray(orientation.orientation_rad, np.float64)
    cosine, sine = (np.nanmedian(windows(part, radius_px)[known], axis=-1) for part in (np.cos(double), np.sin(double)))
    angle = np.full(double.shape, np.nan, np.float32)
    angle[known] = np.mod(np.arctan2(sine, cosine) / 2, np.pi)
    return replace(orientation, orientation_rad=angle)


def _check_axial_median(*, radius_px: int) -> None:
    """Refuse impossible windows before anything runs."""
    if not 0 <= radius_px <= 20:
        raise InputError(f"radius_px is {radius_px}", where="radius_px", expected="0 to 20")
