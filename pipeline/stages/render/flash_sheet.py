"""The photographs that the measured maps of a tile would have given."""

from __future__ import annotations

from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.data.flash import FlashPhotographs, Tiles
from pipeline.data.flash_maps import Highlights
from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.data.pictures import PictureSeries
from pipeline.errors import InputError
from pipeline.limits import above_zero, above_zero_up_to, refuse, zero_or_more
from pipeline.stages.fit._tile_views import bench
from pipeline.stages.render.point_light import point_light

_tolerance_flash_sheet = {"rgb": 5e-4}


def flash_sheet(
    orientation: OrientationMap,
    period: PeriodMap,
    photos: FlashPhotographs,
    tiles: Tiles,
    highlights: Highlights,
    *,
    illuminant: Literal["D65", "A", "inverse A", "E"] = "inverse A",
    depth_um: float | None = None,
    coherence_um: float = 65.0,
    light_sigma_mm: float | None = None,
    light_distance_mm: float | None = None,
    camera_distance_mm: float | None = None,
    white_percentile: float = 70.0,
) -> PictureSeries:
    """Lay the measured tile wherever the sheet repeats it, and render that under the lights of the photographs.

    Parameters
    ----------
    orientation, period : OrientationMap, PeriodMap
        Of the tile, shape (M, N).
    photos : FlashPhotographs
        Rectified; they tell where lights and camera stood, and which pixels the pictures have.
    tiles, highlights : Tiles, Highlights
        Of the same sheet, and of these photographs.
    illuminant : {"D65", "A", "inverse A", "E"}
        Spectrum of the flash.
    depth_um : float, optional
        Peak-to-valley depth of the gratings; by default as the fit of periods found it, or 0.12.
    coherence_um : float
        Width 4 sigma_s of the coherence window.
    light_sigma_mm : float, optional
        Extent of the flash; by default as the photographs state it, or as large as the highlights say.
    light_distance_mm, camera_distance_mm : float, optional
        From the sheet, where the photographs do not know them.
    white_percentile : float
        Becomes 1, of the brightest channel of lit pixels; low, since orders are dimmer than the mirror image.

    Returns
    -------
    PictureSeries
        As many as photographs, of their size; black where no tile lies or nothing was measured.

    Raises
    ------
    InputError
        The maps are of another tile, or a distance is not known.
    """
    _check_flash_sheet(
        depth_um=depth_um,
        coherence_um=coherence_um,
        light_sigma_mm=light_sigma_mm,
        light_distance_mm=light_distance_mm,
        camera_distance_mm=camera_distance_mm,
        white_percentile=white_percentile,
    )
    if not orientation.orientation_rad.shape == period.period_um.shape == tuple(tiles.shape):
        raise InputError(
            f"maps of {orientation.orientation_rad.shape} and {period.period_um.shape} are not of a tile of "
            f"{tuple(tiles.shape)}",
            expected="the maps of the same tile",
        )
    placed = bench(
        photos,
        highlights,
        light_distance_mm=light_distance_mm,
        camera_distance_mm=camera_distance_mm,
        light_sigma_mm=light_sigma_mm,
        coherence_um=coherence_um,
        keep_off=0.0,
    )
    row, column, covered = _laid(tiles, (photos.valid.shape[1], photos.valid.shape[2]))
    tangent, periods = (
        np.where(covered, part[row, column], np.float32(np.nan))
        for part in (orientation.orientation_rad, period.period_um)
    )
    return point_light(
        OrientationMap.of_angles(tangent, pixel_mm=tiles.pixel_mm, absolute=orientation.absolute),
        PeriodMap(periods, np.isfinite(periods), tiles.pixel_mm, relative=period.relative),
        lights_mm=placed.light_mm.tolist(),
        camera_mm=placed.eye_mm.tolist(),
        light_sigma_mm=placed.light_sigma_mm,
        illuminant=illuminant,
        depth_um=depth_um or period.metrics.get("depth_um", 0.12),
        coherence_um=coherence_um,
        white_percentile=white_percentile,
    )


def _laid(tiles: Tiles, shape: tuple[int, int]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Which row and column of the tile lies at each pixel of the sheet, and where one does."""
    numbers = np.arange(1, tiles.shape[0] * tiles.shape[1] + 1, dtype=np.float64).reshape(tiles.shape)
    laid = np.zeros(shape)
    for homography in tiles.homographies:
        seen = cv2.warpPerspective(numbers, homography, shape[::-1], flags=cv2.INTER_NEAREST)
        laid = np.where(seen > 0, seen, laid)
    index = np.maximum(laid.astype(np.int64) - 1, 0)
    return index // tiles.shape[1], index % tiles.shape[1], laid > 0


def _check_flash_sheet(
    *,
    depth_um: float | None,
    coherence_um: float,
    light_sigma_mm: float | None,
    light_distance_mm: float | None,
    camera_distance_mm: float | None,
    white_percentile: float,
    **_: object,
) -> None:
    """Refuse impossible sizes before anything runs."""
    refuse(
        zero_or_more(depth_um=depth_um),
        above_zero_up_to(100, white_percentile=white_percentile),
        above_zero(
            coherence_um=coherence_um,
            light_sigma_mm=light_sigma_mm,
            light_distance_mm=light_distance_mm,
            camera_distance_mm=camera_distance_mm,
        ),
    )
