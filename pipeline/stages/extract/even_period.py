"""A period that is known and the same everywhere, where no photograph was taken through a filter to measure it."""

from __future__ import annotations

import numpy as np

from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.limits import above_zero, refuse


def even_period(orientation: OrientationMap, *, period_um: float) -> PeriodMap:
    """Give all pixels that diffract one period.

    Parameters
    ----------
    orientation : OrientationMap
        Of shape (M, N).
    period_um : float
        The period.

    Returns
    -------
    PeriodMap
        Of the same shape and pitch, absolute.

    Raises
    ------
    InputError
        The period is not above 0.
    """
    _check_even_period(period_um=period_um)
    period = np.where(orientation.mask, np.float32(period_um), np.float32(np.nan))
    return PeriodMap(period, orientation.mask, orientation.pixel_mm, relative=False)


def _check_even_period(*, period_um: float, **_: object) -> None:
    """Refuse what is no period before anything runs."""
    refuse(above_zero(period_um=period_um))
