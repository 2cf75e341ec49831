"""The periods of a print."""

from __future__ import annotations

import numpy as np

from pipeline.data.gratings import PeriodMap
from pipeline.data.printing import PrintLayout


def printed_period(layout: PrintLayout) -> PeriodMap:
    """Take the periods of a print's dots as a map, so that the print can be rendered before it is made.

    Parameters
    ----------
    layout : PrintLayout
        Of M x N dots.

    Returns
    -------
    PeriodMap
        Of shape (M, N), a pixel a dot, absolute.
    """
    period = (1000 / layout.lines_per_mm).astype(np.float32)
    return PeriodMap(period, np.isfinite(period), layout.dot_mm, relative=False)
