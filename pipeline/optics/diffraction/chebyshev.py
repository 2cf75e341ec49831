"""Spectral response by Chebyshev polynomials in ``w / lambda``: the fast evaluator.

What light sees of a height field depends on direction and wavelength through ``q = w / lambda`` only, as ``exp(2 pi i q
h)``, and that is smooth over the range of ``q`` that occurs: a dozen polynomials hold it to 1e-4. Where directions form
a grid whose columns share ``u`` and whose rows share ``v``, as those of a disc seen from above, the Gaussian window
factors, and each spectral line is spread first along x, then along y.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev as polynomials
from scipy.special import jv

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


@dataclass(frozen=True)
class ChebyshevResponse:
    """Prepared for a range of directions and wavelengths.

    Attributes
    ----------
    table : ndarray of shape (Y, N, 2, X), float32
        Real and imaginary part of the N Chebyshev coefficients of every spectral line that can be reached.
    window : Window
        Over those lines.
    range_per_um : tuple of float
        Least and greatest ``w / lambda`` that the polynomials hold for.
    tolerance : float
        Error of the amplitude, relative to a mirror's.
    """

    table: Float32Array
    window: Window
    range_per_um: tuple[float, float]
    tolerance: float
    relief_um: float

    def rows(
        self,
        uvw: Components,
        wavelength_um: Float64Array,
        weights: Float64Array,
        out: Float32Array,
    ) -> RowKernel:
        """As :class:`SpectralResponse` says; a grid of directions is noticed."""
        u, v = _grid_lines(uvw[0], axis=0), _grid_lines(uvw[1], axis=1)
        share = weights.T.astype(np.float32)
        if u is None or v is None:
            return self._scattered(uvw, wavelength_um, share, out)
        return self._grid(u, v, uvw[2], wavelength_um, share, out)

    def _grid(
        self,
        u: Float64Array,
        v: Float64Array,
        w: Float64Array,
        wavelength_um: Float64Array,
        share: Float32Array,
        out: Float32Array,
    ) -> RowKernel:
        low, high = float(np.nanmin(w)), float(np.nanmax(w))
        count = degree_for(np.pi * (high - low) / wavelength_um.min() * self.relief_um / 2, self.tolerance)
        nodes = polynomials.chebpts1(count) if count > 1 else np.zeros(1)
        at = (low + high) / 2 + (high - low) / 2 * nodes
        scaled = np.clip((w - (low + high) / 2) / max((high - low) / 2, 1e-12), -1, 1)
        # Through the nodes of this grid's own w, fewer of which are needed than over all wavelengths.
        through = np.linalg.inv(polynomials.chebvander(nodes, count - 1))
        basis = np.moveaxis(polynomials.chebvander(np.nan_to_num(scaled), count - 1) @ through, -1, 0)
        basis = np.ascontiguousarray(np.where(np.isnan(w), 0.0, basis), np.float32)
        combine = np.ascontiguousarray(self._polynomials(at / wavelength_um[:, None]), np.float32)
        fx, fy = u / wavelength_um[:, None], v / wavelength_um[:, None]
        x, y, origin = self.window.x, self.window.y, self.window.origin.astype(np.int32)
        first, window = (x.first(fx) - origin[0], y.first(fy) - origin[1]), (x.weights(fx), y.weights(fy))
        table = self.table
        return lambda start, stop: _grid_rows(table, combine, first, window, basis, share, start, stop, out)

    def _scattered(
        self,
        uvw: Components,
        wavelength_um: Float64Array,
        share: Float32Array,
        out: Float32Array,
    ) -> RowKernel:
        low, high = self.range_per_um
        table = np.ascontiguousarray(np.transpose(self.table, (0, 3, 1, 2)))
        scale = np.array([(low + high) / 2, max((high - low) / 2, 1e-12)])
        axes, origin, parts = self.window.axes, self.window.origin, spread_out(uvw, out.shape[1:])
        return lambda start, stop: _scattered_rows(
            table, origin, axes, scale, *parts, wavelength_um, share, start, stop, out
        )

    def _polynomials(self, per_um: Float64Array) -> Float64Array:
        low, high = self.range_per_um
        scaled = (per_um - (low + high) / 2) / max((high - low) / 2, 1e-12)
        return np.asarray(polynomials.chebvander(scaled, self.table.shape[1] - 1))


def chebyshev_response(
    patch: Patch,
    uvw: Components,
    wavelength_um: Float64Array,
    *,
    coherence_um: float,
    tolerance: float = 1e-4,
    degree: int | None = None,
    workers: int = 1,
) -> ChebyshevResponse:
    """Transform the patch for as many polynomials as the directions and wavelengths need.

    Parameters
    ----------
    patch : Patch
        One period of the surface.
    uvw : tuple of ndarray
        All directions that will be asked for; NaN where there is none.
    wavelength_um : ndarray of shape (L,)
        All wavelengths.
    coherence_um : float
        Four standard deviations of the coherence window.
    tolerance : float
        Error of the amplitude, relative to a mirror's, that polynomials and window each may make.
    degree : int, optional
        Number of polynomials; the least that holds the tolerance by default.
    workers : int
        Threads.
    """
    low, high = quotient_range(uvw[2], wavelength_um)
    count = degree_for(np.pi * (high - low) * patch.relief_um / 2, tolerance) if degree is None else degree
    window = window_over(patch, uvw, wavelength_um, coherence_um=coherence_um, tolerance=tolerance)
    nodes = polynomials.chebpts1(count) if count > 1 else np.zeros(1)
    to_coefficients = np.linalg.inv(polynomials.chebvander(nodes, count - 1))
    turns = (2 * np.pi * patch.centred()).astype(np.float32)
    field = np.empty(turns.shape, np.complex64)
    values = np.empty((count, *(stop - start for start, stop in (window.along, window.across))), np.complex64)
    for value, q in zip(values, (low + high) / 2 + (high - low) / 2 * nodes, strict=True):
        phase = np.float32(q) * turns
        np.cos(phase, out=field.real)
        np.sin(phase, out=field.imag)
        value[:] = spectral_lines(field, window.across, window.along, workers)
    found = np.tensordot(to_coefficients.astype(np.float32), values, 1)
    table = np.ascontiguousarray(np.stack([found.real, found.imag], axis=1).transpose(2, 0, 1, 3), np.float32)
    return ChebyshevResponse(table, window, (low, high), tolerance, patch.relief_um)


def degree_for(phase_rad: float, tolerance: float) -> int:
    """How many Chebyshev polynomials hold ``exp(i phase t)`` for ``-1 <= t <= 1`` to ``tolerance``."""
    most = int(phase_rad + 20 + 10 * np.log10(1 / tolerance) / 3 + phase_rad ** (1 / 3) * 10)
    return int(np.argmax(chebyshev_errors(phase_rad, most) < tolerance)) + 1


def chebyshev_errors(phase_rad: float, most: int) -> Float64Array:
    """Bound of the error of 1 to ``most`` polynomials.

    Interpolation at Chebyshev points errs by at most twice what is left of the series ``J_0 + 2 sum i^n J_n T_n``.
    """
    further = most + int(phase_rad) + 40
    return 4 * np.cumsum(np.abs(jv(np.arange(1, further + 1), phase_rad))[::-1])[::-1][:most]


def _grid_lines(part: Float64Array, axis: int) -> Float64Array | None:
    """What all rows (axis 0) or columns (axis 1) share, or None."""
    low, high = np.nanmin(part, axis=axis), np.nanmax(part, axis=axis)
    return low if np.isfinite(low).all() and np.allclose(low, high, rtol=0, atol=1e-12) else None


@njit(nogil=True, cache=True, error_model="numpy", fastmath=True)
def _grid_rows(  # type: ignore[no-untyped-def]
    table, combine, first, window, basis, share, start, stop, out
):
    (x_first, y_first), (x_window, y_window) = first, window
    channels, _, columns = out.shape
    _, terms, _, width = table.shape
    count = combine.shape[1]
    x_count, y_count = x_window.shape[1], y_window.shape[1]
    out[:, start:stop] = 0
    tallest = 0
    for i in range(len(combine)):
        tallest = max(tallest, y_first[i, start:stop].max() - y_first[i, start:stop].min() + y_count)
    spread = np.empty((tallest, 2 * count, columns), np.float32)
    parts = 2 * count
    mixed, wide = np.empty((count, 2 * width), np.float32), np.empty((width, parts), np.float32)
    total = np.empty(parts, np.float32)
    real, imaginary = np.empty(columns, np.float32), np.empty(columns, np.float32)
    both = np.empty((2 * count, columns), np.float32)
    for i in range(len(combine)):
        lowest = y_first[i, start:stop].min()
        highest = y_first[i, start:stop].max() + y_count
        left, right = x_first[i].min(), x_first[i].max() + x_count
        for y in range(lowest, highest):
            np.dot(combine[i], table[y].reshape(terms, 2 * width), mixed)
            for m in range(count):
                for x in range(left, right):
                    wide[x, 2 * m] = mixed[m, x]
                    wide[x, 2 * m + 1] = mixed[m, width + x]
            here, begin = spread[y - lowest], x_first[i]
            for j in range(columns):
                total[:] = 0
                for t in range(x_count):
                    factor, source = x_window[i, t, j], wide[begin[j] + t]
                    for part in range(parts):
                        total[part] += factor * source[part]
                for part in range(parts):
                    here[part, j] = total[part]
        for row in range(start, stop):
            begin_y = y_first[i, row] - lowest
            for part in range(2 * count):
                to = both[part]
                to[:] = 0
                for t in range(y_count):
                    factor, source = y_window[i, t, row], spread[begin_y + t, part]
                    for j in range(columns):
                        to[j] += factor * source[j]
            real[:] = 0
            imaginary[:] = 0
            for m in range(count):
                factors, re, im = basis[m, row], both[2 * m], both[2 * m + 1]
                for j in range(columns):
                    real[j] += factors[j] * re[j]
                    imaginary[j] += factors[j] * im[j]
            for channel in range(channels):
                to, factor = out[channel, row], share[channel, i]
                for j in range(columns):
                    to[j] += factor * (real[j] * real[j] + imaginary[j] * imaginary[j])


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz", "reassoc", "arcp"})
def _scattered_rows(  # type: ignore[no-untyped-def]
    table, origin, axes, scale, u, v, w, wavelength, share, start, stop, out
):
    channels, _, columns = out.shape
    terms = table.shape[2]
    x_count, y_count = int(axes[0, 3]), int(axes[1, 3])
    x_window, y_window = np.empty(x_count, np.float32), np.empty(y_count, np.float32)
    total = np.empty((terms, 2), np.float32)
    for row in range(start, stop):
        for j in range(columns):
            for channel in range(channels):
                out[channel, row, j] = 0
            if not np.isfinite(w[row, j]):
                continue
            for i in range(len(wavelength)):
                x = _window(u[row, j] / wavelength[i], axes[0], x_window) - origin[0]
                y = _window(v[row, j] / wavelength[i], axes[1], y_window) - origin[1]
                total[:] = 0
                for s in range(y_count):
                    for t in range(x_count):
                        factor, source = y_window[s] * x_window[t], table[y + s, x + t]
                        for n in range(terms):
                            total[n, 0] += factor * source[n, 0]
                            total[n, 1] += factor * source[n, 1]
                place = (w[row, j] / wavelength[i] - scale[0]) / scale[1]
                real, imaginary = total[0, 0], total[0, 1]
                before, now = np.float32(1), np.float32(place)
                for n in range(1, terms):
                    real += now * total[n, 0]
                    imaginary += now * total[n, 1]
                    before, now = now, np.float32(2 * place) * now - before
                power = real * real + imaginary * imaginary
                for channel in range(channels):
                    out[channel, row, j] += share[channel, i] * power


@njit(inline="always", error_model="numpy")
def _window(frequency: Any, axis: Any, window: Any) -> Any:
    """Write the window's weights at the lines within reach; give the first of them."""
    spacing, sigma, radius = axis[0], axis[1], axis[2]
    first = int(np.ceil((frequency - radius) / spacing))
    step = spacing / sigma
    away = (first * spacing - frequency) / sigma
    weight, ratio, change = np.exp(-0.5 * away * away), np.exp(-step * (away + 0.5 * step)), np.exp(-step * step)
    for t in range(len(window)):
        window[t] = weight
        weight *= ratio
        ratio *= change
    return first
