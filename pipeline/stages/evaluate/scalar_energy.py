"""How far scalar diffraction balances energy for a sheet's gratings."""

from __future__ import annotations

from typing import Literal

import numpy as np

from pipeline.data.gratings import PeriodMap
from pipeline.data.metrics import Metrics
from pipeline.errors import InputError
from pipeline.limits import refuse, zero_or_more
from pipeline.optics.sheet.validity import evanescent_share, expansion_error, leaving_share


def scalar_energy(
    period: PeriodMap, *, depth_um: float = 0.12, illuminant: Literal["D65", "A", "inverse A", "E"] = "D65"
) -> Metrics:
    """Say what becomes of normally incident light by the model that renders the sheet.

    Parameters
    ----------
    period : PeriodMap
        The sheet's; its shortest period is judged.
    depth_um : float
        Peak-to-valley depth of the gratings.
    illuminant : str
        Spectrum of the light.

    Returns
    -------
    Metrics
        ``shortest_um``; ``leaving_percent`` of the light in orders that leave, 100 if the theory balanced energy;
        ``evanescent_percent``, in orders that cannot; ``expansion_error_percent``, the largest error of an order's
        share by the paper's expansion to second order, of all light.

    Raises
    ------
    InputError
        There is no grating.
    """
    _check_scalar_energy(depth_um=depth_um)
    known = period.period_um[np.isfinite(period.period_um)]
    if not known.size:
        raise InputError("the sheet has no grating")
    shortest = float(known.min())
    return Metrics(
        {
            "shortest_um": shortest,
            "leaving_percent": 100 * leaving_share(shortest, depth_um, illuminant),
            "evanescent_percent": 100 * evanescent_share(shortest, depth_um, illuminant),
            "expansion_error_percent": 100 * expansion_error(depth_um, illuminant),
        }
    )


def _check_scalar_energy(*, depth_um: float, **_: object) -> None:
    """Refuse a depth that is none before anything runs."""
    refuse(zero_or_more(depth_um=depth_um))
