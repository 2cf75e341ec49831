"""Spectral response by Taylor terms, looked up with a Gaussian window: full lambda sampling (FLSS).

Algorithm 2.3 of the source, as a plain loop over pixels, wavelengths, terms and neighbouring spectral lines. Its
variant that knows the surface's dominant periods (NMM) leaves out the wavelengths that no order sends to the viewer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

from pipeline.optics.compiled import njit
from pipeline.optics.diffraction.patch import (
    Components,
    Float32Array,
    Float64Array,
    Patch,
    RowKernel,
    Window,
    quotient_range,
    spectral_lines,
    spread_out,
    window_over,
)

Complex128Array = NDArray[np.complex128]


@dataclass(frozen=True)
class TaylorResponse:
    """Transforms of ``(i h)^n``, as many as there are terms.

    Attributes
    ----------
    table : ndarray of shape (N, Y, X), complex128
        Spectral lines of ``(2 pi i h)^n / n!``.
    window : Window
        Over those lines.
    orders_per_um : ndarray of shape (O, 2)
        Frequencies of the orders that light is looked for at, and nowhere else; none if all wavelengths are sampled.
    """

    table: Complex128Array
    window: Window
    orders_per_um: Float64Array

    def rows(
        self,
        uvw: Components,
        wavelength_um: Float64Array,
        weights: Float64Array,
        out: Float32Array,
    ) -> RowKernel:
        """As :class:`SpectralResponse` says."""
        axes, origin, parts = self.window.axes, self.window.origin, spread_out(uvw, out.shape[1:])
        share, table, orders = weights.T.astype(np.float32), self.table, self.orders_per_um
        return lambda start, stop: _taylor_rows(
            table, origin, axes, orders, *parts, wavelength_um, share, start, stop, out
        )


def taylor_response(
    patch: Patch,
    uvw: Components,
    wavelength_um: Float64Array,
    *,
    coherence_um: float,
    tolerance: float = 1e-4,
    terms: int | None = None,
    orders_per_um: Float64Array | None = None,
    workers: int = 1,
) -> TaylorResponse:
    """Transform the powers of the heights, from the lowest on, as the source does.

    Parameters
    ----------
    patch : Patch
        One period of the surface.
    uvw, wavelength_um, coherence_um, tolerance, workers
        As of :func:`chebyshev_response`.
    terms : int, optional
        Number of Taylor terms; the least whose bound holds the tolerance by default.
    orders_per_um : ndarray of shape (O, 2), optional
        Frequencies along x and y where the surface sends light; what lies out of the window's reach of all of them is
        taken to be dark (NMM).
    """
    count = taylor_terms(phase_range(patch, uvw[2], wavelength_um), tolerance) if terms is None else terms
    window = window_over(patch, uvw, wavelength_um, coherence_um=coherence_um, tolerance=tolerance)
    table = taylor_table(patch.height_um - patch.height_um.min(), count, window.across, window.along, workers)
    orders = np.empty((0, 2)) if orders_per_um is None else np.asarray(orders_per_um, np.float64)
    return TaylorResponse(table, window, orders)


def taylor_terms(phase_rad: float, tolerance: float) -> int:
    """Least number of terms of ``exp(i phase)`` whose remainder ``phase^n / n!`` is within the tolerance.

    The source's bound has a factor ``exp(phase)`` more, which holds for real exponents and is not needed for
    imaginary ones.
    """
    n = np.arange(1, int(4 * phase_rad) + 80)
    left = n * np.log(max(phase_rad, 1e-12)) - gammaln(n + 1)
    return int(n[np.flatnonzero(left > np.log(tolerance))[-1] + 1]) if (left > np.log(tolerance)).any() else 1


def taylor_error(phase_rad: float, terms: int) -> float:
    """Bound of the error of so many terms: the remainder, and the rounding of terms that are large and cancel."""
    remainder = terms * np.log(max(phase_rad, 1e-12)) - gammaln(terms + 1)
    return float(np.exp(min(remainder, 300.0)) + np.finfo(np.float64).eps * np.exp(min(phase_rad, 300.0)))


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz", "reassoc", "arcp"})
def _taylor_rows(  # type: ignore[no-untyped-def]
    table, origin, axes, orders, u, v, w, wavelength, share, start, stop, out
):
    channels, _, columns = out.shape
    x_spacing, sigma, radius, x_count = axes[0, 0], axes[0, 1], axes[0, 2], int(axes[0, 3])
    y_spacing, y_count = axes[1, 0], int(axes[1, 3])
    window = np.empty((y_count, x_count))
    for row in range(start, stop):
        for j in range(columns):
            for channel in range(channels):
                out[channel, row, j] = 0
            if not np.isfinite(w[row, j]):
                continue
            for i in range(len(wavelength)):
                fx, fy = u[row, j] / wavelength[i], v[row, j] / wavelength[i]
                near = len(orders) == 0
                for o in range(len(orders)):
                    if abs(fx - orders[o, 0]) <= radius and abs(fy - orders[o, 1]) <= radius:
                        near = True
                        break
                if not near:
                    continue
                x0, y0 = int(np.ceil((fx - radius) / x_spacing)), int(np.ceil((fy - radius) / y_spacing))
                for s in range(y_count):
                    for t in range(x_count):
                        across, along = (x0 + t) * x_spacing - fx, (y0 + s) * y_spacing - fy
                        window[s, t] = np.exp(-0.5 * (across * across + along * along) / (sigma * sigma))
                power = taylor_power(table, y0 - origin[1], x0 - origin[0], window, w[row, j] / wavelength[i])
                for channel in range(channels):
                    out[channel, row, j] += share[channel, i] * power


@njit(inline="always", error_model="numpy")
def taylor_power(table, y0, x0, window, turns):  # type: ignore[no-untyped-def]
    """``|sum_n turns^n sum_st window_st table_n,y0+s,x0+t|^2``: terms of all lines within a window, added up."""
    height, width = window.shape
    scale, amplitude = 1.0, 0j
    for n in range(len(table)):
        looked_up = 0j
        for s in range(height):
            for t in range(width):
                looked_up += window[s, t] * table[n, y0 + s, x0 + t]
        amplitude += scale * looked_up
        scale *= turns
    return np.float32(amplitude.real * amplitude.real + amplitude.imag * amplitude.imag)


def taylor_table(
    height_um: Float64Array, terms: int, x: tuple[int, int], y: tuple[int, int], workers: int
) -> Complex128Array:
    """Spectral lines of ``(2 pi i h)^n / n!``, shape (N, Y, X)."""
    table = np.empty((terms, y[1] - y[0], x[1] - x[0]), np.complex128)
    power = np.ones(height_um.shape, np.complex128)
    for n in range(terms):
        table[n] = spectral_lines(power, x, y, workers)
        power *= 2j * np.pi * height_um / (n + 1)
    return table


def phase_range(patch: Patch, w: Float64Array, wavelength_um: Float64Array) -> float:
    """Greatest phase that the relief makes, in radians."""
    low, high = quotient_range(w, wavelength_um)
    return 2 * np.pi * max(abs(low), abs(high)) * patch.relief_um
