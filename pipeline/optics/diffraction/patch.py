"""A patch of a surface that repeats, its spectrum, and the coherence window through which light sees it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]
RowKernel = Callable[[int, int], None]
Components = tuple[Float64Array, Float64Array, Float64Array]
"""Of ``(u, v, w) = -light - view``, each of shape (M, N)."""


@dataclass(frozen=True)
class Patch:
    """One period of a surface.

    Attributes
    ----------
    height_um : ndarray of shape (R, C)
        Heights; row 0 is at the largest y.
    pitch_um : float
        Distance of its samples.
    """

    height_um: Float64Array
    pitch_um: float

    @property
    def spacing_per_um(self) -> tuple[float, float]:
        """Distance of its spectral lines along x and y, in cycles per micrometre."""
        rows, columns = self.height_um.shape
        return 1 / (columns * self.pitch_um), 1 / (rows * self.pitch_um)

    @property
    def relief_um(self) -> float:
        """Highest less lowest."""
        return float(np.ptp(self.height_um))

    def centred(self) -> Float64Array:
        """Heights about the middle of their range: a common height turns the phase of the response, nothing else."""
        return self.height_um - (self.height_um.max() + self.height_um.min()) / 2


@dataclass(frozen=True)
class Lines:
    """Which spectral lines along one axis a Gaussian window reaches from given frequencies.

    Attributes
    ----------
    spacing : float
        Distance of lines, in cycles per micrometre.
    sigma : float
        Standard deviation of the window, in cycles per micrometre.
    radius : float
        Beyond which its tail is left out, in cycles per micrometre.
    """

    spacing: float
    sigma: float
    radius: float

    @property
    def count(self) -> int:
        """Lines within reach, at most."""
        return int(np.floor(2 * self.radius / self.spacing)) + 1

    def first(self, frequency: Float64Array) -> NDArray[np.int32]:
        """The first line within reach of each frequency."""
        return np.ceil((frequency - self.radius) / self.spacing).astype(np.int32)

    def weights(self, frequency: Float64Array) -> Float32Array:
        """Window from frequencies (L, F) to the lines within their reach, shape (L, count, F)."""
        line = self.first(frequency)[:, None] + np.arange(self.count)[:, None]
        return np.exp(-0.5 * ((line * self.spacing - frequency[:, None]) / self.sigma) ** 2).astype(np.float32)


def frequency_sigma(coherence_um: float) -> float:
    """Standard deviation of the window's transform, in cycles per micrometre.

    The coherence window is a Gaussian that is ``coherence_um`` wide over four standard deviations ``sigma_s``, and its
    transform has ``1 / (2 pi sigma_s)``.
    """
    return 4 / (2 * np.pi * coherence_um)


@dataclass(frozen=True)
class Window:
    """A Gaussian window over a patch's spectral lines, and the lines that it reaches from a range of directions.

    Attributes
    ----------
    x, y : Lines
        Along either axis.
    across, along : tuple of int
        First line and the one after the last, along x and y.
    """

    x: Lines
    y: Lines
    across: tuple[int, int]
    along: tuple[int, int]

    @property
    def origin(self) -> NDArray[np.int64]:
        """First lines along x and y."""
        return np.array([self.across[0], self.along[0]])

    @property
    def axes(self) -> Float64Array:
        """Spacing, sigma, radius and count of the lines along x and y, shape (2, 4)."""
        return np.array([[lines.spacing, lines.sigma, lines.radius, lines.count] for lines in (self.x, self.y)])


def window_over(
    patch: Patch, uvw: Components, wavelength_um: Float64Array, *, coherence_um: float, tolerance: float
) -> Window:
    """The coherence window, with tails left out where it falls below ``tolerance``."""
    sigma = frequency_sigma(coherence_um)
    radius = sigma * float(np.sqrt(2 * np.log(1 / tolerance)))
    x, y = (Lines(spacing, sigma, radius) for spacing in patch.spacing_per_um)
    return Window(x, y, reached(x, uvw[0], wavelength_um), reached(y, uvw[1], wavelength_um))


def spread_out(uvw: Components, shape: tuple[int, ...]) -> list[Float64Array]:
    """Each component for each direction, contiguous, for compiled loops."""
    return [np.ascontiguousarray(np.broadcast_to(part, shape)) for part in uvw]


def spectral_lines(
    field: NDArray[np.complexfloating], x: tuple[int, int], y: tuple[int, int], workers: int = 1
) -> NDArray[np.complexfloating]:
    """Lines of a patch's transform ``mean(field exp(2 pi i (f_x x + f_y y)))``, y up, x to the right.

    Parameters
    ----------
    field : ndarray of shape (R, C)
        What light sees of one period, row 0 at the largest y.
    x, y : tuple of int
        First line and the one after the last, along either axis; they go round, as the transform of samples does.
    workers : int
        Threads.

    Returns
    -------
    ndarray of shape (y[1] - y[0], x[1] - x[0])
        Row 0 belongs to line ``y[0]``.
    """
    from scipy import fft

    rows, columns = field.shape
    along_x = fft.ifft(field, axis=1, workers=workers)[:, np.arange(*x) % columns]
    return np.ascontiguousarray(fft.ifft(along_x, axis=0, workers=workers)[-np.arange(*y) % rows])


def quotient_range(w: Float64Array, wavelength_um: Float64Array) -> tuple[float, float]:
    """Least and greatest ``w / lambda``; w is negative where light and viewer are above the surface."""
    ends = np.outer([np.nanmin(w), np.nanmax(w)], [1 / wavelength_um.min(), 1 / wavelength_um.max()])
    return float(ends.min()), float(ends.max())


def reached(lines: Lines, part: Float64Array, wavelength_um: Float64Array) -> tuple[int, int]:
    """First line that some frequency reaches, and the one after the last."""
    low, high = quotient_range(part, wavelength_um)
    first = lines.first(np.array([low, high]))
    return int(first[0]), int(first[1]) + lines.count


class SpectralResponse(Protocol):
    """What all evaluators have in common."""

    def rows(
        self,
        uvw: Components,
        wavelength_um: Float64Array,
        weights: Float64Array,
        out: Float32Array,
    ) -> RowKernel:
        """Prepare threads to add up responses over wavelengths, for rows ``start`` to ``stop`` of the directions.

        The response is ``|P|^2`` of the window ``g`` with ``P = sum g exp(2 pi i (u x + v y + w h) / lambda) / sum g``:
        1 for a mirror in its direction.

        Parameters
        ----------
        uvw : tuple of ndarray of shape (M, N)
            Directions; NaN gives 0.
        wavelength_um : ndarray of shape (L,)
            Wavelengths.
        weights : ndarray of shape (L, C)
            What each wavelength contributes to C sums, such as three colours.
        out : ndarray of shape (C, M, N), float32
            Written.
        """
        ...
