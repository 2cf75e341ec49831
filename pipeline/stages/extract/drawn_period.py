"""The periods of a drawn sample, as if they had been measured without error."""

from __future__ import annotations

import numpy as np

from pipeline.data.gratings import GratingSample, PeriodMap


def drawn_period(sample: GratingSample) -> PeriodMap:
    """Take the periods that were drawn.

    Parameters
    ----------
    sample : GratingSample
        Of shape (M, N).

    Returns
    -------
    PeriodMap
        Of the same shape and pitch, absolute.
    """
    return PeriodMap(sample.period_um, np.isfinite(sample.period_um), sample.pixel_mm, relative=False)
