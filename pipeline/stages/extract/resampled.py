"""A height map at another pitch."""

from __future__ import annotations

import logging
import math
from dataclasses import replace

import numpy as np

from pipeline.data.height_fields import HeightField
from pipeline.errors import InputError
from pipeline.limits import above_zero, refuse
from pipeline.optics import height_sampling

LEAST_SIDE = 4
LARGEST_SIDE = 16_384
NOTICED = 1e-6

_log = logging.getLogger(__name__)
_tolerance_resampled = {"height_um": 1e-6}


def resampled(surface: HeightField, *, pitch_um: float) -> HeightField:
    """Bring a height map to another pitch, without what a coarser one would fold over.

    A tile that repeats is resampled by its Fourier series and repeats as before; its pitch is the nearest that a whole
    number of samples allows. Any other map is blurred to the new pixel where that is larger, and read off splines.

    Parameters
    ----------
    surface : HeightField
        The map.
    pitch_um : float
        The new pitch.

    Returns
    -------
    HeightField
        The first sample of the first row stays where it is.

    Raises
    ------
    InputError
        A pitch that leaves fewer than four samples a side, or makes too many.
    """
    _check_resampled(pitch_um=pitch_um)
    factor = pitch_um / surface.pitch_um
    rows, columns = surface.height_um.shape
    if not LEAST_SIDE * factor <= min(rows, columns) or max(rows, columns) / factor > LARGEST_SIDE:
        least, most = max(rows, columns) / LARGEST_SIDE, min(rows, columns) / LEAST_SIDE
        right = f"{surface.pitch_um * least:.4g} to {surface.pitch_um * most:.4g}, for {LEAST_SIDE} samples or more"
        raise InputError(f"pitch_um is {pitch_um:g}", where="pitch_um", expected=right)
    kind = surface.height_um.dtype
    if not (surface.periodic and np.isfinite(surface.height_um).all()):
        height = height_sampling.resampled(surface.height_um, factor)
        return replace(surface, height_um=height.astype(kind), pitch_um=pitch_um, periodic=False)
    common = math.gcd(rows, columns)
    parts = max(1, round(common / factor))
    height = height_sampling.resampled_tile(surface.height_um, rows // common * parts, columns // common * parts)
    pitch = surface.pitch_um * common / parts
    if abs(pitch / pitch_um - 1) > NOTICED:
        _log.info("the pitch is %.6g um, so that a whole number of samples fits the tile", pitch)
    return replace(surface, height_um=height.astype(kind), pitch_um=pitch)


def _check_resampled(*, pitch_um: float) -> None:
    """Refuse an impossible pitch before anything runs."""
    refuse(above_zero(pitch_um=pitch_um))
