"""The gratings of a paper that shows a spiral under a small light."""

from __future__ import annotations

import numpy as np

from pipeline.data.flash_maps import GratingDistribution
from pipeline.errors import InputError
from pipeline.limits import above_zero, at_least, refuse
from pipeline.optics.flash.distribution import Bins


def spiral(
    *,
    first_um: float = 1.25,
    last_um: float = 2.1,
    scatter_um: float = 0.04,
    turn_deg: float = 0.0,
    orientations: int = 60,
    periods: int = 40,
    shortest_um: float = 0.8,
    longest_um: float = 3.0,
) -> GratingDistribution:
    """State how common each orientation and period is where the period grows with the orientation.

    All orientations are equally common. Light of one wavelength is diffracted at a distance from the highlight that
    goes as one over the period, so that the sheet shows a spiral of two arms.

    Parameters
    ----------
    first_um, last_um : float
        Period where the orientation is ``turn_deg``, and half a turn on, where the spiral jumps back.
    scatter_um : float
        Standard deviation of periods of one orientation.
    turn_deg : float
        Orientation of the first period.
    orientations, periods : int
        Bins.
    shortest_um, longest_um : float
        Between which periods are counted.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018),
    figures 7b and 9.
    """
    _check_spiral(
        first_um=first_um,
        last_um=last_um,
        scatter_um=scatter_um,
        orientations=orientations,
        periods=periods,
        shortest_um=shortest_um,
        longest_um=longest_um,
    )
    bins = Bins(orientations, periods, shortest_um, longest_um)
    along = np.mod(bins.orientation_rad - np.deg2rad(turn_deg), np.pi) / np.pi
    middle = first_um + (last_um - first_um) * along
    share = np.exp(-(((bins.period_um - middle[:, None]) / scatter_um) ** 2) / 2)
    share /= share.sum(axis=1, keepdims=True) * orientations
    return GratingDistribution(share, bins.orientation_rad, bins.period_um, np.ones(share.shape, bool))


def _check_spiral(
    *,
    first_um: float,
    last_um: float,
    scatter_um: float,
    orientations: int,
    periods: int,
    shortest_um: float,
    longest_um: float,
    **_: object,
) -> None:
    """Refuse what no paper can have, before anything runs."""
    refuse(
        above_zero(
            first_um=first_um,
            last_um=last_um,
            scatter_um=scatter_um,
            shortest_um=shortest_um,
            longest_um=longest_um,
        ),
        at_least(2, "to tell gratings apart", orientations=orientations, periods=periods),
    )
    low, high = min(first_um, last_um), max(first_um, last_um)
    if not shortest_um <= low <= high <= longest_um:
        raise InputError(
            f"periods of {low:g} to {high:g} um do not lie between {shortest_um:g} and {longest_um:g}",
            where="shortest_um, longest_um",
            expected="a range that holds first_um and last_um",
        )
