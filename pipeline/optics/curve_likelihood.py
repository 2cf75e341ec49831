"""How likely a response curve makes the points that were measured.

Each point may come from any place of the curve. How common each orientation is is unknown, and is found by expectation
maximisation: distances alone would prefer a curve that winds through the whole cloud.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.compiled import njit
from pipeline.optics.response_curve import FilmedGrating, StokesNoise, relative_stokes, response_curve

Float64Array = NDArray[np.float64]

_STEPS = 720
_FINEST = 0.1
_PLACES, _STRIDE, _ROUNDS = (200, 4000), 0.7, 60
_FAR = 40.0
_STRAY = 0.02
"""Density of points that mix two orientations, anywhere in the unit disc, relative to that of the others."""


def unlikelihood(stokes: Float64Array, scale: Float64Array, grating: FilmedGrating, noise: StokesNoise) -> float:
    """Negative logarithm of the points' likelihood, the shares of all orientations being those that fit best.

    The curve is sampled evenly in units of the noise: steps wider than it would favour curves that are slow where the
    points are, or whose samples hit the facets.

    Parameters
    ----------
    stokes : ndarray of shape (P, 2)
        Points ``(s1, s2)``.
    scale : ndarray of shape (P,)
        The noise of a point is this times that of a pixel of one electron.
    grating : FilmedGrating
        Whose curve it is.
    noise : StokesNoise
        Of the photographs.
    """
    curve = response_curve(grating, _STEPS)
    finest = float(np.quantile(scale, _FINEST))
    towards = np.linalg.solve(noise.covariance(curve.stokes), curve.slope[:, :, None])[:, :, 0]
    speed = np.sqrt((towards * curve.slope).sum(axis=1)) / finest
    length = np.concatenate([[0.0], np.cumsum(speed) * np.pi / _STEPS])
    count = int(np.clip(length[-1] / _STRIDE, *_PLACES))
    theta = np.interp(np.arange(count) * (length[-1] / count), length, np.linspace(0, np.pi, _STEPS + 1))
    places = np.stack(relative_stokes(theta, grating)[1:], axis=1)
    covariance = noise.covariance(places)
    height = 1 / (2 * np.pi * np.sqrt(np.linalg.det(covariance)))
    blunter = max(1.0, length[-1] / count / _STRIDE)
    near = _densities(stokes, (blunter * scale) ** 2, places, np.linalg.inv(covariance), height)
    return float(_unlikelihood(*near, count, _STRAY, _ROUNDS))


@njit(cache=True, error_model="numpy")
def _densities(points: Any, variance: Any, places: Any, inverse: Any, height: Any) -> Any:
    """Gaussian density of P points, each with its variance, around those places of a curve that are near to it.

    Gives where each point's entries begin, shape (P + 1,), and the place and the density of each entry.
    """
    first = np.empty(len(points) + 1, np.int64)
    near, density = np.empty(64 * len(points), np.int32), np.empty(64 * len(points), np.float32)
    step, least = 0.0, np.inf
    for t in range(len(places)):
        step = max(step, np.hypot(places[t, 0] - places[t - 1, 0], places[t, 1] - places[t - 1, 1]))
        middle = (inverse[t, 0, 0] + inverse[t, 1, 1]) / 2
        spread = np.hypot((inverse[t, 0, 0] - inverse[t, 1, 1]) / 2, inverse[t, 0, 1])
        least = min(least, middle - spread)
    entry = 0
    for p in range(len(points)):
        first[p] = entry
        if entry + len(places) > len(near):
            near = np.concatenate((near, np.empty(len(near) + len(places), np.int32)))
            density = np.concatenate((density, np.empty(len(density) + len(places), np.float32)))
        reach = np.sqrt(_FAR * variance[p] / least)
        t = 0
        while t < len(places):
            x, y = points[p, 0] - places[t, 0], points[p, 1] - places[t, 1]
            beyond = np.hypot(x, y) - reach
            if beyond > step:  # so are the next places
                t += int(beyond / step)
                continue
            square = inverse[t, 0, 0] * x * x + 2 * inverse[t, 0, 1] * x * y + inverse[t, 1, 1] * y * y
            square /= variance[p]
            if square < _FAR:
                near[entry] = t
                density[entry] = height[t] / variance[p] * np.exp(-0.5 * square)
                entry += 1
            t += 1
    first[len(points)] = entry
    return first, near[:entry], density[:entry]


@njit(cache=True, error_model="numpy", fastmath=True)
def _unlikelihood(first: Any, near: Any, density: Any, places: int, stray: float, rounds: int) -> float:
    """Negative logarithm of the likelihood of a mixture of places, after so many rounds for their shares."""
    share = np.full(places, np.float32(1 / places))
    votes = np.empty(places, np.float32)
    total = 0.0
    for r in range(rounds + 1):
        votes[:] = 0
        total = 0.0
        for p in range(len(first) - 1):
            whole = np.float32(stray)
            for entry in range(first[p], first[p + 1]):
                whole += density[entry] * share[near[entry]]
            total -= np.log(np.float64(whole))
            weight = np.float32(1) / whole
            for entry in range(first[p], first[p + 1]):
                votes[near[entry]] += density[entry] * weight
        if r < rounds:
            share *= votes
            share /= share.sum()
    return total
