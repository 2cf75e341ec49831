"""What all lobes of a sheet have in common: the light's extent, the gratings' depth, and one period for all.

Found by least squares over many views.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from pipeline.optics.flash.periods import Orders, order_sum

Float64Array = NDArray[np.float64]

DEPTHS_UM = (0.02, 0.25)
"""Between which depths are sought: shallower gratings are hardly seen, deeper ones take back what they gave."""

_ROUNDS = 3
_FAINT = 0.03
"""Of the peak outside highlights: brightness of which errors no longer count in proportion."""
_OUTLIER = 0.1
_LARGEST = 10.0
"""By how much the light may be larger or smaller than where the fit starts."""


@dataclass(frozen=True, eq=False)
class Sample:
    """Some views of some pixels; arrays of shape (S,).

    Attributes
    ----------
    brightness, u, v, w, gain : ndarray
        Of each view, its half vector in the grating's frame, and what geometry makes of an order's share.
    light_u, light_v : ndarray
        Half vectors that a millimetre of the light's extent is, along the tangent and across it.
    rest : ndarray
        Variance of lobes, in half vectors, but for the light's extent.
    period_um : ndarray or None
        Of each view's pixel; None where one is sought for all.
    """

    brightness: Float64Array
    u: Float64Array
    v: Float64Array
    w: Float64Array
    gain: Float64Array
    light_u: Float64Array
    light_v: Float64Array
    rest: Float64Array
    period_um: Float64Array | None = None


@dataclass(frozen=True)
class Common:
    """What was found.

    Attributes
    ----------
    period_um : float or None
        Of all gratings, where it was sought.
    light_sigma_mm : float
        Standard deviation of the light's extent.
    orders : Orders
        With the depth.
    residual : float
        What is left, relative to the brightness or to a faint part of the peak: 1.48 times the median of its size,
        which is the root mean square where errors are normal.
    """

    period_um: float | None
    light_sigma_mm: float
    orders: Orders
    residual: float


def common_fit(sample: Sample, orders: Orders, *, period_um: float, light_sigma_mm: float) -> Common:
    """Fit the lobes of all views together, starting from a period and an extent of the light.

    Height and a constant for stray light are linear and solved for; views that differ by more than a tenth count less
    and less (soft L1).
    """
    peak = float(np.percentile(sample.brightness, 99))
    level = sample.brightness + peak
    depth = orders.depth_um or 0.1
    start = np.array([np.log(light_sigma_mm), np.log(depth), np.log(period_um)])
    free = 2 if sample.period_um is not None else 3
    low = np.array([start[0] - np.log(_LARGEST), np.log(DEPTHS_UM[0]), start[2] - 0.7])
    high = np.array([start[0] + np.log(_LARGEST), np.log(DEPTHS_UM[1]), start[2] + 0.7])

    def model(values: Float64Array, level: Float64Array) -> Float64Array:
        sigma = np.exp(values[0])
        variance = (sigma * sample.light_u) ** 2 + sample.rest, (sigma * sample.light_v) ** 2 + sample.rest
        deep = replace(orders, depth_um=float(np.exp(values[1])))
        period = float(np.exp(values[2])) if sample.period_um is None else sample.period_um
        shape = sample.gain * order_sum(sample.u, sample.v, variance, deep.shares(sample.w), period, deep)
        return _scaled(shape, sample.brightness, 1 / level)

    def residuals(values: Float64Array, level: Float64Array) -> Float64Array:
        return (model(values, level) - sample.brightness) / level

    for _ in range(_ROUNDS):
        fitted = least_squares(
            residuals,
            start[:free],
            args=(level,),
            bounds=(low[:free], high[:free]),
            loss="soft_l1",
            f_scale=_OUTLIER,
            max_nfev=40,
        )
        start[:free] = fitted.x
        level = model(fitted.x, level) + _FAINT * peak
    return Common(
        period_um=float(np.exp(start[2])) if free == 3 else None,
        light_sigma_mm=float(np.exp(start[0])),
        orders=replace(orders, depth_um=float(np.exp(start[1]))),
        residual=float(1.4826 * np.median(np.abs(residuals(start[:free], level)))),
    )


def _scaled(shape: Float64Array, brightness: Float64Array, weight: Float64Array) -> Float64Array:
    """Height times shape plus a constant, neither below 0, that is closest to the brightness."""
    square = weight**2
    total, mean, level = square.sum(), (square * shape).sum(), (square * brightness).sum()
    cross, norm = (square * shape * brightness).sum(), (square * shape**2).sum()
    height = (total * cross - mean * level) / max(total * norm - mean**2, 1e-300)
    constant = (level - height * mean) / total
    if constant < 0:
        height, constant = cross / max(norm, 1e-300), 0.0
    return max(height, 0.0) * shape + constant
