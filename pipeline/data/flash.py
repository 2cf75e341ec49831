"""Sheets photographed under a phone's flash, one place of the flash after another.

The sheet lies in the plane z = 0: x right, y up, z towards the camera, origin at its centre. Row 0 of a rectified
picture is at the largest y.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pipeline.data.arrays import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class FlashBrackets:
    """Brackets of exposures as the camera saw them: one a place of the flash, and one photograph under room light.

    Attributes
    ----------
    images : ndarray of shape (L, E, M, N, 3), uint8 or uint16
        Red, green and blue of E exposures for each of L places of the flash, as encoded by the camera.
    exposure_s : ndarray of shape (E,), float64
        Times of exposure, shortest first.
    linear : bool
        True where pixel values are proportional to light, as in raw files; False where a response curve lies between.
    room : ndarray of shape (M, N, 3), uint8 or uint16, or None
        The photograph under room light, from the same place.
    light_mm : ndarray of shape (L, 3), float64
        Places of the flash; NaN where not known.
    camera_mm : ndarray of shape (3,), float64
        Place of the camera; NaN where not known.
    sheet_mm : tuple of float, or None
        Width and height of the sheet.
    corners_px : ndarray of shape (4, 2), float64, or None
        Where (column, row) the sheet's corners are seen: top left, top right, bottom right, bottom left.
    wavelength_nm, bandwidth_nm : float or None
        Centre and full width at half maximum of a filter before the camera; None without one.
    light_sigma_mm : float or None
        Standard deviation of the flash's Gaussian extent; None where not known.
    metadata : dict of str to str
        What the camera said about itself.
    """

    images: NDArray[np.unsignedinteger]
    exposure_s: FloatArray
    linear: bool
    room: NDArray[np.unsignedinteger] | None
    light_mm: FloatArray
    camera_mm: FloatArray
    sheet_mm: tuple[float, float] | None = None
    corners_px: FloatArray | None = None
    wavelength_nm: float | None = None
    bandwidth_nm: float | None = None
    light_sigma_mm: float | None = None
    metadata: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class FlashPhotographs:
    """What a sheet sends to the camera under each place of the flash.

    Attributes
    ----------
    radiance : ndarray of shape (L, M, N, 3), float32
        Linear red, green and blue; the same scale for every place of the flash: 1 fills the sensor in the shortest
        exposure.
    valid : ndarray of shape (L, M, N), bool
        Pixels of the sheet that are not saturated even in the shortest exposure; dark ones are valid.
    light_mm : ndarray of shape (L, 3), float64
        Places of the flash; NaN where not known.
    camera_mm : ndarray of shape (3,), float64
        Place of the camera; NaN where not known.
    pixel_mm : float or None
        Pitch on the sheet; None before rectification.
    wavelength_nm, bandwidth_nm : float or None
        Centre and full width at half maximum of a filter before the camera; None without one.
    light_sigma_mm : float or None
        Standard deviation of the flash's Gaussian extent; None where not known.
    room : ndarray of shape (M, N, 3), float32, or None
        The photograph under room light; 1 is full scale.
    sheet_mm : tuple of float, or None
        Width and height of the sheet.
    corners_px : ndarray of shape (4, 2), float64, or None
        Where (column, row) the sheet's corners are seen: top left, top right, bottom right, bottom left; pixels'
        centres are whole numbers. None where not known.
    response : ndarray of shape (256, 3), float64, or None
        Exposure (light times seconds, relative) that makes each level of a channel; None of linear photographs.
    metrics : dict of str to float
        Figures for the table: each name ends in its unit, where it has one.
    """

    radiance: FloatArray
    valid: BoolArray
    light_mm: FloatArray
    camera_mm: FloatArray
    pixel_mm: float | None = None
    wavelength_nm: float | None = None
    bandwidth_nm: float | None = None
    light_sigma_mm: float | None = None
    room: FloatArray | None = None
    sheet_mm: tuple[float, float] | None = None
    corners_px: FloatArray | None = None
    response: FloatArray | None = None
    metrics: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Tiles:
    """Where the tiles that a sheet repeats lie in its rectified photographs.

    Attributes
    ----------
    homographies : ndarray of shape (T, 3, 3), float64
        From (column, row, 1) of the master tile to those of the rectified sheet, up to scale; pixels' centres are whole
        numbers.
    shape : tuple of int
        Rows and columns of the master tile, whose pitch is that of the sheet.
    reference : int
        Which of the tiles is the master: its homography is a translation by whole pixels.
    moved_px : ndarray of shape (T,), float64
        How far the corners of each tile moved at most when it was aligned to the reference; 0 where none was.
    residual_px : ndarray of shape (T,), float64
        By how much each tile still lies beside the reference, from the edges that both show; NaN where that cannot be
        told.
    correlation : ndarray of shape (T,), float64
        Normalised correlation of each tile with the reference under room light; NaN without such a photograph.
    pixel_mm : float
        Pitch.
    pattern : ndarray of shape (rows, columns), float32, or None
        Mean of the edges of all tiles under room light, which is sharp where they are aligned.
    metrics : dict of str to float
        Figures for the table: each name ends in its unit, where it has one.
    """

    homographies: FloatArray
    shape: tuple[int, int]
    reference: int
    moved_px: FloatArray
    residual_px: FloatArray
    correlation: FloatArray
    pixel_mm: float
    pattern: FloatArray | None = None
    metrics: Mapping[str, float] = field(default_factory=dict)
