"""What all lobes of a sheet have in common, by least squares over many views: the light's extent, orders' shares, and
the period where it is the same everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, nnls

from pipeline.optics.flash.periods import Orders, order_sum

Float64Array = NDArray[np.float64]

_ROUNDS = 3
_FAINT = 0.03
"""Of a first order's peak: brightness of which errors no longer count in proportion."""
_OUTLIER = 0.1


@dataclass(frozen=True, eq=False)
class Sample:
    """Some views of some pixels; arrays of shape (S,).

    Attributes
    ----------
    brightness, u, v, gain : ndarray
        Of each view, and what geometry makes of an order's share.
    light_mm : ndarray
        Distance of the light.
    rest : ndarray
        Variance of lobes, in half vectors, but for the light's extent.
    period_um : ndarray or None
        Of each view's pixel; None where one is sought for all.
    """

    brightness: Float64Array
    u: Float64Array
    v: Float64Array
    gain: Float64Array
    light_mm: Float64Array
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
        With the shares of the zeroth and second order.
    residual : float
        Root mean square of what is left, relative to the brightness or to a faint part of the peak.
    """

    period_um: float | None
    light_sigma_mm: float
    orders: Orders
    residual: float


def common_fit(sample: Sample, orders: Orders, *, period_um: float, light_sigma_mm: float) -> Common:
    """Fit the lobes of all views together, starting from a period and an extent of the light.

    Shares are linear and solved for, none below 0, beside a constant for stray light; views that differ by more than a
    tenth count less and less (soft L1).
    """
    weight = 1 / (sample.brightness + np.percentile(sample.brightness, 99))
    start = [np.log(max(light_sigma_mm, 0.3)), *([] if sample.period_um is not None else [np.log(period_um)])]

    def model(values: Float64Array) -> tuple[Float64Array, Float64Array]:
        variance = (np.exp(values[0]) / sample.light_mm) ** 2 + sample.rest
        period = sample.period_um if sample.period_um is not None else np.exp(values[1])
        columns = [
            sample.gain * order_sum(sample.u, sample.v, variance, np.asarray(period), part)
            for part in (orders, replace(orders, mirror=1.0), replace(orders, second=1.0))
        ]
        first = columns[0]
        design = np.stack([first, columns[1] - first, columns[2] - first, np.ones_like(first)], axis=1)
        scale = np.linalg.norm(design * weight[:, None], axis=0)
        scaled = design * (weight[:, None] / np.maximum(scale, 1e-300))
        gram, right = scaled.T @ scaled, scaled.T @ (weight * sample.brightness)
        root = np.linalg.cholesky(gram + 1e-9 * np.eye(4))
        shares = nnls(root.T, np.linalg.solve(root, right))[0] / np.maximum(scale, 1e-300)
        return design @ shares, shares

    for _ in range(_ROUNDS):
        fitted = least_squares(
            lambda values: weight * (model(values)[0] - sample.brightness),
            start,
            loss="soft_l1",
            f_scale=_OUTLIER,
            x_scale=0.1,
            max_nfev=40,
        )
        start = list(fitted.x)
        brightness, shares = model(fitted.x)
        first = shares[0] * np.max(sample.gain * order_sum(sample.u, sample.v, sample.rest + (np.exp(start[0]) / sample.light_mm) ** 2, np.asarray(sample.period_um if sample.period_um is not None else np.exp(start[1])), orders))
        weight = 1 / (brightness + _FAINT * max(first, 1e-30))
    left = weight * (brightness - sample.brightness)
    base = max(shares[0], 1e-30)
    return Common(
        period_um=None if sample.period_um is not None else float(np.exp(start[1])),
        light_sigma_mm=float(np.exp(start[0])),
        orders=replace(orders, mirror=float(shares[1] / base), second=float(shares[2] / base)),
        residual=float(np.sqrt(np.mean(left**2))),
    )
