"""Samples that stand out from all that surrounds them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.optics.height_sampling import filled

Float64Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

_SMOOTH = 1e-3
"""Least noise, as part of the range of heights: what stands out less from a smooth surface is no spike."""


def spikes(height: NDArray[np.floating], radius: int, threshold: float) -> tuple[BoolArray, Float64Array]:
    """Spikes, and what is there without them.

    A group of samples is one where it deviates from the local median, at least half as much as anything in the window,
    is smaller than half the window, and stands above (or below) all samples around it, each by more than ``threshold``
    times the noise; so the corners and edges of a structure are none. The noise is the median deviation from the local
    median, scaled as of normal numbers.

    Parameters
    ----------
    height : ndarray of shape (M, N)
        NaN where it is not known.
    radius : int
        Half width of the window.
    threshold : float
        In standard deviations of the noise.

    Returns
    -------
    found : ndarray of shape (M, N), bool
    local : ndarray of shape (M, N), float64
        The local median.
    """
    whole, known = filled(height), np.isfinite(height)
    side = 2 * radius + 1
    local = ndimage.median_filter(whole, side, mode="nearest")
    if not known.any():
        return np.zeros(height.shape, np.bool_), local
    deviation = np.abs(whole - local)
    low, high = np.percentile(whole[known], [1, 99])
    least = threshold * max(1.4826 * float(np.median(deviation[known])), _SMOOTH * float(high - low))
    candidates = known & (deviation > least) & (deviation > ndimage.maximum_filter(deviation, side) / 2)
    groups, count = ndimage.label(candidates, np.ones((3, 3)))
    if not count:
        return np.zeros(height.shape, np.bool_), local
    index = np.arange(1, count + 1)
    spread = ndimage.maximum_filter(groups, 3)
    around = np.where(groups == 0, spread, 0)
    size = ndimage.sum_labels(np.ones(height.shape), groups, index)
    above = ndimage.minimum(whole, groups, index) > ndimage.maximum(whole, around, index) + least
    below = ndimage.maximum(whole, groups, index) < ndimage.minimum(whole, around, index) - least
    chosen = np.r_[False, (above | below) & (size <= side**2 / 2)]
    return np.asarray(chosen[groups]), local
