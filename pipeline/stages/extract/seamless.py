"""A height map made to fit itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.data.height_fields import HeightField
from pipeline.errors import InputError
from pipeline.limits import above_zero, refuse

_tolerance_seamless = {"height_um": 1e-9}


def seamless(surface: HeightField, *, overlap_um: float = 4.0) -> HeightField:
    """Fade the end of a map into its beginning along both axes, so that it repeats without a seam.

    What is beyond the right border is taken from the left, over ``overlap_um``: ``cos t end + sin t beginning`` about
    their means, ``t`` from 0 to a right angle, whose variance stays where the two have nothing in common. The map gets
    smaller by the overlap.

    Parameters
    ----------
    surface : HeightField
        Levelled.
    overlap_um : float
        Width of the fade; a few of the surface's periods.

    Returns
    -------
    HeightField
        Periodic.

    Raises
    ------
    InputError
        The overlap is more than half of the map, or less than two samples.
    """
    _check_seamless(overlap_um=overlap_um)
    if surface.periodic:
        return surface
    overlap = round(overlap_um / surface.pitch_um)
    most = min(surface.height_um.shape) // 2
    if not 2 <= overlap <= most:
        raise InputError(
            f"overlap_um is {overlap_um:g}",
            where="overlap_um",
            expected=f"{2 * surface.pitch_um:.4g} to {most * surface.pitch_um:.4g}, half of the map",
        )
    height = _faded(_faded(surface.height_um.astype(np.float64), overlap).T, overlap).T
    return replace(surface, height_um=np.ascontiguousarray(height, surface.height_um.dtype), periodic=True)


def _faded(height: NDArray[np.float64], overlap: int) -> NDArray[np.float64]:
    """Rows whose last ``overlap`` are faded into the first, which are left out."""
    angle = (np.pi / 2 * (np.arange(overlap) + 0.5) / overlap)[:, None]
    mean = height.mean()
    inside = height[overlap:].copy()
    inside[-overlap:] = mean + np.cos(angle) * (height[-overlap:] - mean) + np.sin(angle) * (height[:overlap] - mean)
    return inside


def _check_seamless(*, overlap_um: float) -> None:
    """Refuse a width that is none before anything runs."""
    refuse(above_zero(overlap_um=overlap_um))
