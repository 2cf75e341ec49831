"""Spectral response of a patch that repeats a number of times: the source's factors P and Q.

A row of ``n`` patches of width ``T`` responds as one of them times ``sin(n pi f T) / (n sin(pi f T))``, a geometric
series in closed form; where ``f T`` is whole, its limit is 1 or -1. The patch's own response lies between its spectral
lines, and is looked up there linearly, or by the sinc that belongs to a patch of that width.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.optics.compiled import njit
from pipeline.optics.diffraction.patch import (
    Components,
    Float32Array,
    Float64Array,
    Patch,
    RowKernel,
    quotient_range,
    spread_out,
)
from pipeline.optics.diffraction.taylor import (
    Complex128Array,
    phase_range,
    taylor_power,
    taylor_table,
    taylor_terms,
)

_SAME_WIDTH = 0.836
"""A row as wide as this share of four standard deviations of a Gaussian window has orders of the same width as it."""


@dataclass(frozen=True)
class ReplicaResponse:
    """One patch, and how often it repeats.

    Attributes
    ----------
    table : ndarray of shape (N, Y, X), complex128
        Spectral lines of ``(2 pi i h)^n / n!``, the patch's middle at the origin.
    origin : tuple of int
        Lines along x and y of the table's first entry.
    spacing_per_um : tuple of float
        Distance of lines along x and y.
    replicas : tuple of int
        Patches side by side along x and y.
    reach : int
        Lines to either side that are looked up; 0 for linear interpolation.
    """

    table: Complex128Array
    origin: tuple[int, int]
    spacing_per_um: tuple[float, float]
    replicas: tuple[int, int]
    reach: int

    def rows(
        self,
        uvw: Components,
        wavelength_um: Float64Array,
        weights: Float64Array,
        out: Float32Array,
    ) -> RowKernel:
        """As :class:`SpectralResponse` says, with a row of patches for the window."""
        parts = spread_out(uvw, out.shape[1:])
        share, table, reach = weights.T.astype(np.float32), self.table, self.reach
        origin, spacing, count = np.array(self.origin), np.array(self.spacing_per_um), np.array(self.replicas)
        return lambda start, stop: _replica_rows(
            table, origin, spacing, count, reach, *parts, wavelength_um, share, start, stop, out
        )


def replica_response(
    patch: Patch,
    uvw: Components,
    wavelength_um: Float64Array,
    *,
    coherence_um: float,
    tolerance: float = 1e-4,
    terms: int | None = None,
    reach: int = 0,
    workers: int = 1,
) -> ReplicaResponse:
    """Transform the patch for as many Taylor terms as are needed.

    Parameters
    ----------
    patch : Patch
        One period of the surface.
    uvw, wavelength_um, tolerance, terms, workers
        As of :func:`taylor_response`.
    coherence_um : float
        Four standard deviations of the coherence window whose orders are as wide as those of the row of patches.
    reach : int
        Lines to either side for the interpolation by sinc; 0 interpolates linearly.
    """
    count = taylor_terms(phase_range(patch, uvw[2], wavelength_um), tolerance) if terms is None else terms
    spacing = patch.spacing_per_um
    margin = max(reach, 1) + 1
    spans = []
    for distance, part in zip(spacing, uvw, strict=False):
        low, high = quotient_range(part, wavelength_um)
        spans.append((int(np.floor(low / distance)) - margin, int(np.ceil(high / distance)) + margin + 1))
    table = taylor_table(patch.height_um - patch.height_um.min(), count, spans[0], spans[1], workers)
    # Half a patch away from its corner the transform has no more turns between lines than the sinc allows.
    x, y = (np.arange(*span) for span in spans)
    rows, columns = patch.height_um.shape
    middle = np.exp(-2j * np.pi * (x * (columns - 1) / 2 / columns - y[:, None] * (rows - 1) / 2 / rows))
    replicas = tuple(max(1, round(_SAME_WIDTH * coherence_um * distance)) for distance in spacing)
    return ReplicaResponse(table * middle, (spans[0][0], spans[1][0]), spacing, replicas, reach)  # type: ignore[arg-type]


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz", "reassoc", "arcp"})
def _replica_rows(  # type: ignore[no-untyped-def]
    table, origin, spacing, replicas, reach, u, v, w, wavelength, share, start, stop, out
):
    channels, _, columns = out.shape
    size = 2 if reach == 0 else 2 * reach + 1
    x_weights, y_weights, window = np.empty(size), np.empty(size), np.empty((size, size))
    for row in range(start, stop):
        for j in range(columns):
            for channel in range(channels):
                out[channel, row, j] = 0
            if not np.isfinite(w[row, j]):
                continue
            for i in range(len(wavelength)):
                x, y = u[row, j] / wavelength[i] / spacing[0], v[row, j] / wavelength[i] / spacing[1]
                x0, y0 = _interpolation(x, reach, x_weights), _interpolation(y, reach, y_weights)
                for s in range(size):
                    for t in range(size):
                        window[s, t] = y_weights[s] * x_weights[t]
                power = taylor_power(table, y0 - origin[1], x0 - origin[0], window, w[row, j] / wavelength[i])
                repeated = _series(x, replicas[0]) * _series(y, replicas[1])
                power *= np.float32(repeated * repeated)
                for channel in range(channels):
                    out[channel, row, j] += share[channel, i] * power


@njit(inline="always", error_model="numpy")
def _interpolation(place, reach, weights):  # type: ignore[no-untyped-def]
    """Write the weights of the lines around a place, in units of their distance; give the first of them."""
    if reach == 0:
        first = int(np.floor(place))
        weights[1] = place - first
        weights[0] = 1 - weights[1]
        return first
    first = int(np.rint(place)) - reach
    for t in range(len(weights)):
        away = np.pi * (place - first - t)
        weights[t] = np.sin(away) / away if abs(away) > 1e-9 else 1.0
    return first


@njit(inline="always", error_model="numpy")
def _series(place, count):  # type: ignore[no-untyped-def]
    """``sin(n pi x) / (n sin(pi x))``, its limit at whole ``x`` included."""
    away = place - np.rint(place)
    below = count * np.sin(np.pi * away)
    return np.sin(np.pi * count * away) / below if abs(below) > 1e-9 else 1.0
