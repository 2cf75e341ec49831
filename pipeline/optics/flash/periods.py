"""Which period a grating has, from how brightly its repeats diffract light of one wavelength."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.compiled import njit
from pipeline.optics.gratings import order_efficiency

Float64Array = NDArray[np.float64]

ACROSS = 4.0
"""Standard deviations from the tangent beyond which every view is dark, whatever the period."""
_MODEL_ERROR = 0.1
"""Of a lobe's height: what its shape may be wrong by."""
_FAR = 16.0
_NEAR = 1.2
"""Times the period by all views, up to which half of them, which may not tell orders apart, are looked at."""
_CONVINCING = 0.7
"""Squared correlation below which views show no order: what the paper scatters, or noise."""


@dataclass(frozen=True)
class Orders:
    """Light of one wavelength on sinusoidal gratings.

    Attributes
    ----------
    wavelength_um : float
        Of the light.
    band_um : float
        Standard deviation of the filter's band.
    depth_um : float or None
        Peak-to-valley depth of the gratings, which says what share of the light each order takes; None where only the
        first is looked at.
    """

    wavelength_um: float
    band_um: float = 0.0
    depth_um: float | None = None

    def shares(self, w: Float64Array) -> Float64Array:
        """Of orders 0, 1 and 2, shape (3, ...), where the half vector's part along the normal is ``w``."""
        order = np.arange(3).reshape(3, *[1] * np.ndim(w))
        if self.depth_um is None:
            return np.broadcast_to(order == 1, (3, *np.shape(w))).astype(np.float64)
        return order_efficiency(order, 2 * np.pi / self.wavelength_um * w * self.depth_um)


def order_sum(
    u: Float64Array,
    v: Float64Array,
    variance: tuple[Float64Array, Float64Array],
    shares: Float64Array,
    period_um: Float64Array | float,
    orders: Orders,
) -> Float64Array:
    """Brightness of all orders up to the second at half vectors (u, v).

    Each order is a Gaussian, of ``variance`` along the tangent and across it, and wider along it by the filter's band,
    which order m spreads over ``m band / a``; its integral stays.
    """
    total = np.zeros(np.shape(u))
    for order in (-2, -1, 0, 1, 2):
        along = variance[0] + (order * orders.band_um / period_um) ** 2
        away = u - order * orders.wavelength_um / period_um
        lobe = np.exp(-(away**2) / (2 * along) - v**2 / (2 * variance[1])) / np.sqrt(along * variance[1])
        total += shares[abs(order)] * lobe
    return total


@njit(nogil=True, cache=True, error_model="numpy")
def best_periods(
    brightness: Any,
    u: Any,
    v: Any,
    variance: Any,
    shares: Any,
    halves: Any,
    periods: Any,
    wavelength: float,
    band: float,
    found: Any,
) -> None:
    """Fill ``found`` (3, 2, M, N): the period that fits best and its standard error, of all views and of either half.

    The views of a pixel are compared with :func:`order_sum` for each of ``periods`` (K,), equally spaced in their
    logarithm; the height is free, and the best fit is refined by a parabola.

    Parameters
    ----------
    brightness, u, v : ndarray of shape (O, M, N)
        Views of a tile; NaN where there is none.
    variance : ndarray of shape (2, O, M, N)
        Of lobes, along the tangent and across it.
    shares : ndarray of shape (3, O, M, N)
        Brightness of orders 0, 1 and 2 for a light without extent, where ``v`` is within ``ACROSS`` of its deviations.
    halves : ndarray of shape (O,), int64
        0 or 1: which half of the views each belongs to.
    """
    views, rows, columns = brightness.shape
    steps = periods.size
    spacing = np.log(periods[1] / periods[0])
    scores = np.empty((3, steps))
    use, peak = np.empty(views, np.int64), np.empty(views)
    counts, square, fourth = np.empty(3, np.int64), np.empty(3), np.empty(3)
    cross, norm = np.empty(3), np.empty(3)
    for row in range(rows):
        for column in range(columns):
            found[:, :, row, column] = np.nan
            counts[:] = 0
            square[:] = 0
            fourth[:] = 0
            for i in range(views):
                b, across = brightness[i, row, column], variance[1, i, row, column]
                if np.isfinite(b) and v[i, row, column] ** 2 < ACROSS**2 * across:
                    use[counts[0]] = i
                    peak[counts[0]] = np.exp(-(v[i, row, column] ** 2) / (2 * across)) / np.sqrt(across)
                    for part in (0, 1 + halves[i]):
                        counts[part] += 1
                        square[part] += b * b
                        fourth[part] += b**4
            for k in range(steps):
                first, wide = wavelength / periods[k], band / periods[k]
                cross[:] = 0
                norm[:] = 0
                for n in range(counts[0]):
                    i = use[n]
                    along, lobe = abs(u[i, row, column]), 0.0
                    for order in range(-1, 3):
                        wider = variance[0, i, row, column] + (order * wide) ** 2
                        away = (along - order * first) ** 2 / (2 * wider)
                        share = shares[abs(order), i, row, column]
                        if share > 0 and away < _FAR:
                            lobe += share * np.exp(-away) / np.sqrt(wider)
                    lobe *= peak[n]
                    part = 1 + halves[i]
                    cross[part] += brightness[i, row, column] * lobe
                    norm[part] += lobe * lobe
                cross[0], norm[0] = cross[1] + cross[2], norm[1] + norm[2]
                for part in range(3):
                    scores[part, k] = cross[part] ** 2 / (norm[part] * square[part]) if norm[part] > 0 else 0.0
            begin, end = 0, steps
            for part in range(3):
                if counts[part] < 2 or square[part] == 0:
                    if part == 0:
                        break
                    continue
                best = begin + int(np.argmax(scores[part, begin:end]))
                if best == begin or best == end - 1 or scores[part, best] < _CONVINCING:
                    if part == 0:
                        break
                    continue
                left, middle, right = scores[part, best - 1], scores[part, best], scores[part, best + 1]
                bend = 2 * middle - left - right
                if bend <= 0:
                    continue
                value = periods[best] * np.exp(0.5 * (right - left) / bend * spacing)
                # Errors go with brightness, so that no more views count than are bright.
                noise = (1 - middle + _MODEL_ERROR**2) * fourth[part] / square[part] ** 2
                # Other periods that fit nearly as well, as where a second order may be a first one, count too.
                likely = away_square = 0.0
                for k in range(begin, end):
                    weight = np.exp((scores[part, k] - middle) / (2 * noise))
                    likely += weight
                    away_square += weight * (k - best) ** 2
                found[part, 0, row, column] = value
                found[part, 1, row, column] = value * spacing * np.sqrt(max(2 * noise / bend, away_square / likely))
                if part == 0:
                    reach = int(np.log(_NEAR) / spacing)
                    begin = max(best - reach, 0)
                    end = min(best + reach + 1, steps)
