"""Axial angles: directions of lines, equal modulo pi."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64Array = NDArray[np.float64]


def wrap_axial(angle_rad: ArrayLike) -> Float64Array:
    """Bring axial angles into [0, pi)."""
    wrapped = np.mod(np.asarray(angle_rad, np.float64), np.pi)
    return np.where(wrapped >= np.pi, 0.0, wrapped)


def axial_difference(left_rad: ArrayLike, right_rad: ArrayLike) -> Float64Array:
    """Signed smallest turn from ``right_rad`` to ``left_rad``, in [-pi/2, pi/2)."""
    difference = np.asarray(left_rad, np.float64) - np.asarray(right_rad, np.float64)
    return wrap_axial(difference + np.pi / 2) - np.pi / 2


def axial_mean(angle_rad: ArrayLike, weight: ArrayLike | None = None) -> float:
    """Mean direction in [0, pi): half the angle of the mean of ``exp(2 i angle)``; NaN are left out.

    References
    ----------
    Mardia and Jupp, Directional Statistics (2000), section 2.2 and 9.1.
    """
    angle, weights = _finite(angle_rad, weight)
    if not angle.size:
        return float("nan")
    return float(wrap_axial(np.angle(np.sum(weights * np.exp(2j * angle))) / 2))


def axial_median(angle_rad: ArrayLike, *, iterations: int = 50) -> float:
    """Median direction in [0, pi): the angle whose mean absolute axial difference to the others is smallest.

    Found by taking ordinary medians of the differences to the current estimate, from several starts, since a
    circular median can have more than one local minimum (Mardia and Jupp, section 2.2.2). NaN are left out.
    """
    angle, _ = _finite(angle_rad, None)
    if not angle.size:
        return float("nan")
    mean = axial_mean(angle)
    candidates = [_descend(angle, mean + start, iterations) for start in np.arange(6) * np.pi / 6]
    costs = [float(np.mean(np.abs(axial_difference(angle, candidate)))) for candidate in candidates]
    return float(wrap_axial(candidates[int(np.argmin(costs))]))


def _descend(angle: Float64Array, start: float, iterations: int) -> float:
    centre = start
    for _ in range(iterations):
        step = float(np.median(axial_difference(angle, centre)))
        centre += step
        if abs(step) < 1e-12:
            break
    return centre


def _finite(angle_rad: ArrayLike, weight: ArrayLike | None) -> tuple[Float64Array, Float64Array]:
    angle = np.asarray(angle_rad, np.float64)
    weights = np.ones_like(angle) if weight is None else np.broadcast_to(np.asarray(weight, np.float64), angle.shape)
    keep = np.isfinite(angle) & np.isfinite(weights)
    return angle[keep], weights[keep]
