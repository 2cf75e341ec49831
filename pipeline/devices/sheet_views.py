"""The pictures of a sheet that settings ask for: rectified, or from a camera."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.devices.virtual_sheet import Sheet
from pipeline.errors import InputError
from pipeline.optics.rasterise import Camera
from pipeline.optics.sheet.view import View, fitting_field_of_view, photographed, rectified

WIDEST_VIEW_DEG = 170.0
LARGEST_SIDE = 16_384
_SEVERAL_TILES = 1920
_CAMERA_PX = (960, 720)

_log = logging.getLogger(__name__)


def rectified_view(
    sheet: Sheet, eye_mm: NDArray[np.float64], size_px: Sequence[int] | None, *, most_px: int | None = None
) -> View:
    """The whole sheet as it lies; without a size, a pixel for each point of the maps, of several tiles not too many."""
    rows, columns = sheet.orientation_rad.shape
    wide, high = columns * sheet.tiles[0], rows * sheet.tiles[1]
    if size_px is not None:
        width, height = sheet.size_mm
        return rectified(size_px[1], size_px[0], max(width / size_px[0], height / size_px[1]), eye_mm)
    most = most_px or (_SEVERAL_TILES if sheet.tiles != (1, 1) else LARGEST_SIDE)
    coarser = max(1.0, max(wide, high) / most)
    if coarser > 1:
        _log.info("The picture has %d pixels along its longer side; size_px asks for others.", most)
    return rectified(round(high / coarser), round(wide / coarser), sheet.pixel_mm * coarser, eye_mm)


def camera_view(
    sheet: Sheet,
    camera_mm: NDArray[np.float64],
    target_mm: Sequence[float],
    up: Sequence[float],
    field_of_view_deg: float | None,
    size_px: Sequence[int] | None,
) -> View:
    """A pinhole camera's picture; without a field of view, one that shows the whole sheet.

    Raises
    ------
    InputError
        No field of view shows the whole sheet.
    """
    columns, rows = size_px or _CAMERA_PX
    camera = Camera(camera_mm, np.asarray(target_mm, np.float64), np.asarray(up, np.float64), np.deg2rad(30.0))
    if field_of_view_deg is None:
        try:
            angle = fitting_field_of_view(camera, *sheet.size_mm, rows, columns)
        except ValueError as error:
            raise InputError(
                str(error), where="camera_mm", expected="a camera that sees the whole sheet, or field_of_view_deg"
            ) from None
        _log.info("A field of view of %.3g degrees shows the whole sheet.", np.rad2deg(angle))
    else:
        angle = float(np.deg2rad(field_of_view_deg))
    return photographed(replace(camera, field_of_view_rad=angle), rows, columns)


def blind_camera(camera_mm: Sequence[float], target_mm: Sequence[float], up: Sequence[float]) -> list[InputError]:
    """What keeps a camera from having a picture: places that are none, or an up that points along the view."""
    problems = [
        InputError(f"{list(vector)} is no {what}", where=where, expected="[x, y, z]")
        for where, what, vector in (("target_mm", "place", target_mm), ("up", "direction", up))
        if len(vector) != 3 or not np.isfinite(vector).all() or (where == "up" and not np.any(vector))
    ]
    if problems:
        return problems
    towards = np.subtract(target_mm, camera_mm)
    if not np.any(towards):
        return [InputError("target_mm is where the camera is", where="target_mm", expected="another place")]
    across = np.linalg.norm(np.cross(towards, up))
    if across <= 1e-9 * np.linalg.norm(towards) * np.linalg.norm(up):
        return [InputError(f"{list(up)} points along the view", where="up", expected="a direction across the view")]
    return []


def unusable_counts(name: str, counts: Sequence[int], expected: str) -> list[InputError]:
    """Two numbers that are no columns and rows."""
    if len(counts) == 2 and all(1 <= count <= LARGEST_SIDE for count in counts):
        return []
    right = f"{expected}, whole numbers from 1 to {LARGEST_SIDE}"
    return [InputError(f"{list(counts)} does not say how many", where=name, expected=right)]
