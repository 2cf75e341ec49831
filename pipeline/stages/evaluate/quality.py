"""What an orientation map says about itself."""

from __future__ import annotations

import numpy as np

from pipeline.data import Metrics, OrientationMap


def quality(estimate: OrientationMap) -> Metrics:
    """Figures that need no truth.

    Parameters
    ----------
    estimate : OrientationMap
        Of shape (M, N).

    Returns
    -------
    Metrics
        ``correlation_mean`` over the mask and ``diffracting_share_percent``, the mask's share of the photograph.
    """
    correlation = estimate.correlation[estimate.mask]
    return Metrics(
        {
            "correlation_mean": float(np.mean(correlation, dtype=np.float64)) if correlation.size else float("nan"),
            "diffracting_share_percent": 100 * float(np.mean(estimate.mask)),
        }
    )
