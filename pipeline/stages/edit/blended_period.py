"""A period for every orientation."""

from __future__ import annotations

import logging
from typing import Literal

import numpy as np

from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.errors import InputError
from pipeline.limits import above_zero, at_least, refuse
from pipeline.optics.period_blends import blended_periods

_log = logging.getLogger(__name__)


def blended_period(
    orientation: OrientationMap,
    *,
    shortest_um: float = 1.0,
    longest_um: float = 2.0,
    blend: Literal["quadratic", "squared sine", "closed squared sine"] = "quadratic",
    bins: int = 180,
) -> PeriodMap:
    """Give each orientation a period between two ends, from the shortest at 0 degrees to the longest at 179.

    What diffracts into rings of colour while all periods are the same then shows spirals: a point's colour tells its
    orientation. The equations are those of :func:`pipeline.optics.period_blends.blended_periods`: with the bin ``b``
    of an orientation and ``t = b / (bins - 1)``, the period is ``shortest + (longest - shortest) f(t)``.

    Parameters
    ----------
    orientation : OrientationMap
        Of shape (M, N). Where it is known only up to one offset, so is where the blend begins: there is a warning.
    shortest_um, longest_um : float
        The ends.
    blend : {"quadratic", "squared sine", "closed squared sine"}
        ``f(t) = t^2``, ``sin^2(pi t / 2)`` or ``sin^2(pi t)``. The first two jump from the longest period back to the
        shortest between 179 and 0 degrees, a seam in a pattern that turns smoothly; the last, which is longest at 90
        degrees, does not.
    bins : int
        Into how many the half turn is divided.

    Returns
    -------
    PeriodMap
        Of the same shape, pitch and mask, absolute.

    Raises
    ------
    InputError, InputErrors
        No period, the shortest above the longest, or fewer than 2 bins.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018), section
    6.4 and figure 22.
    """
    _check_blended_period(shortest_um=shortest_um, longest_um=longest_um, bins=bins)
    if not orientation.absolute:
        _log.warning("orientations are known up to one offset: the blend begins at an orientation that is not known")
    period = blended_periods(orientation.orientation_rad, shortest_um, longest_um, blend, bins)
    mask = orientation.mask & np.isfinite(period)
    return PeriodMap(np.where(mask, period, np.nan).astype(np.float32), mask, orientation.pixel_mm, relative=False)


def _check_blended_period(*, shortest_um: float, longest_um: float, bins: int, **_: object) -> None:
    """Refuse what is no blend, before anything runs."""
    refuse(above_zero(shortest_um=shortest_um, longest_um=longest_um), at_least(2, "one for each end", bins=bins))
    if shortest_um > longest_um:
        raise InputError(
            f"shortest_um is {shortest_um:g}, and longest_um {longest_um:g}",
            where="shortest_um",
            expected="at most longest_um",
        )
