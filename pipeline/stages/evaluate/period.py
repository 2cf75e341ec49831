"""Estimated period against the sample that was drawn."""

from __future__ import annotations

import numpy as np

from pipeline.data.gratings import GratingSample, PeriodMap
from pipeline.data.metrics import Metrics
from pipeline.errors import InputError
from pipeline.optics.sampling import at_pixel_centres

# In percent: what maps that are equal within 1e-5 um may give.
_tolerance_period = {"metrics": 2e-3}


def period(estimate: PeriodMap, truth: GratingSample) -> Metrics:
    """Compare a period map with the truth at the centre of each pixel.

    Parameters
    ----------
    estimate : PeriodMap
        Of shape (M, N).
    truth : GratingSample
        Of shape (q M, q N) with an odd whole number q.

    Returns
    -------
    Metrics
        Absolute error relative to the true period: ``period_error_mean_percent``, ``period_error_median_percent`` and
        ``period_error_p95_percent``; ``period_bias_percent`` is the median of the signed one.

    Raises
    ------
    InputError
        The truth is not an odd whole number of times finer than the estimate, or they share no pixel.
    """
    true_um = at_pixel_centres(truth.period_um, estimate.mask.shape)
    if true_um is None:
        raise InputError(
            f"a truth of {truth.period_um.shape} does not lie on a map of {estimate.mask.shape}",
            expected="a truth that is an odd whole number of times finer",
        )
    both = estimate.mask & np.isfinite(estimate.period_um) & np.isfinite(true_um)
    if not both.any():
        raise InputError("the map and the truth share no diffracting pixel", expected="a map of the same sample")
    signed = 100 * (estimate.period_um[both].astype(np.float64) / true_um[both] - 1)
    absolute = np.abs(signed)
    return Metrics(
        {
            "period_error_mean_percent": float(np.mean(absolute)),
            "period_error_median_percent": float(np.median(absolute)),
            "period_error_p95_percent": float(np.percentile(absolute, 95)),
            "period_bias_percent": float(np.median(signed)),
        }
    )
