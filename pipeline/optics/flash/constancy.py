"""Whether gratings share one period: a test on what two halves of the views measure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]
Float64Array = NDArray[np.float64]

SURE = 0.05
"""Relative standard error beyond which a measurement takes no part in the test."""
_BLOCKS = 8
"""Along a side of the tile, for the jackknife."""
_SIGNIFICANT = 3.0
EXPLAINED = 0.25
"""Residual, relative to brightness, above which one period does not explain the views."""
_FAR, _LIMIT = 0.1, 6.0
"""From the median: what counts no more the further it is, and the same in medians of that distance, if these are more.

A few pixels whose second order is taken for the first would outweigh all others.
"""
_FEWEST = 50
"""Pixels measured twice, below which nothing is tested."""


@dataclass(frozen=True)
class Verdict:
    """Whether one period will do, by how many percent pixels vary, and both in words."""

    constant: bool
    percent: float
    words: str


def verdict(found: Array, residual: float, tolerance_percent: float) -> Verdict:
    """Whether the periods of pixels differ by more than their measurements do, and whether one explains all views.

    Parameters
    ----------
    found : ndarray of shape (3, 2, M, N)
        Periods and their standard errors, by all views and by either half of them.
    residual : float
        What one period leaves of the views, relative to their brightness.
    tolerance_percent : float
        Variation that does not matter.
    """
    _, first, second = found[:, 0]
    twice = (found[:, 1] < SURE * found[:, 0]).all(axis=0)
    percent, errors = float("nan"), 0.0
    if np.count_nonzero(twice) >= _FEWEST:
        scatter, errors = common_variation(first[twice], second[twice], blocks_of(first.shape)[twice])
        percent = 100 * scatter
    varies = percent >= tolerance_percent and errors >= _SIGNIFICANT
    constant = not varies and residual < EXPLAINED
    told = (
        f"Periods vary by {percent:.2g} percent ({errors:.1f} standard errors above none)"
        if np.isfinite(percent)
        else f"Whether periods vary is not told: fewer than {_FEWEST} pixels show theirs in either half of the views"
    )
    words = (
        f"{told}, and one period leaves {100 * residual:.2g} percent of the brightness unexplained: "
        f"{'one number will do' if constant else 'a map'}."
    )
    return Verdict(constant, percent, words)


def blocks_of(shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Which of the blocks of a jackknife each pixel belongs to."""
    rows, columns = np.indices(shape)
    return (rows * _BLOCKS // shape[0]) * _BLOCKS + columns * _BLOCKS // shape[1]


def error_of_common(period: Array) -> float:
    """Standard error of one period for all pixels, from the scatter of the medians of blocks."""
    blocks = blocks_of(period.shape)
    known = [period[(blocks == one) & np.isfinite(period)] for one in range(_BLOCKS**2)]
    medians = [np.median(values) for values in known if values.size]
    return float(np.std(medians, ddof=1) / np.sqrt(len(medians))) if len(medians) > 1 else float("nan")


def common_variation(first: Float64Array, second: Float64Array, blocks: NDArray[np.int64]) -> tuple[float, float]:
    """Relative scatter that two measurements of the same pixels share, and how many standard errors it is above none.

    Errors of the two are independent, so that only what really varies makes their covariance. Its standard error
    is that of a jackknife over blocks of pixels, since neighbours are not independent.

    Parameters
    ----------
    first, second : ndarray of shape (P,)
        Periods by either half of the views.
    blocks : ndarray of shape (P,)
        Which block each pixel belongs to.
    """
    left, right = (np.log(period / np.median(period)) for period in (first, second))
    most = max(_FAR, _LIMIT * float(np.median(np.abs(np.concatenate([left, right])))))
    left, right = np.clip(left, -most, most), np.clip(right, -most, most)
    product = (left - left.mean()) * (right - right.mean())
    _, index = np.unique(blocks, return_inverse=True)
    sums, counts = np.bincount(index, product), np.bincount(index)
    total, count, groups = sums.sum(), counts.sum(), len(sums)
    if groups < 2:
        return float(np.sqrt(max(total / count, 0.0))), 0.0
    without = (total - sums) / (count - counts)
    error = np.sqrt((groups - 1) / groups * np.sum((without - without.mean()) ** 2))
    covariance = total / count
    return float(np.sqrt(max(covariance, 0.0))), float(covariance / error) if error > 0 else 0.0
