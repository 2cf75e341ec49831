"""A height map laid level."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.data.height_fields import HeightField
from pipeline.limits import refuse, within
from pipeline.optics.levelling import lines_jump, plane, row_polynomials, rows_repeat, without_slope_and_medians

HIGHEST_DEGREE = 5

_log = logging.getLogger(__name__)
_tolerance_level = {"height_um": 1e-5}


def level(
    surface: HeightField,
    *,
    lines: Literal["auto", "none", "median", "polynomial"] = "auto",
    degree: int = 1,
) -> HeightField:
    """Take away what the scan added: the tilt of the sample, and the jumps from line to line.

    A tile that repeats has neither, and only loses its mean. The plane is of least squares, lines are rows; in both
    the samples near the edges count less, so that a grating's own slopes do not tilt it.

    Parameters
    ----------
    surface : HeightField
        As it was measured.
    lines : {"auto", "none", "median", "polynomial"}
        What is taken from each row: its median, or the polynomial of least squares. ``auto`` takes medians where
        neighbouring rows jump as columns do not and no structure repeats along the rows' medians, which it would take
        away, too; it says what it did.
    degree : int
        Of the polynomials, 0 to 5; from 1 on they contain the plane.

    Returns
    -------
    HeightField
        Around 0; levelled again, it stays as it is.

    Raises
    ------
    InputError
        A degree that polynomials along rows cannot have.
    """
    _check_level(degree=degree)
    height = surface.height_um.astype(np.float64)
    if surface.periodic and lines == "auto":
        _log.info("a tile that repeats has no tilt and no lines: only its mean is taken away")
        flat: NDArray[np.float64] = height - np.nanmean(height)
    elif lines == "polynomial":
        flat = height - row_polynomials(height, degree)
        flat = flat if degree else flat - plane(flat)
    else:
        wanted = lines == "median" or (lines == "auto" and _worth_it(height - plane(height)))
        flat = without_slope_and_medians(height) if wanted else height - plane(height)
    return replace(surface, height_um=flat.astype(surface.height_um.dtype))


def _worth_it(height: NDArray[np.float64]) -> bool:
    """Whether to level lines, said with the reason."""
    if not lines_jump(height):
        _log.info("lines do not jump against each other: only a plane is taken away")
        return False
    if rows_repeat(height):
        _log.warning(
            "Lines jump against each other, but a structure repeats from row to row, which levelling them would take "
            "away: only a plane is. Scan across the structure, or choose lines: median."
        )
        return False
    _log.info("lines jump against each other: the median of each is taken away")
    return True


def _check_level(*, degree: int, **_: object) -> None:
    """Refuse an impossible degree before anything runs."""
    refuse(within(0, HIGHEST_DEGREE, degree=degree))
