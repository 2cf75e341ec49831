"""Photographs of a sheet as it would lie on a scanner."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.data.flash import FlashPhotographs
from pipeline.errors import InputError
from pipeline.limits import above_zero, above_zero_up_to, refuse
from pipeline.optics.charuco import Board
from pipeline.optics.colour import LUMINANCE, encode_srgb
from pipeline.optics.sheet.view import rectified as scanned
from pipeline.optics.sheet_corners import ordered, outlined_corners

Float64Array = NDArray[np.float64]

_LARGEST_SIDE = 16_384
_ODD_ASPECT = 0.2
_CROOKED_PX = 0.5
_OUTSIDE_PX = 2.0
_log = logging.getLogger(__name__)
_tolerance_rectified = {"radiance": 1e-3, "room": 1e-3, "corners_px": 1e-2}


def rectified(
    photos: FlashPhotographs,
    *,
    corners: Literal["auto", "given", "contour", "charuco"] = "auto",
    corners_px: list[list[float]] | None = None,
    sheet_mm: list[float] | None = None,
    pixel_mm: float | None = None,
    board: list[int] = [29, 22],  # noqa: B006 - read from the syntax tree, never modified
    square_mm: float = 12.0,
    marker_mm: float = 9.0,
) -> FlashPhotographs:
    """Bring the sheet upright and to scale by the homography of its four corners.

    Parameters
    ----------
    photos : FlashPhotographs
        As the camera saw it.
    corners : {"auto", "given", "contour", "charuco"}
        Where they come from: ``corners_px`` here or from the capture; the outline of the sheet, which has to be
        brighter than what lies around it; or a ChArUco board below the middle of the sheet. ``auto`` takes what is
        given, else the outline.
    corners_px : list of four [column, row], optional
        Instead of what the capture says, in any order; whole numbers in the middle of pixels.
    sheet_mm : [width, height], optional
        Instead of what the capture says.
    pixel_mm : float, optional
        Pitch; by default that of the photographs.
    board : [columns, rows]
        Squares of the board, of OpenCV's dictionary of 4 x 4 markers.
    square_mm, marker_mm : float
        Sides of its squares, and of the markers in them.

    Returns
    -------
    FlashPhotographs
        Row 0 at the largest y, the sheet's middle in the middle; ``corners_px`` are those that were used, in the
        photographs before.

    Raises
    ------
    InputError
        The sheet's size is not known, the corners are neither given nor found, or the pitch makes too many pixels.

    Notes
    -----
    Toisoul, Dhillon and Ghosh 2018, section 4.2.
    """
    _check_rectified(
        corners_px=corners_px,
        sheet_mm=sheet_mm,
        pixel_mm=pixel_mm,
        board=board,
        square_mm=square_mm,
        marker_mm=marker_mm,
    )
    size = (sheet_mm[0], sheet_mm[1]) if sheet_mm is not None else photos.sheet_mm
    if size is None:
        raise InputError(
            "the size of the sheet is not known",
            where="sheet_mm",
            expected="[width, height] in mm, here or in capture.yaml",
        )
    told = photos.corners_px if corners_px is None else corners_px
    given = None if told is None else ordered(np.asarray(told, np.float64))
    metrics: dict[str, float] = {}
    if corners == "charuco":
        seen = _by_board(photos, Board(board[0], board[1], square_mm, marker_mm), size)
    elif corners == "contour" or (corners == "auto" and given is None):
        seen, metrics["edge_residual_px"] = _by_outline(photos)
        if metrics["edge_residual_px"] > _CROOKED_PX:
            _log.warning("the sheet's edges lie %.2g px off straight lines", metrics["edge_residual_px"])
    elif given is None:
        raise InputError("no corners are given", where="corners_px", expected="four [column, row], or corners: contour")
    else:
        seen = given
    _refuse_folded(seen)
    _refuse_outside(seen, photos.valid.shape[1:])
    to_photo = _homography(seen, size)
    pitch = pixel_mm or float(np.sqrt(size[0] * size[1] / cv2.contourArea(seen.astype(np.float32))))
    rows, columns = round(size[1] / pitch), round(size[0] / pitch)
    if not 1 <= max(rows, columns) <= _LARGEST_SIDE:
        raise InputError(
            f"the sheet would have {columns} x {rows} pixels",
            where="pixel_mm",
            expected=f"up to {_LARGEST_SIDE} a side",
        )
    _warn_of_aspect(seen, size)
    _log.info("%d x %d pixels of %.4g mm; corners at %s", columns, rows, pitch, np.round(seen, 2).tolist())
    sampled = to_photo @ scanned(rows, columns, pitch, np.zeros(3)).homography
    return replace(
        photos,
        radiance=np.stack([_warped(picture, sampled, (columns, rows)) for picture in photos.radiance]),
        valid=np.stack([_warped(v.astype(np.float32), sampled, (columns, rows)) > 0.999 for v in photos.valid]),
        room=None if photos.room is None else _warped(photos.room, sampled, (columns, rows)),
        pixel_mm=pitch,
        sheet_mm=size,
        corners_px=seen,
        metrics=metrics,
    )


def _check_rectified(
    *,
    corners_px: list[list[float]] | None,
    sheet_mm: list[float] | None,
    pixel_mm: float | None,
    board: list[int],
    square_mm: float,
    marker_mm: float,
    **_: object,
) -> None:
    """Refuse impossible corners, sizes and boards before anything runs."""
    problems = []
    if corners_px is not None and (
        len(corners_px) != 4 or any(len(corner) != 2 or not np.isfinite(corner).all() for corner in corners_px)
    ):
        problems.append(
            InputError(f"{corners_px} are no corners", where="corners_px", expected="four [column, row] in pixels")
        )
    if sheet_mm is not None and (len(sheet_mm) != 2 or not min(sheet_mm) > 0 or not np.isfinite(sheet_mm).all()):
        problems.append(InputError(f"{sheet_mm} is no size", where="sheet_mm", expected="[width, height] in mm"))
    if len(board) != 2 or min(board) < 2:
        problems.append(
            InputError(f"{board} is no board", where="board", expected="[columns, rows] of squares, from 2")
        )
    refuse(
        problems,
        above_zero(pixel_mm=pixel_mm, square_mm=square_mm),
        above_zero_up_to(square_mm, marker_mm=marker_mm) if square_mm > 0 else above_zero(marker_mm=marker_mm),
    )


def _grey(photos: FlashPhotographs) -> NDArray[np.float32]:
    """Room light, which shows the sheet best, else the logarithm of all flashes' sum, lest highlights count most."""
    weights = np.asarray(LUMINANCE, np.float32)
    if photos.room is not None:
        return np.asarray(photos.room @ weights, np.float32)
    light = photos.radiance.sum(axis=0) @ weights
    floor = max(float(np.percentile(light, 2)), 1e-9)
    return np.asarray(np.log1p(np.maximum(light, 0) / floor), np.float32)


def _by_outline(photos: FlashPhotographs) -> tuple[Float64Array, float]:
    try:
        return outlined_corners(_grey(photos))
    except ValueError as problem:
        raise InputError(
            f"the sheet is not found: {problem}", where="corners", expected="corners_px, or a sheet on a dark table"
        ) from None


def _by_board(photos: FlashPhotographs, board: Board, sheet_mm: tuple[float, float]) -> Float64Array:
    grey = _grey(photos)
    levels = (255 * encode_srgb(grey / np.float32(np.percentile(grey, 99)))).astype(np.uint8)
    try:
        homography = board.homography(levels)
    except ValueError as problem:
        raise InputError(str(problem), where="corners", expected="a board that is seen, or corners: contour") from None
    seen = np.column_stack([_of_sheet(sheet_mm), np.ones(4)]) @ homography.T
    return np.asarray(seen[:, :2] / seen[:, 2:])


def _homography(seen: Float64Array, sheet_mm: tuple[float, float]) -> Float64Array:
    """From mm on the sheet to pixels of the photograph."""
    there = _of_sheet(sheet_mm).astype(np.float32)
    return np.asarray(cv2.findHomography(there, seen)[0], np.float64)


def _of_sheet(sheet_mm: tuple[float, float]) -> Float64Array:
    x, y = sheet_mm[0] / 2, sheet_mm[1] / 2
    return np.array([[-x, y], [x, y], [x, -y], [-x, -y]])


def _warped(picture: NDArray[np.float32], sampled: Float64Array, size: tuple[int, int]) -> NDArray[np.float32]:
    return np.asarray(
        cv2.warpPerspective(picture, sampled, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP), np.float32
    )


def _refuse_folded(seen: Float64Array) -> None:
    if not cv2.isContourConvex(seen.astype(np.float32)) or cv2.contourArea(seen.astype(np.float32)) < 4:
        raise InputError(
            f"the corners {np.round(seen, 1).tolist()} are none of a sheet",
            where="corners_px",
            expected="a convex quadrilateral",
        )


def _refuse_outside(seen: Float64Array, shape: tuple[int, ...]) -> None:
    last = np.array(shape[::-1]) - 1
    for corner in seen[((seen < -_OUTSIDE_PX) | (seen > last + _OUTSIDE_PX)).any(axis=1)]:
        raise InputError(
            f"the corner {np.round(corner, 1).tolist()} lies outside the photographs",
            where="corners_px",
            expected=f"[column, row], up to {last.tolist()}",
        )


def _warn_of_aspect(seen: Float64Array, sheet_mm: tuple[float, float]) -> None:
    sides = np.linalg.norm(np.roll(seen, -1, axis=0) - seen, axis=1)
    aspect = (sides[0] + sides[2]) / (sides[1] + sides[3])
    if abs(np.log(aspect * sheet_mm[1] / sheet_mm[0])) > _ODD_ASPECT:
        _log.warning(
            "corners are %.3g times as far apart across as down, the sheet's sides %.3g: is sheet_mm [width, height], "
            "and are the photographs upright?",
            aspect,
            sheet_mm[0] / sheet_mm[1],
        )
