"""Tiles of a sheet brought onto one of them by homographies, each by its own edges or all by one for the sheet.

The correlation that is made largest is that of Evangelidis and Psarakis, *Parametric image alignment using enhanced
correlation coefficient maximization*, IEEE Transactions on Pattern Analysis and Machine Intelligence 30(10), 2008.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

_STEPS = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 60, 1e-6)
_BLURS_PX = (9, 5)
"""Sides of the windows of the blur, coarse to fine."""
_MARGIN = 0.12
"""Of a tile's size, by which tiles may lie beside where they are looked for."""
_LEAST_CORRELATION = 0.3


def translation(column: float, row: float) -> Float64Array:
    """The homography that moves by so much."""
    return np.array([[1.0, 0.0, column], [0.0, 1.0, row], [0.0, 0.0, 1.0]])


def corners_of(homography: Float64Array, shape: tuple[int, int]) -> Float64Array:
    """Where the centres of a tile's corner pixels lie on the sheet, shape (4, 2)."""
    rows, columns = shape
    there = np.array([[0, 0, 1], [columns - 1, 0, 1], [columns - 1, rows - 1, 1], [0, rows - 1, 1]]) @ homography.T
    return np.asarray(there[:, :2] / there[:, 2:])


def cut(picture: NDArray[np.floating], homography: Float64Array, shape: tuple[int, int]) -> Float32Array:
    """A tile of a sheet's picture (M, N[, C]), NaN beside it."""
    beyond = (float("nan"),) * 4
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    source = np.asarray(picture, np.float32)
    return np.asarray(
        cv2.warpPerspective(
            source, homography, shape[::-1], flags=flags, borderMode=cv2.BORDER_CONSTANT, borderValue=beyond
        )
    )


def aligned(feature: Float32Array, reference: Float32Array, start: Float64Array) -> Float64Array:
    """Bring a tile onto the reference: first by whole pixels, then by a homography that makes the correlation largest.

    Parameters
    ----------
    feature : ndarray of shape (M, N)
        Edges of the sheet.
    reference : ndarray of shape (m, n)
        Those of the reference tile.
    start : ndarray of shape (3, 3)
        The translation where the tile is looked for. It is given back where nothing better is found.
    """
    shape = (reference.shape[0], reference.shape[1])
    margin = max(4, int(_MARGIN * max(shape)))
    window = translation(start[0, 2] - margin, start[1, 2] - margin)
    around = np.nan_to_num(cut(feature, window, (shape[0] + 2 * margin, shape[1] + 2 * margin)))
    there = cv2.matchTemplate(around, reference, cv2.TM_CCOEFF_NORMED)
    row, column = np.unravel_index(int(np.argmax(there)), there.shape)
    warp = translation(float(column), float(row)).astype(np.float32)
    if there.max() < _LEAST_CORRELATION:
        return start
    try:
        for blur in _BLURS_PX:
            _, warp = cv2.findTransformECC(reference, around, warp, cv2.MOTION_HOMOGRAPHY, _STEPS, None, blur)
    except cv2.error:
        return start
    found = window @ np.asarray(warp, np.float64)
    away = np.abs(corners_of(found, shape) - corners_of(start, shape)).max()
    return found / found[2, 2] if away <= 1.5 * margin else start


def likeness(feature: Float32Array, reference: Float32Array, homography: Float64Array) -> float:
    """Normalised correlation of a tile with the reference where both are seen; NaN of what shows no edge."""
    tile = cut(feature, homography, (reference.shape[0], reference.shape[1]))
    seen = np.isfinite(tile)
    if seen.mean() <= 0.5 or not min(np.ptp(tile[seen]), np.ptp(reference[seen])) > 0:
        return np.nan
    return float(np.corrcoef(tile[seen], reference[seen])[0, 1])


def shift_left(feature: Float32Array, reference: Float32Array, homography: Float64Array) -> float:
    """By how many pixels a tile still lies beside the reference."""
    tile = np.nan_to_num(cut(feature, homography, (reference.shape[0], reference.shape[1])))
    window = cv2.createHanningWindow(reference.shape[::-1], cv2.CV_32F)
    smooth = [np.ascontiguousarray(cv2.GaussianBlur(picture, (0, 0), 1.5)) for picture in (reference, tile)]
    warp = np.eye(2, 3, dtype=np.float32)
    try:
        correlation, warp = cv2.findTransformECC(
            smooth[0] * window, smooth[1] * window, warp, cv2.MOTION_TRANSLATION, _STEPS, None, 5
        )
    except cv2.error:
        return np.nan
    return float(np.hypot(*warp[:, 2])) if correlation > _LEAST_CORRELATION else np.nan


def of_one_sheet(
    found: Float64Array, numbers: NDArray[np.int_], steps_px: Float64Array, shape: tuple[int, int], reference: int
) -> tuple[Float64Array, float]:
    """Tiles that lie on one lattice, seen through one homography, and how far those that were found lie off it.

    Parameters
    ----------
    found : ndarray of shape (T, 3, 3)
        Homographies of the tiles, each by itself.
    numbers : ndarray of shape (T, 2)
        How many tiles along and down each lies.
    steps_px : ndarray of shape (2, 2)
        About how far apart tiles are.
    shape : tuple of int
        Rows and columns of a tile.
    reference : int
        The tile whose homography stays as it is.

    Returns
    -------
    homographies : ndarray of shape (T, 3, 3)
        Of all tiles.
    residual_px : float
        Median distance of their middles.

    Notes
    -----
    A homography G of the sheet makes ``G T G^-1`` of a translation T. Affine ones make another translation of it, so
    that six unknowns are left: the two by which G differs from them, and both steps. Least squares, corners that lie
    far off counting little.
    """
    seen = np.stack([corners_of(homography, shape) for homography in found])
    scale = float(max(np.ptp(seen[..., 0]), np.ptp(seen[..., 1])))
    base = found[reference]
    place = translation(*seen[reference].mean(axis=0)) @ np.diag([scale, scale, 1.0])

    def model(unknowns: Float64Array) -> Float64Array:
        tilt = np.eye(3)
        tilt[2, :2] = unknowns[:2]
        tilt = place @ tilt @ np.linalg.inv(place)
        moved = np.stack([translation(*away) for away in (numbers - numbers[reference]) @ unknowns[2:].reshape(2, 2)])
        return np.asarray(tilt @ moved @ np.linalg.inv(tilt) @ base)

    def residuals(unknowns: Float64Array) -> Float64Array:
        there = np.stack([corners_of(homography, shape) for homography in model(unknowns)])
        return np.asarray((there - seen).ravel())

    start = np.concatenate([np.zeros(2), steps_px.ravel()])
    best = least_squares(residuals, start, loss="soft_l1", f_scale=0.3, x_scale=np.r_[np.full(2, 1e-3), np.ones(4)])
    homographies = model(best.x)
    return homographies / homographies[:, 2:, 2:], apart(homographies, found, shape)


def apart(some: Float64Array, others: Float64Array, shape: tuple[int, int]) -> float:
    """Median distance of the middles of tiles by two sets of homographies; noise moves corners more."""
    there, here = (np.stack([corners_of(one, shape).mean(axis=0) for one in every]) for every in (some, others))
    return float(np.median(np.linalg.norm(there - here, axis=1)))
