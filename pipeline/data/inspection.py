"""Defects of printed items."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.data.arrays import FloatArray
from pipeline.data.gratings import OrientationMap


@dataclass(frozen=True, eq=False)
class Defects:
    """Fabrication defects of an item, found or known, in the frame of the product without defects.

    Attributes
    ----------
    kind : tuple of str
        ``missing`` (no grating where there should be one), ``scratch`` (missing along a line), ``extra`` (a grating
        where there should be none), ``turned`` or ``period``, for each of the D defects.
    centre_mm : ndarray of shape (D, 2), float64
        Centre of its area: x right, y up, origin at the centre of the map.
    area_mm2, width_mm : ndarray of shape (D,), float64
        Area, and the largest distance between two of its points.
    turn_rad : ndarray of shape (D,), float64
        By how much the grating is turned, anticlockwise, in [-pi/2, pi/2); NaN without a grating.
    period_ratio : ndarray of shape (D,), float64
        Its period over that of the product; NaN without a grating.
    significance : ndarray of shape (D,), float64
        In standard deviations of the noise over the defect's own area; NaN where it is known because it was drawn.
    labels : ndarray of shape (M, N), int32
        Which pixel belongs to which defect: k + 1 for defect k, 0 for none.
    pixel_mm : float
        Pitch of the labels.
    """

    kind: tuple[str, ...]
    centre_mm: FloatArray
    area_mm2: FloatArray
    width_mm: FloatArray
    turn_rad: FloatArray
    period_ratio: FloatArray
    significance: FloatArray
    labels: NDArray[np.int32]
    pixel_mm: float


@dataclass(frozen=True, eq=False)
class Inspection:
    """An item compared with a reference item of the same product.

    Attributes
    ----------
    defects : Defects
        What was found, the most significant first, in the frame of the reference.
    suspect : OrientationMap
        The item's map brought onto the reference: moved, turned back, and without the offset between the two.
    significance : ndarray of shape (M, N), float32
        Largest deviation of the grating over all kinds and scales, in standard deviations of the noise; NaN where
        nothing can be judged.
    threshold : float
        The significance that noise alone is not expected to reach.
    shift_mm : ndarray of shape (2,), float64
        Where the centre of the reference lies in the item's photograph: x right, y up.
    turn_rad : float
        By how much the item lies turned, anticlockwise.
    offset_rad : float
        By how much the item's orientations stand ahead of the reference's beyond that, in [-pi/2, pi/2).
    metrics : dict of str to float
        Figures for the table: each name ends in its unit.
    """

    defects: Defects
    suspect: OrientationMap
    significance: FloatArray
    threshold: float
    shift_mm: FloatArray
    turn_rad: float
    offset_rad: float
    metrics: Mapping[str, float]
