"""Spectral response by the sum that defines it: the reference that other evaluators are measured against."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.optics.compiled import njit
from pipeline.optics.diffraction.patch import Components, Float32Array, Float64Array, Patch, RowKernel, spread_out

_REACH = 5.0
"""Standard deviations of the coherence window after which its tail, 6e-7 of its sum, is left out."""


@dataclass(frozen=True)
class DirectResponse:
    """The surface within the coherence window, point by point.

    Attributes
    ----------
    x_um, y_um : ndarray of shape (X,), (Y,)
        Where its samples lie, around the window's middle.
    height_um : ndarray of shape (Y, X)
        The patch, repeated.
    x_window, y_window : ndarray of shape (X,), (Y,)
        The window's factors along either axis, each of sum 1.
    """

    x_um: Float64Array
    y_um: Float64Array
    height_um: Float64Array
    x_window: Float64Array
    y_window: Float64Array

    def rows(
        self,
        uvw: Components,
        wavelength_um: Float64Array,
        weights: Float64Array,
        out: Float32Array,
    ) -> RowKernel:
        """As :class:`SpectralResponse` says; every direction costs a sum over all samples, so few can be asked for."""
        parts = spread_out(uvw, out.shape[1:])
        surface = (self.x_um, self.y_um, self.height_um, self.x_window, self.y_window)
        share = weights.T.astype(np.float64)
        return lambda start, stop: _direct_rows(*surface, *parts, wavelength_um, share, start, stop, out)


def direct_response(patch: Patch, *, coherence_um: float) -> DirectResponse:
    """Repeat a patch as far as the coherence window reaches.

    Parameters
    ----------
    patch : Patch
        One period of the surface; the window's middle lies on its first sample.
    coherence_um : float
        Four standard deviations of the coherence window.
    """
    reach = int(np.ceil(_REACH * coherence_um / 4 / patch.pitch_um))
    places = np.arange(-reach, reach + 1)
    at = np.asarray(places * patch.pitch_um, np.float64)
    rows, columns = patch.height_um.shape
    window = np.exp(-0.5 * (at * 4 / coherence_um) ** 2)
    window /= window.sum()
    height = patch.centred()[np.ix_(places % rows, places % columns)]
    return DirectResponse(at, -at, height, window, window)


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz", "reassoc", "arcp"})
def _direct_rows(  # type: ignore[no-untyped-def]
    x, y, height, x_window, y_window, u, v, w, wavelength, share, start, stop, out
):
    channels, _, columns = out.shape
    for row in range(start, stop):
        for j in range(columns):
            for channel in range(channels):
                out[channel, row, j] = 0
            if not np.isfinite(w[row, j]):
                continue
            for i in range(len(wavelength)):
                turns = 2 * np.pi / wavelength[i]
                real = imaginary = 0.0
                for s in range(len(y)):
                    for t in range(len(x)):
                        phase = turns * (u[row, j] * x[t] + v[row, j] * y[s] + w[row, j] * height[s, t])
                        weight = x_window[t] * y_window[s]
                        real += weight * np.cos(phase)
                        imaginary += weight * np.sin(phase)
                for channel in range(channels):
                    out[channel, row, j] += share[channel, i] * (real * real + imaginary * imaginary)


@dataclass(frozen=True)
class NonuniformResponse:
    """The same sum for many directions at once, by a three-dimensional non-uniform FFT (finufft, an extra)."""

    surface: DirectResponse
    tolerance: float
    workers: int

    def rows(
        self,
        uvw: Components,
        wavelength_um: Float64Array,
        weights: Float64Array,
        out: Float32Array,
    ) -> RowKernel:
        """As :class:`SpectralResponse` says; give it all rows at once, each call transforms anew."""
        import finufft

        surface = self.surface
        across, down = np.meshgrid(surface.x_um, surface.y_um)
        strength = (surface.y_window[:, None] * surface.x_window).ravel().astype(np.complex128)
        points = [np.ascontiguousarray(part.ravel()) for part in (across, down, surface.height_um)]
        parts = [np.broadcast_to(part, out.shape[1:]) for part in uvw]

        def rows(start: int, stop: int) -> None:
            known = np.isfinite(parts[2][start:stop])
            turns = [
                np.concatenate([2 * np.pi / lam * part[start:stop][known] for lam in wavelength_um]) for part in parts
            ]
            found = finufft.nufft3d3(*points, strength, *turns, eps=self.tolerance, isign=1, nthreads=self.workers)
            power = (np.abs(found) ** 2).reshape(len(wavelength_um), -1)
            out[:, start:stop] = 0
            out[:, start:stop][:, known] = weights.T @ power

        return rows


def nonuniform_response(
    patch: Patch, *, coherence_um: float, tolerance: float = 1e-7, workers: int = 1
) -> NonuniformResponse:
    """Repeat a patch as :func:`direct_response` does; ``tolerance`` is the transform's relative error."""
    return NonuniformResponse(direct_response(patch, coherence_um=coherence_um), tolerance, workers)
