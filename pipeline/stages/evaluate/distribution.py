"""A measured joint distribution of gratings against the sheet that was drawn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.data.flash_maps import GratingDistribution
from pipeline.data.gratings import GratingSample
from pipeline.data.metrics import Metrics
from pipeline.errors import InputError
from pipeline.optics.flash.distribution import Bins

_tolerance_distribution = {"metrics": 0.1}


def distribution(estimate: GratingDistribution, truth: GratingSample) -> Metrics:
    """Compare how common orientations and periods are with the areas that a sheet gives them.

    Parameters
    ----------
    estimate : GratingDistribution
        As measured.
    truth : GratingSample
        The sheet.

    Returns
    -------
    Metrics
        ``distribution_distance_percent``: half the sum of the bins' absolute differences, 0 to 100.
        ``period_by_orientation_error_median_percent``: of the mean period of each orientation. ``bins_filled_ratio``:
        the exponential of the entropy, relative to the truth's; above 1, gratings are stated that are not there.

    Raises
    ------
    InputError
        None of the sheet's gratings lies in the bins.
    """
    pitch = float(estimate.period_um[1] - estimate.period_um[0])
    bins = Bins(
        len(estimate.orientation_rad),
        len(estimate.period_um),
        float(estimate.period_um[0]) - pitch / 2,
        float(estimate.period_um[-1]) + pitch / 2,
    )
    known = truth.diffracts
    orientation, period = (np.asarray(a[known], np.float64) for a in (truth.orientation_rad, truth.period_um))
    _, count = bins.means(orientation, period, np.ones_like(period))
    if not count.any():
        raise InputError("no grating of the sheet has a period in the bins", expected="a range that holds its periods")
    true = count / count.sum()
    error = 100 * np.abs(_mean_period(estimate.share, bins) / _mean_period(true, bins) - 1)
    return Metrics(
        {
            "distribution_distance_percent": 50 * float(np.abs(estimate.share - true).sum()),
            "period_by_orientation_error_median_percent": float(np.nanmedian(error)),
            "bins_filled_ratio": _filled(estimate.share) / _filled(true),
        }
    )


def _mean_period(share: NDArray[np.float64], bins: Bins) -> NDArray[np.float64]:
    with np.errstate(invalid="ignore"):
        return np.asarray((share * bins.period_um).sum(axis=1) / share.sum(axis=1))


def _filled(share: NDArray[np.float64]) -> float:
    some = share[share > 0]
    return float(np.exp(-np.sum(some * np.log(some))))
