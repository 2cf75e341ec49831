"""Counts of photons that move by at most a few electrons, in few pixels, when the light moves by a last bit.

A sampler that rejects takes as many random numbers as the light at a pixel makes it, so that a last bit at one pixel
changes the noise of all that follow. Here each pixel has one normal deviate of its own, and its count is the quantile
of the Poisson distribution that this deviate names.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.compiled import njit

_EXACT_BELOW = 30.0
_MOST_COUNTED = 400
"""Beyond any count of a mean below 30 that a double tells from certainty."""


def photon_counts(mean: NDArray[np.floating], rng: np.random.Generator) -> NDArray[np.float64]:
    """Poisson-distributed counts, one normal deviate of ``rng`` each.

    Parameters
    ----------
    mean : ndarray
        Expected counts, not negative.
    rng : numpy.random.Generator
        Gives as many normal deviates as there are means, whatever they are.

    Returns
    -------
    ndarray of float64
        Whole numbers, of the same shape.

    Notes
    -----
    Below a mean of 30 the distribution is summed up to the deviate's probability. Above, the expansion of the quantile
    in the deviate w is cut to whole numbers: Q(w) = m + sqrt(m) w + (1/3 + w^2/6) - (w/36 + w^3/72) / sqrt(m) + (-8/405
    + 7 w^2/810 + w^4/270) / m; Giles, *Algorithm 955: approximation of the inverse Poisson cumulative distribution
    function*, ACM Transactions on Mathematical Software 42(1), 2016, there named Q_N2.
    """
    deviates = rng.standard_normal(mean.shape)
    return _counts(np.ascontiguousarray(mean, np.float64).ravel(), deviates.ravel()).reshape(mean.shape)


@njit(nogil=True, cache=True)
def _counts(mean, deviates):  # type: ignore[no-untyped-def]
    counts = np.empty_like(mean)
    for index in range(mean.size):
        m, w = mean[index], deviates[index]
        counts[index] = _quantile_by_sum(m, w) if m < _EXACT_BELOW else _quantile_by_expansion(m, w)
    return counts


@njit(nogil=True, cache=True)
def _quantile_by_sum(m, w):  # type: ignore[no-untyped-def]
    wanted = 0.5 * math.erfc(-w / math.sqrt(2.0))
    count = 0
    term = math.exp(-m)
    total = term
    while total < wanted and count < _MOST_COUNTED:
        count += 1
        term *= m / count
        total += term
    return float(count)


@njit(nogil=True, cache=True)
def _quantile_by_expansion(m, w):  # type: ignore[no-untyped-def]
    root = math.sqrt(m)
    square = w * w
    count = m + root * w + (1 / 3 + square / 6) - w * (1 / 36 + square / 72) / root
    return max(0.0, math.floor(count + (-8 / 405 + square * (7 / 810 + square / 270)) / m))
