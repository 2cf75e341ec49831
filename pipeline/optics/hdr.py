"""Brackets of exposures merged into radiance, by OpenCV's Debevec and Malik or by a plain weighted mean.

Debevec and Malik, *Recovering high dynamic range radiance maps from photographs*, SIGGRAPH 1997: with Z the level of
pixel i in exposure j of time t_j, ``g(Z_ij) = ln E_i + ln t_j`` is solved for the inverse response g and the radiances
E by least squares, g being smooth.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

BoolArray = NDArray[np.bool_]
Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
Levels = NDArray[np.unsignedinteger]

_GRID = 9
"""Side of the square of pixels from which the response is solved; 50 would do with two exposures."""
_DARKEST, _BRIGHTEST = 4, 250
"""Levels of 255 between which one says something of the light."""
_NOISE = 4
"""Levels by which a pixel may seem darker in a longer exposure."""
_LEAST_RANGE = 128
"""Levels that a channel must reach to have a response of its own."""


def response_curve(brackets: NDArray[np.uint8], exposure_s: Float64Array, smoothness: float = 10.0) -> Float64Array:
    """Exposure, light times seconds, that makes each of 256 levels of a channel, shape (256, 3); 1 for level 128.

    Parameters
    ----------
    brackets : ndarray of shape (L, E, M, N, 3), uint8
        Several brackets of one camera, of E >= 2 exposures.
    exposure_s : ndarray of shape (E,)
        Their times.
    smoothness : float
        Weight of the curve's second differences, lambda in the paper.

    Notes
    -----
    Most of a dark photograph says nothing, so that pixels are chosen that cover all levels evenly. A channel that is
    dark throughout, as behind a filter, gets the curve of the brightest.
    """
    chosen = _spread_pixels(brackets)
    calibrate = cv2.createCalibrateDebevec(samples=_GRID**2, lambda_=smoothness)
    times = exposure_s.astype(np.float32)
    curve = np.asarray(calibrate.process(list(chosen), times), np.float64).reshape(256, 3)
    reached = chosen.max(axis=(0, 1, 2))
    curve[:, reached < _LEAST_RANGE] = curve[:, [int(np.argmax(reached))]]
    return np.maximum.accumulate(curve, axis=0)


def merged(bracket: NDArray[np.uint8], exposure_s: Float64Array, response: Float64Array) -> Float32Array:
    """Radiance (M, N, 3) of one bracket (E, M, N, 3) by a response curve, by OpenCV's ``MergeDebevec``.

    Channel by channel, for it would give all channels of a pixel one weight, also one that is saturated. What is so
    even in the shortest exposure gets the radiance that would just do that.
    """
    times, curve = exposure_s.astype(np.float32), response.astype(np.float32)
    merge = cv2.createMergeDebevec()
    radiance = np.empty(bracket.shape[1:], np.float32)
    for channel in range(3):
        levels = [np.ascontiguousarray(picture[..., channel]) for picture in bracket]
        radiance[..., channel] = merge.process(levels, times, np.ascontiguousarray(curve[:, channel, None]))
    shortest = bracket[int(np.argmin(exposure_s))]
    least = (response[_BRIGHTEST] / exposure_s.min()).astype(np.float32)
    return np.asarray(np.where(shortest > _BRIGHTEST, np.maximum(radiance, least), radiance), np.float32)


def weighted_mean(bracket: Levels, exposure_s: Float64Array, *, linear: bool) -> Float32Array:
    """Radiance (M, N, 3) of one bracket as the mean of level over time; 1 fills the sensor in a second.

    Of linear levels the brightest count most that are not full, for photons are counted; others are taken for sRGB, and
    those in the middle count most. What is full even in the shortest exposure gets the radiance that just fills it.
    """
    full = np.iinfo(bracket.dtype).max
    table = np.arange(full + 1) / full
    value = table if linear else np.where(table <= 0.04045, table / 12.92, ((table + 0.055) / 1.055) ** 2.4)
    weight = table if linear else np.minimum(table, 1 - table)
    weight = np.where(table <= _BRIGHTEST / 255, weight + 1e-4, 1e-9).astype(np.float32)
    total, weights = (np.zeros(bracket.shape[1:], np.float32) for _ in range(2))
    for levels, time in zip(bracket, exposure_s, strict=True):
        share = weight[levels]
        total += share * (value / time).astype(np.float32)[levels]
        weights += share
    shortest = bracket[int(np.argmin(exposure_s))]
    return np.maximum(total / weights, np.where(shortest == full, np.float32(1 / exposure_s.min()), 0))


def full_scale(response: Float64Array) -> float:
    """Exposure that fills the sensor, by a curve whose last levels are little sure."""
    return float(response[_BRIGHTEST].mean())


def unsaturated(bracket: Levels, exposure_s: Float64Array) -> BoolArray:
    """Pixels (M, N) of a bracket whose shortest exposure is full in no channel."""
    shortest = bracket[int(np.argmin(exposure_s))]
    return np.asarray(shortest.max(axis=-1) <= np.iinfo(bracket.dtype).max * (_BRIGHTEST / 255))


def _spread_pixels(brackets: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Pixels of several brackets whose levels are spread evenly, a square of them for each exposure (E, k, k, 3).

    Of pixels as bright, those are taken that differ least from their neighbours; none that is darker in a longer
    exposure, for there something moved.
    """
    count, exposures = _GRID**2, brackets.shape[1]
    middle = brackets[:, exposures // 2]
    edges = np.stack([cv2.morphologyEx(picture, cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8)) for picture in middle])
    said = brackets.sum(axis=1, dtype=np.float32)
    told = ((brackets >= _DARKEST) & (brackets <= _BRIGHTEST)).sum(axis=1, dtype=np.int8) >= min(2, exposures)
    moved = np.any(brackets[:, 1:] < np.maximum(brackets[:, :-1], _NOISE) - _NOISE, axis=1).any(axis=-1)
    told[moved] = False
    picked: list[NDArray[np.intp]] = []
    for channel in range(3):
        place = np.flatnonzero(told[..., channel])
        if not place.size:
            continue
        bright, edge = said[..., channel].ravel()[place], edges[..., channel].ravel()[place]
        share = np.minimum((bright - bright.min()) / max(float(np.ptp(bright)), 1.0) * count, count - 1).astype(int)
        order = np.lexsort((edge, share))
        first = np.unique(share[order], return_index=True)[1]
        picked.append(place[order][first])
    every = np.concatenate(picked) if picked else np.arange(said[..., 0].size)
    places = every[np.linspace(0, len(every) - 1, count).astype(int)]
    stacked = np.moveaxis(brackets, 1, 0).reshape(exposures, -1, 3)
    return np.ascontiguousarray(stacked[:, places]).reshape(exposures, _GRID, _GRID, 3)
