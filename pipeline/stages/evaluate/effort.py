"""What an orientation map took, and what it claims."""

from __future__ import annotations

import numpy as np

from pipeline.data.flash import FlashBrackets
from pipeline.data.gratings import OrientationMap
from pipeline.data.metrics import Metrics
from pipeline.data.photographs import PolarizerSequence

# What maps whose stated errors are equal within 1e-4 rad may give.
_tolerance_effort = {"metrics": 1e-2}


def effort(estimate: OrientationMap, photos: PolarizerSequence | FlashBrackets) -> Metrics:
    """Figures by which maps of different methods are compared, beside their errors.

    Parameters
    ----------
    estimate : OrientationMap
        Of shape (M, N).
    photos : PolarizerSequence or FlashBrackets
        From which it was made.

    Returns
    -------
    Metrics
        ``photographs``: angles of the polariser, or places of the flash; ``exposures``: how often the shutter opened,
        for brackets and under room light too; ``absolute``: 1 or 0; ``map_pixel_mm``; ``doubt_median_deg``, the median
        of the stated standard error. The last two are left out where they are not known.
    """
    if isinstance(photos, FlashBrackets):
        photographs, exposures = len(photos.images), photos.images.shape[0] * photos.images.shape[1]
        exposures += photos.room is not None
    else:
        photographs = exposures = len(photos.images)
    metrics = {
        "photographs": float(photographs),
        "exposures": float(exposures),
        "absolute": float(estimate.absolute),
    }
    if estimate.pixel_mm is not None:
        metrics["map_pixel_mm"] = float(estimate.pixel_mm)
    if estimate.standard_error_rad is not None and np.isfinite(estimate.standard_error_rad).any():
        metrics["doubt_median_deg"] = float(np.rad2deg(np.nanmedian(estimate.standard_error_rad)))
    return Metrics(metrics)
