"""Which gratings a sheet of randomly strewn ones holds, from where around its highlight it is bright.

Gratings of tangent theta and period a are lit around the half vectors ``+-(lambda / a) (cos theta, sin theta)``. Where
they are strewn evenly, brightness over what geometry makes of it is the sum of their lobes: each of the same volume in
the half vectors' plane, so that long periods, which share a small ring, are brighter there than short ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

Float64Array = NDArray[np.float64]

_SECOND = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3)
"""Shares of a second order that are tried, relative to a first one's."""
_SIEVE_BINS = 1.0
"""Standard deviation over which distributions are smooth."""


@dataclass(frozen=True, eq=False)
class Bins:
    """Equal bins of orientation over half a turn, and of period.

    Attributes
    ----------
    orientations, periods : int
        How many.
    shortest_um, longest_um : float
        Ends of the periods.
    """

    orientations: int
    periods: int
    shortest_um: float
    longest_um: float

    @property
    def orientation_rad(self) -> Float64Array:
        """Middles."""
        return (np.arange(self.orientations) + 0.5) * np.pi / self.orientations

    @property
    def period_um(self) -> Float64Array:
        """Middles."""
        step = (self.longest_um - self.shortest_um) / self.periods
        return np.asarray(self.shortest_um + (np.arange(self.periods) + 0.5) * step, np.float64)

    def means(
        self, orientation_rad: Float64Array, period_um: Float64Array, values: Float64Array
    ) -> tuple[Float64Array, NDArray[np.int64]]:
        """Mean of the values in each bin, and how many they are, both of shape (orientations, periods)."""
        row = np.floor(np.mod(orientation_rad, np.pi) / np.pi * self.orientations).astype(np.int64)
        step = (self.longest_um - self.shortest_um) / self.periods
        with np.errstate(invalid="ignore"):
            column = np.floor((period_um - self.shortest_um) / step)
        inside = (column >= 0) & (column < self.periods) & np.isfinite(values)
        index = np.minimum(row[inside], self.orientations - 1) * self.periods + column[inside].astype(np.int64)
        size = self.orientations * self.periods
        count = np.bincount(index, minlength=size)
        total = np.bincount(index, values[inside], minlength=size)
        shape = (self.orientations, self.periods)
        mean = np.asarray(total, np.float64) / np.maximum(count, 1)
        return mean.reshape(shape), count.reshape(shape)


def sharpened(
    brightness: Float64Array,
    seen: NDArray[np.bool_],
    variance: Float64Array,
    wavelength_um: float,
    bins: Bins,
    steps: int,
) -> tuple[Float64Array, float]:
    """Share of gratings in each bin whose lobes, each as wide as ``variance`` says, add up to the brightness.

    Richardson and Lucy's iteration, which keeps shares positive, over distributions that are smooth over a bin or two
    (Snyder and Miller's sieve): single shapes are not to be told apart. The flank of the zeroth order and stray light
    are two more components. Second orders are some fixed part of first ones, the one that explains most.

    Parameters
    ----------
    brightness, variance : ndarray of shape (T, P)
        Mean brightness over geometry where each bin's gratings are lit, and variance of lobes there.
    seen : ndarray of shape (T, P), bool
        Bins in which something was measured.

    Returns
    -------
    shares : ndarray of shape (T, P)
        Sum to 1.
    second : float
        Share of a second order, relative to that of a first one.
    """
    at = seen.ravel()
    theta, a = np.meshgrid(bins.orientation_rad, bins.period_um, indexing="ij")
    u = wavelength_um / a
    side = (u * np.pi / bins.orientations) ** 2 + (u / a * (a[0, 1] - a[0, 0])) ** 2
    place = np.stack([u * np.cos(theta), u * np.sin(theta)]).reshape(2, -1)
    measured, spread = brightness.ravel()[at], (variance + side / 24).ravel()[at, None]
    first, second = (_smooth(_lobes(place[:, at], order * place, spread), bins) for order in (1, 2))
    others = np.column_stack([np.exp(-(place[:, at] ** 2).sum(axis=0) / (2 * spread[:, 0])), np.ones(at.sum())])
    best, shares, ratio = np.inf, np.zeros(at.size), 0.0
    for part in _SECOND:
        response = np.hstack([first + part * second, others])
        weights, misfit = _richardson_lucy(measured, response, steps)
        if misfit < best:
            best, shares, ratio = misfit, weights[: at.size], part
    smooth = _smooth(shares[None], bins)[0].reshape(theta.shape)
    return smooth / max(float(smooth.sum()), 1e-300), ratio


def _lobes(at: Float64Array, centre: Float64Array, spread: Float64Array) -> Float64Array:
    """Brightness at places (2, N) of gratings whose orders lie at both signs of ``centre`` (2, B), shape (N, B)."""
    square = [sum((at[k][:, None] - sign * centre[k]) ** 2 for k in range(2)) for sign in (1, -1)]
    return np.asarray(sum(np.exp(-one / (2 * spread)) for one in square) / (2 * np.pi * spread))


def _smooth(values: Float64Array, bins: Bins) -> Float64Array:
    """Averaged over neighbouring bins of the last axis, which holds all of them."""
    grid = values.reshape(-1, bins.orientations, bins.periods)
    turned = gaussian_filter1d(grid, _SIEVE_BINS, axis=1, mode="wrap")
    return gaussian_filter1d(turned, _SIEVE_BINS, axis=2, mode="constant").reshape(values.shape)


def _richardson_lucy(measured: Float64Array, response: Float64Array, steps: int) -> tuple[Float64Array, float]:
    """Positive weights of components that add up to what was measured, and Poisson's misfit."""
    total = np.maximum(response.sum(axis=0), 1e-9 * response.sum(axis=0).max())
    weights = np.full(response.shape[1], measured.sum() / total.sum())
    faint = 1e-9 * max(float(measured.max()), 1e-300)
    for _ in range(steps):
        weights *= response.T @ (measured / np.maximum(response @ weights, faint)) / total
    model = np.maximum(response @ weights, faint)
    return weights, float(np.sum(model - measured * np.log(model)))
