"""Spectral response of regular bumps of which only the distance is known (Stam 1999, the example of section 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.optics.compiled import njit
from pipeline.optics.diffraction.patch import (
    Components,
    Float32Array,
    Float64Array,
    RowKernel,
    frequency_sigma,
    spread_out,
)


@dataclass(frozen=True)
class BumpResponse:
    """All orders that bumps at a distance can send, each as bright as the mirror's.

    Attributes
    ----------
    lattice_per_um : ndarray of shape (2,)
        Frequency of the first order along x and y.
    coherence_um : float
        Four standard deviations of the coherence window, which gives orders their width.
    """

    lattice_per_um: Float64Array
    coherence_um: float

    def rows(
        self,
        uvw: Components,
        wavelength_um: Float64Array,
        weights: Float64Array,
        out: Float32Array,
    ) -> RowKernel:
        """As :class:`SpectralResponse` says; heights do not matter."""
        parts = spread_out(uvw, out.shape[1:])
        share, sigma = weights.T.astype(np.float32), frequency_sigma(self.coherence_um)
        lattice = self.lattice_per_um
        return lambda start, stop: _bump_rows(lattice, sigma, *parts, wavelength_um, share, start, stop, out)


@njit(nogil=True, cache=True, error_model="numpy")
def _bump_rows(  # type: ignore[no-untyped-def]
    lattice, sigma, u, v, w, wavelength, share, start, stop, out
):
    channels, _, columns = out.shape
    square = lattice[0] ** 2 + lattice[1] ** 2
    for row in range(start, stop):
        for j in range(columns):
            for channel in range(channels):
                out[channel, row, j] = 0
            if not np.isfinite(w[row, j]):
                continue
            for i in range(len(wavelength)):
                fx, fy = u[row, j] / wavelength[i], v[row, j] / wavelength[i]
                order = np.rint((fx * lattice[0] + fy * lattice[1]) / square)
                across, along = fx - order * lattice[0], fy - order * lattice[1]
                power = np.float32(np.exp(-(across * across + along * along) / (sigma * sigma)))
                for channel in range(channels):
                    out[channel, row, j] += share[channel, i] * power
