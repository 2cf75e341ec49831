"""Regions in which an item differs from its reference, and what is the matter with each."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.optics.deviation import extents
from pipeline.optics.grating_pair import GratingPair
from pipeline.optics.regions import described, disc, eroded, grown, joined

BoolArray = NDArray[np.bool_]

RESOLVED_PX = 5.0
"""A dark region narrower than this may be no grating or one of a shorter period: its pixels are mixed."""

_LONG = 3.0
_WHOLE = 0.7
_FACET_SHARE = 0.5
_RIM_PX = 3.0


@dataclass(frozen=True)
class Flaw:
    """One region.

    Attributes
    ----------
    area : ndarray of shape (M, N), bool
        Its pixels.
    kind : str
        ``missing``, ``scratch``, ``extra``, ``turned`` or ``period``.
    significance : float
        In standard deviations of the noise over its own area.
    turn_rad, period_ratio : float
        In its middle; NaN without a grating.
    """

    area: BoolArray
    kind: str
    significance: float
    turn_rad: float = float("nan")
    period_ratio: float = float("nan")


def flaws(
    pair: GratingPair, *, threshold: float, least_turn_rad: float, least_log_ratio: float, least_pixels: int
) -> list[Flaw]:
    """All regions that differ by more than the threshold and the tolerances, the most significant first.

    Parameters
    ----------
    pair : GratingPair
        The item on the reference.
    threshold : float
        In standard deviations.
    least_turn_rad, least_log_ratio : float
        Tolerances of orientation and of the logarithm of the period.
    least_pixels : int
        Smaller regions are left out.
    """
    turned = pair.completed(extents(pair.turn, threshold, least_turn_rad), pair.turn_rad, pair.turn.noise)
    other = pair.completed(extents(pair.ratio, threshold, least_log_ratio), pair.log_ratio, pair.ratio.noise)
    dark = other & (pair.log_ratio < 0)
    wide = cv2.morphologyEx(dark.astype(np.uint8), cv2.MORPH_OPEN, disc(RESOLVED_PX / 2)).astype(bool)
    narrow = dark & ~grown(wide, RESOLVED_PX / 2)
    found = _gone(pair, narrow, least_pixels)
    taken = np.any([flaw.area for flaw in found], axis=0) if found else np.zeros_like(turned)
    free = ~grown(taken, _RIM_PX)
    found += _altered(pair, turned & free, other & ~narrow & free, least_turn_rad, least_log_ratio, least_pixels)
    found += [
        Flaw(area, "extra", abs(pair.brightness.over(area)[1]))
        for area in _areas(pair.added, RESOLVED_PX, least_pixels)
    ]
    return sorted((flaw for flaw in found if flaw.significance >= threshold), key=lambda flaw: -flaw.significance)


def _areas(area: BoolArray, gap_px: float, least_pixels: int) -> list[BoolArray]:
    labels, count = joined(area, gap_px)
    parts = [labels == label for label in range(1, count + 1)]
    return [part for part in parts if np.count_nonzero(part) >= least_pixels]


def _gone(pair: GratingPair, narrow: BoolArray, least_pixels: int) -> list[Flaw]:
    """Where gratings are missing, or too dark in too narrow a region to tell."""
    return [
        Flaw(area, _kind_of_gap(pair, area), abs(pair.brightness.over(area & (pair.surely_lost | pair.judged))[1]))
        for area in _areas(pair.lost | narrow, RESOLVED_PX, least_pixels)
        if np.count_nonzero(area & (pair.surely_lost | narrow)) >= least_pixels
    ]


def _kind_of_gap(pair: GratingPair, area: BoolArray) -> str:
    """A long and narrow gap is a scratch, unless it is a facet, or facets, of the reference as a whole."""
    if described(area.astype(np.int32), 1, 1.0).elongation[0] < _LONG:
        return "missing"
    facets, count = joined(pair.expected & ~pair.edges)
    size, gone = (np.bincount(facets[where], minlength=count + 1)[1:] for where in (facets > 0, area))
    of_facets = gone[gone > _WHOLE * size].sum()
    return "missing" if of_facets > _FACET_SHARE * gone.sum() else "scratch"


def _altered(
    pair: GratingPair,
    turned: BoolArray,
    other: BoolArray,
    least_turn_rad: float,
    least_log_ratio: float,
    least_pixels: int,
) -> list[Flaw]:
    """Where gratings are turned or of a wrong period, as a whole by more than the tolerance; the turn goes first."""
    found = []
    for area in _areas(turned | other, 0.0, least_pixels):
        # Pixels at the rim are mixed.
        middle = eroded(area, 2.0) & pair.judged
        middle = middle if np.count_nonzero(middle) >= least_pixels else area
        turn, log_ratio = pair.turn.over(middle)[0], pair.ratio.over(middle)[0]
        of_turn, of_ratio = abs(pair.turn.over(area)[1]), abs(pair.ratio.over(area)[1])
        if log_ratio < 0 and np.mean(pair.unmodulated[area]) > 0.5:
            found.append(Flaw(area, "missing", of_ratio))
        elif np.count_nonzero(area & turned) * 2 >= np.count_nonzero(area & other) and abs(turn) >= least_turn_rad:
            found.append(Flaw(area, "turned", of_turn, turn, float(np.exp(log_ratio))))
        elif abs(log_ratio) >= least_log_ratio:
            found.append(Flaw(area, "period", of_ratio, turn, float(np.exp(log_ratio))))
    return found
