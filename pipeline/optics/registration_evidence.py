"""Whether two photographs show the same edges at all, wherever one lies on the other.

Every two pictures agree best somewhere, those of noise too. How far that is above what they agree on elsewhere tells
whether it means anything.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.signal.windows import tukey

from pipeline.optics.coarse_registration import FARTHEST, coarse_turn, turned_back
from pipeline.optics.rigid import RigidMotion

Float32Array = NDArray[np.float32]

_WHITENED = 0.75
"""Spectra are divided by this power of their magnitude: broad shapes agree at many shifts and would pass for chance,
while at 1 frequencies count that hold noise alone."""

_PEAK = 5
"""Pixels around the best shift that are not counted as elsewhere."""

_TAPER_PX = 4
"""Pictures fade out at their borders, which lie on each other in all photographs and are no edges."""

_EVEN = 1e-5
"""Contrast of edge images below which there is nothing but rounding."""

_BY_CHANCE = 7.0
"""Normal deviates reach 6.8 in a million shifts once in ten thousand times; scenes with outlines have 20 and more, and
10 in the light of 15 electrons."""


@dataclass(frozen=True)
class Agreement:
    """Where the edges of two photographs agree best.

    Attributes
    ----------
    motion : RigidMotion
        Of one photograph against the other.
    step_px : float
        To how many pixels it is known.
    significance : float
        The agreement there over the root mean square of that elsewhere, as pictures without shared edges have it.
    """

    motion: RigidMotion = field(default_factory=RigidMotion)
    step_px: float = 1.0
    significance: float = np.inf

    @property
    def by_chance(self) -> bool:
        """Whether photographs that share nothing agree as well."""
        return self.significance < _BY_CHANCE


def judged(
    reference: list[Float32Array], moved: list[Float32Array], *, largest_px: float, largest_rad: float, turn_rad: float
) -> Agreement:
    """How two photographs agree, in their own pixels; as they are, or turned back where that is better.

    Parameters
    ----------
    reference, moved : list of ndarray, float32
        The :func:`pipeline.optics.coarse_registration.edge_images` of both.
    largest_px, largest_rad : float
        Shifts and turns that are looked for where they do not agree as they are, nor turned back by ``turn_rad``.
    turn_rad : float
        Of the second photograph, as far as it is known.
    """

    def at(level: int, turn: float) -> Agreement:
        shift, significance = agreement(reference[level], turned_back(moved[level], turn))
        step_px = reference[-1].shape[0] / reference[level].shape[0]
        row, column = RigidMotion(turn).matrix @ shift * step_px
        return Agreement(RigidMotion(turn, (float(row), float(column))), step_px, significance)

    tried = [at(-2, turn) for turn in {0.0, turn_rad}]
    if all(found.by_chance for found in tried):  # averaged over pixels, fine detail may be lost
        tried.append(at(-1, turn_rad))
    if not turn_rad and all(found.by_chance for found in tried):
        tried.append(at(-2, coarse_turn(reference, moved, largest_px=largest_px, largest_rad=largest_rad)))
    return max(tried, key=lambda found: found.significance)


def agreement(reference: Float32Array, moved: Float32Array) -> tuple[tuple[int, int], float]:
    """Where two edge images of shape (M, N) agree best, in rows and columns, and its significance.

    All shifts up to ``FARTHEST`` are looked at.

    References
    ----------
    Knapp and Carter, The generalized correlation method for estimation of time delay, IEEE Trans. Acoustics, Speech,
    and Signal Processing 24 (1976); Kumar and Hassebrook, Performance measures for correlation filters, Applied Optics
    29 (1990), for the peak over the energy of the rest.
    """
    if min(np.ptp(reference), np.ptp(moved)) < _EVEN:
        return (0, 0), 0.0
    reach = [int(FARTHEST * n) for n in reference.shape]
    sizes = [fft.next_fast_len(n + r, real=True) for n, r in zip(reference.shape, reach, strict=True)]
    around = fft.irfft2(np.conj(_whitened(reference, sizes)) * _whitened(moved, sizes), s=sizes)
    below, right = (np.arange(-r, r + 1) for r in reach)
    searched = around[np.ix_(below, right)]
    row, column = np.unravel_index(np.argmax(searched), searched.shape)
    highest, down, across = float(searched[row, column]), int(below[row]), int(right[column])
    rest = np.ones(around.shape, np.bool_)
    rest[np.ix_(*(np.arange(d - _PEAK, d + _PEAK + 1) % n for d, n in zip((down, across), sizes, strict=True)))] = False
    if not rest.any():
        return (down, across), 0.0
    # What is padded adds shifts, but nothing that agrees there.
    elsewhere = float(np.sqrt(np.mean(around[rest].astype(np.float64) ** 2) * around.size / reference.size))
    return (down, across), highest / elsewhere if elsewhere > 0 else 0.0


def _whitened(edges: Float32Array, sizes: list[int]) -> NDArray[np.complex64]:
    taper = np.outer(*(tukey(side + 2, min(1, 2 * _TAPER_PX / (side + 2)))[1:-1] for side in edges.shape)).astype(
        np.float32
    )
    spectrum = fft.rfft2((edges - np.average(edges, weights=taper)) * taper, s=sizes)
    return np.asarray(spectrum / np.maximum(np.abs(spectrum), np.finfo(np.float32).tiny) ** _WHITENED)
