"""What an orientation map says about itself."""

from __future__ import annotations

import numpy as np

from pipeline.data.gratings import OrientationMap
from pipeline.data.metrics import Metrics

# What maps whose correlations are equal within 1e-5 may give.
_tolerance_quality = {"metrics": 1e-5}


def quality(estimate: OrientationMap) -> Metrics:
    """Figures that need no truth.

    Parameters
    ----------
    estimate : OrientationMap
        Of shape (M, N).

    Returns
    -------
    Metrics
        ``correlation_mean`` over the mask and ``diffracting_share_percent``, the mask's share of the photograph. The
        former is left out where it is not known, as after a fit of three photographs.
    """
    metrics = {}
    correlation = estimate.correlation[estimate.mask]
    if np.isfinite(correlation).any():
        metrics["correlation_mean"] = float(np.nanmean(correlation, dtype=np.float64))
    metrics["diffracting_share_percent"] = 100 * float(np.mean(estimate.mask))
    return Metrics(metrics)
