"""Profiles of gratings, bumps and pits on square samples, in tiles that repeat exactly where that is asked for.

Coordinates count periods: ``u`` along the grating's tangent, ``v`` across it, anticlockwise from ``u``. Heights are in
[0, 1], to be multiplied by the depth. Rows go down, y goes up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

_STRETCH = 0.03
"""Part by which a tile may be longer or shorter than asked for, so that its diagonal meets the grating's direction."""
_STRAIGHT = 1e-9
"""Sine of an angle below which a grating runs along the rows or columns."""
_EDGE = 1e-9
"""Part of a period by which edges lie before their samples, so that rounding moves none across."""

CHANNEL_BIT_UM = 1.2 / 4.3218
"""Length of a channel bit of a compact disc: 1.2 m/s at 4.3218 Mbit/s (ECMA-130)."""
SHORTEST_RUN, LONGEST_RUN = 3, 11
"""Channel bits of a pit, or of the land between two pits (eight-to-fourteen modulation)."""


@dataclass(frozen=True)
class GratingTile:
    """A tile of square samples in which a grating has a whole number of cycles along both axes.

    Attributes
    ----------
    shape : tuple of int
        Rows and columns.
    cycles_x, cycles_y : int
        Cycles along x (right) and y (up); negative where the phase falls that way.
    pitch_um : float
        Of the samples: with it the period is exact.
    """

    shape: tuple[int, int]
    cycles_x: int
    cycles_y: int
    pitch_um: float

    @property
    def orientation_rad(self) -> float:
        """Direction in which the phase rises fastest, in (-pi, pi]."""
        return float(np.arctan2(self.cycles_y / self.shape[0], self.cycles_x / self.shape[1]))

    def phase(self) -> Float64Array:
        """Cycles from the lower left sample, in [0, 1), of shape (M, N); exact, so that the tile repeats to the bit."""
        rows, columns = self.shape
        x, y = np.arange(columns), np.arange(rows)[::-1, None]
        return (x * (self.cycles_x * rows) + y * (self.cycles_y * columns)) % (rows * columns) / (rows * columns)


def grating_tile(*, period_um: float, orientation_rad: float, size_um: float, pitch_um: float) -> GratingTile:
    """A tile of about the size and pitch asked for that repeats, with exactly the period asked for.

    With ``a`` and ``b`` cycles along N columns and M rows, the tile fixes the period, ``1 / hypot(a / N, b / M)``
    pitches, and the direction, ``atan2(b / M, a / N)``. The pitch makes the period exact; among tiles up to three
    percent longer or shorter the one whose direction is nearest is taken: of some hundred samples a side, a few
    hundredths of a degree off.
    """
    cosine, sine = float(np.cos(orientation_rad)), float(np.sin(orientation_rad))
    cycles_x, columns = _side(cosine, period_um, size_um, pitch_um)
    cycles_y, rows = _side(sine, period_um, size_um, pitch_um)
    if cycles_x and cycles_y:
        wide, high = _near(columns), _near(rows)[:, None]
        off = np.abs(np.arctan2(cycles_y * wide / high, cycles_x) - np.arctan2(sine, cosine))
        best_row, best_column = np.unravel_index(int(np.argmin(off)), off.shape)
        rows, columns = int(high[best_row, 0]), int(wide[best_column])
    pitch = period_um * float(np.hypot(cycles_x / columns, cycles_y / rows))
    return GratingTile((rows, columns), cycles_x, cycles_y, pitch)


def _side(slope: float, period_um: float, size_um: float, pitch_um: float) -> tuple[int, int]:
    """Cycles and samples along an axis on which the phase rises by ``slope`` of a period a period."""
    if abs(slope) < _STRAIGHT:
        return 0, max(1, round(size_um / pitch_um))
    cycles = max(1, round(size_um * abs(slope) / period_um))
    samples = max(1, round(cycles * period_um / (abs(slope) * pitch_um)))
    return (cycles if slope > 0 else -cycles), samples


def _near(samples: int) -> NDArray[np.int_]:
    reach = int(samples * _STRETCH)
    return np.arange(max(1, samples - reach), samples + reach + 1)


def plane_coordinates(
    shape: tuple[int, int], pitch_um: float, orientation_rad: float
) -> tuple[Float64Array, Float64Array]:
    """Distances in um along a direction and across it, anticlockwise, from the lower left sample; each (M, N)."""
    x, y = np.arange(shape[1]) * pitch_um, np.arange(shape[0])[::-1, None] * pitch_um
    cosine, sine = np.cos(orientation_rad), np.sin(orientation_rad)
    return x * cosine + y * sine, y * cosine - x * sine


def blaze(u: Float64Array) -> Float64Array:
    """A sawtooth: rises along ``u`` over a period, and falls at once."""
    return u % 1.0


def cosine(u: Float64Array) -> Float64Array:
    """``(1 + cos(2 pi u)) / 2``."""
    return (1 + np.cos(2 * np.pi * u)) / 2


def bumps(u: Float64Array, v: Float64Array, width: float, length: float) -> BoolArray:
    """Where rectangular bumps stand, one a period both ways, ``width`` of it along u and ``length`` along v."""
    return ((u + _EDGE) % 1.0 < width) & ((v + _EDGE) % 1.0 < length)


def pits(u: Float64Array, v: Float64Array, marks: BoolArray, width: float) -> BoolArray:
    """Where pits lie on tracks that run along v.

    Parameters
    ----------
    u : ndarray
        In track pitches; a pit lies in the middle ``width`` of its track.
    v : ndarray
        In channel bits.
    marks : ndarray of shape (tracks, bits), bool
        Where each track has pits; repeats both ways.
    width : float
        Of a pit, in track pitches.
    """
    tracks, bits = marks.shape
    track, bit = np.floor(u + _EDGE).astype(int) % tracks, np.floor(v + _EDGE).astype(int) % bits
    return marks[track, bit] & ((u - 0.5 + width / 2 + _EDGE) % 1.0 < width)


def pit_marks(tracks: int, bits: int, rng: np.random.Generator) -> BoolArray:
    """Pits and lands in turn along each track, 3 to 11 channel bits long, that close on themselves after ``bits``.

    All lengths are drawn with the same chance, and then lengthened or shortened one by one until they fit.

    Parameters
    ----------
    tracks, bits : int
        Shape of the result; at least 6 bits.
    rng : numpy.random.Generator
        Draws the lengths.

    Returns
    -------
    ndarray of shape (tracks, bits), bool
    """
    return np.stack([_closed_track(bits, rng) for _ in range(tracks)])


def _closed_track(bits: int, rng: np.random.Generator) -> BoolArray:
    middle = (SHORTEST_RUN + LONGEST_RUN) / 2
    count = 2 * max(1, round(bits / (2 * middle)))
    runs = rng.integers(SHORTEST_RUN, LONGEST_RUN + 1, count)
    while runs.sum() != bits:
        step = int(np.sign(bits - runs.sum()))
        free = np.flatnonzero((runs + step >= SHORTEST_RUN) & (runs + step <= LONGEST_RUN))
        runs[rng.choice(free)] += step
    track = np.repeat(np.arange(count) % 2 == 0, runs)
    return np.roll(track, int(rng.integers(bits)))
