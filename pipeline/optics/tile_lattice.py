"""How a pattern repeats: the lattice of its autocorrelation, and the tiles that lie on it."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.ndimage import maximum_filter

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

LEAST_TILE_PX = 16
_LEAST_CORRELATION = 0.2
_AS_GOOD = 0.7
"""Of the best peak's correlation, that a shorter period reaches if it is one."""
_RIDGE = 0.95
_LEAST_OVERLAP = 0.25
_LEAST_ANGLE = 0.3
_LARGEST_TURN = 0.03
"""Radians by which rows of tiles may be turned against the rows of pixels."""
_NEAR_PX = 3


def edges(picture: Float32Array, blur_px: float = 1.0) -> Float32Array:
    """How steep a grey picture is, relative to its surroundings, of mean 0: what does not change with the light."""
    smooth = cv2.GaussianBlur(picture, (0, 0), blur_px)
    steep = np.hypot(cv2.Scharr(smooth, cv2.CV_32F, 1, 0), cv2.Scharr(smooth, cv2.CV_32F, 0, 1))
    wide = max(picture.shape) / 12
    usual = cv2.GaussianBlur(steep, (0, 0), wide)
    level = np.sqrt(np.minimum(steep / np.maximum(usual, 1e-6 * float(steep.max(initial=1e-12))), 6.0))
    return np.asarray(level - level.mean(), np.float32)


def lattice(feature: Float32Array) -> tuple[Float64Array, float]:
    """The shortest steps by which a picture of mean 0 repeats, and how well it does.

    Returns
    -------
    steps_px : ndarray of shape (2, 2)
        ``(column, row)``: to the next tile on the right, in a direction near that of the rows of pixels, and to the
        next row of tiles below, which may be shifted as bricks are.
    correlation : float
        Normalised, of the picture with itself moved by either step; the lesser one.

    Raises
    ------
    ValueError
        Nothing repeats at least twice, or not in rows along those of the pixels.
    """
    correlation = _autocorrelation(feature)
    middle = np.array(correlation.shape) // 2
    peaks = (correlation == maximum_filter(correlation, 2 * _NEAR_PX + 1)) & (correlation > _LEAST_CORRELATION)
    row, column = np.nonzero(peaks)
    standing = [_stands_out(correlation, int(r), int(c)) for r, c in zip(row, column, strict=True)]
    row, column = row[standing], column[standing]
    away = np.column_stack([column - middle[1], row - middle[0]])
    value = correlation[row, column]
    far = np.hypot(*away.T) >= LEAST_TILE_PX
    if not far.any():
        raise ValueError("its autocorrelation has no peak that stands out on all sides")
    good = far & (value >= _AS_GOOD * value[far].max())
    away = away[good][np.argsort(np.hypot(*away[good].T), kind="stable")]
    first = away[0]
    sine = np.abs(np.cross(np.pad(away, ((0, 0), (0, 1))), np.append(first, 0))[:, 2])
    other = away[sine > np.sin(_LEAST_ANGLE) * np.hypot(*away.T) * np.hypot(*first)]
    if not len(other):
        raise ValueError("it repeats along one direction only")
    steps = _refined(correlation, np.array([first, other[0]], np.float64))
    steps = _in_rows(steps)
    return steps, float(min(_near(correlation, step)[1] for step in steps))


def placed(
    shape: tuple[int, int], steps_px: Float64Array, origin_px: Float64Array, size_px: tuple[float, float], slack: float
) -> NDArray[np.int_]:
    """Numbers ``(along, down)`` of the tiles, shape (T, 2), that lie inside a picture up to ``slack`` of their size."""
    reach = int(np.ceil(2 * max(shape) / min(np.hypot(*steps_px.T)))) + 1
    numbers = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 2), axis=-1).reshape(-1, 2)
    corner = origin_px + numbers @ steps_px
    most = np.array(shape[::-1]) - size_px
    inside = (corner >= -slack * np.array(size_px)) & (corner <= most + slack * np.array(size_px))
    found = numbers[inside.all(axis=1)]
    return np.asarray(found[np.lexsort((found[:, 0], found[:, 1]))])


def _autocorrelation(feature: Float32Array) -> Float64Array:
    """Normalised by the energies of both parts that overlap; 0 where too little does. No displacement in the middle."""
    shape = tuple(fft.next_fast_len(2 * side, real=True) for side in feature.shape)
    whole = np.ones(feature.shape, np.float32)
    f, energy, mask = (fft.rfft2(x, shape, workers=2) for x in (feature, feature**2, whole))
    product, one, overlap = (
        fft.irfft2(s, shape, workers=2) for s in (f * f.conj(), energy * mask.conj(), mask * mask.conj())
    )
    other = np.roll(one[::-1, ::-1], (1, 1), axis=(0, 1))
    norm = np.sqrt(np.maximum(one, 0) * np.maximum(other, 0))
    enough = overlap >= _LEAST_OVERLAP * feature.size
    found = np.where(enough, product / np.maximum(norm, 1e-9 * float(norm.max()) or 1.0), 0)
    return np.asarray(np.fft.fftshift(found), np.float64)


def _stands_out(correlation: Float64Array, row: int, column: int) -> bool:
    """Whether the correlation falls on all sides of a peak, which it does not along stripes."""
    angle = np.arange(16) * np.pi / 8
    r = np.rint(row + LEAST_TILE_PX / 2 * np.sin(angle)).astype(int)
    c = np.rint(column + LEAST_TILE_PX / 2 * np.cos(angle)).astype(int)
    inside = (r >= 0) & (r < correlation.shape[0]) & (c >= 0) & (c < correlation.shape[1])
    return bool(correlation[r[inside], c[inside]].max() < _RIDGE * correlation[row, column])


def _near(correlation: Float64Array, away: Float64Array) -> tuple[Float64Array, float]:
    """The peak near a displacement, to a part of a pixel, and its height; NaN where it lies outside."""
    middle = np.array(correlation.shape[::-1]) // 2
    x, y = np.rint(away + middle).astype(int)
    n = _NEAR_PX
    window = correlation[max(y - n, 0) : y + n + 1, max(x - n, 0) : x + n + 1]
    if window.shape != (2 * n + 1, 2 * n + 1) or not window.all():
        return np.full(2, np.nan), np.nan
    row, column = np.unravel_index(int(np.argmax(window)), window.shape)
    if not (0 < row < 2 * n and 0 < column < 2 * n):
        return np.full(2, np.nan), np.nan
    top = window[row - 1 : row + 2, column - 1 : column + 2]
    shift = [_vertex(*top[1, :]), _vertex(*top[:, 1])]
    return np.array([x - n + column, y - n + row]) + shift - middle, float(top[1, 1])


def _vertex(before: float, at: float, after: float) -> float:
    bend = before - 2 * at + after
    return 0.5 * (before - after) / bend if bend < 0 else 0.0


def _refined(correlation: Float64Array, steps: Float64Array) -> Float64Array:
    """Steps by least squares over all peaks that they lead to, the far ones the last."""
    for reach in (1, 2, 4, 8, 16):
        numbers = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 2), axis=-1).reshape(-1, 2)
        numbers = numbers[numbers.any(axis=1)]
        found = [_near(correlation, number @ steps) for number in numbers]
        known = np.array([value > _LEAST_CORRELATION for _, value in found])
        if known.sum() < 4:
            continue
        places, weights = np.array([place for place, _ in found])[known], np.array([v for _, v in found])[known]
        steps = np.linalg.lstsq(numbers[known] * weights[:, None], places * weights[:, None], rcond=None)[0]
    return steps


def _in_rows(steps: Float64Array) -> Float64Array:
    """A basis of the same lattice: along the rows of pixels, and down."""
    numbers = np.stack(np.meshgrid(*[np.arange(-3, 4)] * 2), axis=-1).reshape(-1, 2)
    vectors = numbers[numbers.any(axis=1)] @ steps
    along = vectors[(vectors[:, 0] > 0) & (np.abs(vectors[:, 1]) <= np.tan(_LARGEST_TURN) * vectors[:, 0])]
    if not len(along):
        raise ValueError("its rows do not run along the sides of the sheet")
    right = along[np.argmin(np.hypot(*along.T))]
    area = abs(np.linalg.det(steps))
    cross = right[0] * vectors[:, 1] - right[1] * vectors[:, 0]
    down = vectors[np.abs(cross - area) < 1e-6 * area]
    return np.array([right, down[np.argmin(np.abs(down @ right))]])
