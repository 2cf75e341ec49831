"""Planes and line offsets that a scan adds to a surface, found in spite of its own structure.

Weights fall to zero at the edges (Hann). A plane through a grating of N periods is tilted by the grating itself, by its
depth over N from edge to edge where all samples count alike; weighted so, by a part of it that falls with the fourth
power of N.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]

_CONVERGED_UM = 1e-7
_MOST_ROUNDS = 30
_ROUGH = 0.6
"""Least ratio of the third differences' scatter to the first ones': independent lines have 1, a random walk 0.77."""
_ABOVE = 3.0
"""How many times rows have to jump more than columns do."""
_SMOOTH = 1e-4
"""Least jump, as part of the range of heights."""
_LEAST_SIDE = 8
_MIDDLE = 1.2
"""Variance of the mean over the middle half of normal numbers, over that of the mean."""
_FEWEST_CYCLES = 5
_LINE = 50.0
"""Power over that of the frequencies around it from which on rows are taken for a structure that repeats."""


def taper(count: int) -> Float64Array:
    """A Hann window of ``count`` samples, none of them zero."""
    return np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 2


def plane(height: NDArray[np.floating]) -> Float64Array:
    """The plane of weighted least squares through what is known, of the same shape (M, N)."""
    constant, along_x, along_y = _slopes(height)
    rows, columns = height.shape
    return constant + along_x * np.linspace(-1, 1, columns) + along_y * np.linspace(-1, 1, rows)[:, None]


def _slopes(height: NDArray[np.floating]) -> tuple[float, float, float]:
    """The plane's height in the middle, and how much higher it is at the right edge and at the lower one."""
    rows, columns = height.shape
    known = np.isfinite(height)
    weight = taper(rows)[:, None] * taper(columns) * known
    y, x = np.linspace(-1, 1, rows)[:, None], np.linspace(-1, 1, columns)
    terms = [np.ones((rows, columns)), np.broadcast_to(x, height.shape), np.broadcast_to(y, height.shape)]
    moments = np.array([[np.sum(weight * a * b) for b in terms] for a in terms])
    values = np.where(known, height, 0.0)
    right = np.array([np.sum(weight * a * values) for a in terms])
    constant, along_x, along_y = np.linalg.lstsq(moments, right)[0].tolist()
    return constant, along_x, along_y


def row_medians(height: NDArray[np.floating]) -> Float64Array:
    """The weighted median of each row, of shape (M,); 0 where nothing of the row is known."""
    known = np.isfinite(height)
    order = np.argsort(np.where(known, height, np.inf), axis=1)
    weights = np.take_along_axis(np.where(known, taper(height.shape[1]), 0.0), order, axis=1).cumsum(axis=1)
    place = np.argmax(weights >= weights[:, -1:] / 2, axis=1)[:, None]
    middle = np.take_along_axis(height, np.take_along_axis(order, place, axis=1), axis=1)[:, 0]
    return np.where(known.any(axis=1), middle, 0.0)


def row_polynomials(height: NDArray[np.floating], degree: int) -> Float64Array:
    """The polynomial of weighted least squares along each row, of shape (M, N); 0 where nothing of the row is known."""
    columns = height.shape[1]
    known = np.isfinite(height)
    terms = np.polynomial.legendre.legvander(np.linspace(-1, 1, columns), degree)
    weight = taper(columns) * known
    moments = np.einsum("rc,ci,cj->rij", weight, terms, terms, optimize=True)
    right = np.einsum("rc,ci->ri", weight * np.where(known, height, 0.0), terms)
    return np.asarray((np.linalg.pinv(moments, hermitian=True) @ right[..., None])[..., 0] @ terms.T)


def without_slope_and_medians(height: NDArray[np.floating]) -> Float64Array:
    """Take the slope along the rows and their medians away in turn until neither changes anything any more.

    The slope across the rows goes with the medians.
    """
    level = np.asarray(height, np.float64)
    for _ in range(_MOST_ROUNDS):
        slope = _slopes(level)[1]
        level = level - slope * np.linspace(-1, 1, level.shape[1])
        offsets = row_medians(level)
        level = level - offsets[:, None]
        if max(abs(slope), np.abs(offsets).max()) < _CONVERGED_UM:
            break
    return level


def lines_jump(height: NDArray[np.floating]) -> bool:
    """Whether neighbouring rows jump against each other as lines of a scan do, and columns do not.

    What counts is by how much each row differs from the next in the mean over the middle half of its samples, which
    structure along the columns leaves alone.
    Jumps are independent from row to row, which structure that is sampled finely is not: their third differences
    scatter as much as their first ones, each over what it multiplies independent numbers by.
    """
    known = height[np.isfinite(height)]
    if min(height.shape) < _LEAST_SIDE or not known.size:
        return False
    rows, columns = _middle_means(np.diff(height, axis=0)), _middle_means(np.diff(height, axis=1).T)
    noise = _scatter(np.diff(height, n=2, axis=1), 2) * np.sqrt(2 * _MIDDLE / height.shape[1])
    least = max(_ABOVE * _scatter(np.diff(columns, 2), 3), _ABOVE * noise, _SMOOTH * float(np.ptp(known)))
    rough = _scatter(np.diff(rows, 2), 3)
    return bool(rough > least and rough > _ROUGH * _scatter(rows, 1))


def _middle_means(values: NDArray[np.floating]) -> Float64Array:
    """The mean over the middle half of each row, by size, of shape (M,); 0 where nothing of the row is known."""
    rank, count = np.arange(values.shape[1]), np.isfinite(values).sum(axis=1)[:, None]
    middle = (rank >= count // 4) & (rank < count - count // 4)
    return np.asarray(np.where(middle, np.sort(values, axis=1), 0.0).sum(axis=1) / np.maximum(middle.sum(axis=1), 1))


def rows_repeat(height: NDArray[np.floating]) -> bool:
    """Whether the rows' medians go up and down with a period, as where a grating's lines run along the rows."""
    medians = row_medians(height)
    count = len(medians)
    x = np.linspace(-1, 1, count)
    rest = medians - np.polynomial.Polynomial.fit(x, medians, 1)(x)
    power = np.abs(np.fft.rfft(rest * taper(count))) ** 2
    if len(power) < 4 * _FEWEST_CYCLES:
        return False
    peak = _FEWEST_CYCLES + int(np.argmax(power[_FEWEST_CYCLES:]))
    around = np.r_[power[peak // 2 : peak - 2], power[peak + 3 : 2 * peak + 4]]
    return bool(around.size and power[peak] > _LINE * np.median(around))


def _scatter(differences: NDArray[np.floating], order: int) -> float:
    """Standard deviation of independent numbers whose differences of an order scatter so, by the median deviation."""
    steps = differences[np.isfinite(differences)]
    if not steps.size:
        return 0.0
    spread = 1.4826 * float(np.median(np.abs(steps - np.median(steps))))
    return spread / float(np.sqrt({1: 2, 2: 6, 3: 20}[order]))
