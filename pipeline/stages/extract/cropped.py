"""A part of a height map."""

from __future__ import annotations

from dataclasses import replace

from pipeline.data.height_fields import HeightField
from pipeline.errors import InputError
from pipeline.limits import above_zero, refuse

_tolerance_cropped = {"height_um": 1e-12}


def cropped(surface: HeightField, *, width_um: float) -> HeightField:
    """Keep the square in the middle of a height map.

    Parameters
    ----------
    surface : HeightField
        The map.
    width_um : float
        Width of the square, to the nearest sample.

    Returns
    -------
    HeightField
        It repeats only where nothing was cut from a map that does.

    Raises
    ------
    InputError
        The square is wider than the map, or narrower than two samples.
    """
    _check_cropped(width_um=width_um)
    side, (rows, columns) = round(width_um / surface.pitch_um), surface.height_um.shape
    if not 2 <= side <= min(rows, columns):
        raise InputError(
            f"width_um is {width_um:g}",
            where="width_um",
            expected=f"{2 * surface.pitch_um:.4g} to {min(rows, columns) * surface.pitch_um:.4g}, the map's",
        )
    top, left = (rows - side) // 2, (columns - side) // 2
    height = surface.height_um[top : top + side, left : left + side].copy()
    return replace(surface, height_um=height, periodic=surface.periodic and (rows, columns) == (side, side))


def _check_cropped(*, width_um: float) -> None:
    """Refuse a width that is none before anything runs."""
    refuse(above_zero(width_um=width_um))
