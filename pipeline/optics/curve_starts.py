"""Where to start the search for a response curve: the local minima of a coarse cost on a grid of all curves."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from pipeline.optics.compiled import njit
from pipeline.optics.response_curve import relative_stokes

Float64Array = NDArray[np.float64]

_RATIO_LOGS = np.log(1.25) * np.arange(-3, 4) / 3
_PHASES_DEG = np.arange(3.75, 180.0, 7.5)
_RETARDATIONS_DEG = np.array([0.0, 2, 4, 6, 8, 11, 14, 18, 22, 26, 30, 37, 45, 55, 66, 78])
_AXES_DEG = np.arange(0.0, 180.0, 15.0)
_POINTS, _POINTS_WITH_AXIS, _STEPS = 250, 120, 120


def starts(stokes: Float64Array, noise: float, given: Float64Array, count: int) -> list[Float64Array]:
    """The ``count`` best local minima of the grid, as logarithm of the ratio, phase, retardation and axis.

    Parameters
    ----------
    stokes : ndarray of shape (P, 2)
        Points.
    noise : float
        Of a typical point.
    given : ndarray of shape (4,)
        What need not be searched, NaN elsewhere.
    count : int
        Half of them by a blunt cost, which leads to wide valleys, and half by a sharp one, which leads to narrow ones,
        as of curves with cusps.
    """
    axes: list[Any] = [_RATIO_LOGS, *(np.deg2rad(degrees) for degrees in (_PHASES_DEG, _RETARDATIONS_DEG, _AXES_DEG))]
    known = ~np.isnan(given)
    if known[3]:  # with a known axis the film may delay either of its directions
        axes[2] = np.concatenate([-axes[2][:0:-1], axes[2]])
    for i in np.flatnonzero(known):
        axes[i] = given[i : i + 1]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    gratings = np.concatenate([np.exp(grid[..., :1]), grid[..., 1:]], axis=-1).reshape(-1, 4)
    few = stokes[:: max(1, len(stokes) // (_POINTS if known[3] else _POINTS_WITH_AXIS))]
    spread = float(np.sqrt(few.var(axis=0).sum()))
    softness = np.array([max(3 * noise, 0.05 * spread), max(noise, 0.01 * spread)])
    theta = np.arange(_STEPS) * np.pi / _STEPS
    chosen: list[Float64Array] = []
    costs = _costs(_curves(theta, gratings), few, 1 / softness**2)
    for cost in costs.T.reshape(2, *grid.shape[:-1]):
        # Only the axis comes round to where it began.
        lowest = cost == minimum_filter(cost, size=3, mode=("nearest", "nearest", "nearest", "wrap"))
        best = np.argsort(cost[lowest])[: count // 2]
        chosen += list(grid[lowest][best])
    return list(np.unique(np.array(chosen), axis=0))


def _curves(theta: Float64Array, gratings: Float64Array) -> NDArray[np.float32]:
    """Points ``(s1, s2)`` of G curves at T orientations, shape (G, T, 2)."""
    curves = np.empty((len(gratings), len(theta), 2), np.float32)
    for part in range(0, len(gratings), 1000):
        _, s1, s2 = relative_stokes(theta, gratings[part : part + 1000, None, :])
        curves[part : part + 1000] = np.stack([s1, s2], axis=-1)
    return curves


@njit(cache=True, error_model="numpy", fastmath=True)
def _costs(curves: Any, points: Any, sharpness: Any) -> Any:
    """Robust costs of the points' squared distances from every curve, shape (G, 2)."""
    costs = np.empty((len(curves), 2))
    for g in range(len(curves)):
        blunt, sharp = 0.0, 0.0
        for p in range(len(points)):
            x, y = np.float32(points[p, 0]), np.float32(points[p, 1])
            least = np.float32(1e9)
            for t in range(curves.shape[1]):
                u, v = curves[g, t, 0] - x, curves[g, t, 1] - y
                least = min(least, u * u + v * v)
            blunt += np.log1p(least * sharpness[0])
            sharp += np.log1p(least * sharpness[1])
        costs[g, 0], costs[g, 1] = blunt, sharp
    return costs
