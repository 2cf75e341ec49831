"""What flash photographs tell of a sheet before maps do: where its highlights lie, and which gratings it holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pipeline.data.arrays import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class Highlights:
    """The flash's mirror image in each rectified photograph.

    Attributes
    ----------
    place_mm : ndarray of shape (L, 2), float64
        Its middle on the sheet: x right, y up, origin at the sheet's centre; NaN where none was found.
    sigma_mm : ndarray of shape (L,), float64
        Standard deviation of its brightness on the sheet, the same along both axes; NaN where none was found.
    saturated, outside : ndarray of shape (L,), bool
        Whether its middle was too bright for the camera, or it lies on the picture's edge or beyond.
    stated_mm : ndarray of shape (L, 2), float64
        Where the stated places of light and camera would put it; NaN where they are not known.
    light_sigma_mm : float or None
        Standard deviation of the flash's extent that makes the highlights as large as they are; None without places.
    photographs : ndarray of shape (L, M, N), float32
        Brightness of the photographs, made smaller, as they are shown.
    pixel_mm : float
        Pitch of ``photographs``.
    metrics : dict of str to float
        Figures for the table: each name ends in its unit.
    """

    place_mm: FloatArray
    sigma_mm: FloatArray
    saturated: BoolArray
    outside: BoolArray
    stated_mm: FloatArray
    light_sigma_mm: float | None
    photographs: FloatArray
    pixel_mm: float
    metrics: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class GratingDistribution:
    """How much of a sheet carries gratings of each orientation and period.

    Attributes
    ----------
    share : ndarray of shape (T, P), float64
        Share of the area in each bin; sums to 1. A row an orientation, a column a period.
    orientation_rad : ndarray of shape (T,), float64
        Middles of equal bins over [0, pi).
    period_um : ndarray of shape (P,), float64
        Middles of equal bins.
    seen : ndarray of shape (T, P), bool
        Bins of which the photograph could have shown something.
    metrics : dict of str to float
        Figures for the table: each name ends in its unit.
    """

    share: NDArray[np.float64]
    orientation_rad: NDArray[np.float64]
    period_um: NDArray[np.float64]
    seen: BoolArray
    metrics: Mapping[str, float] = field(default_factory=dict)
