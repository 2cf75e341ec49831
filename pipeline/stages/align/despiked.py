"""A height map without spikes."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np

from pipeline.data.height_fields import HeightField
from pipeline.limits import above_zero, refuse, within
from pipeline.optics.spikes import spikes

LARGEST_RADIUS = 10
NOTICED_PERCENT = 1.0

_log = logging.getLogger(__name__)


def despiked(surface: HeightField, *, radius_px: int = 2, threshold: float = 8.0) -> HeightField:
    """Replace what stands out from all that surrounds it by the local median, and say how much that was.

    Parameters
    ----------
    surface : HeightField
        As it was measured.
    radius_px : int
        Half width of the window of the median, 1 to 10; spikes are smaller than half of the window.
    threshold : float
        By how many standard deviations of the noise a spike stands out, see :func:`pipeline.optics.spikes.spikes`.

    Returns
    -------
    HeightField
        What is not known stays so.

    Raises
    ------
    InputError, InputErrors
        An impossible window or threshold.
    """
    _check_despiked(radius_px=radius_px, threshold=threshold)
    found, local = spikes(surface.height_um, radius_px, threshold)
    count = int(np.count_nonzero(found))
    share = 100 * count / found.size
    tell = _log.warning if share > NOTICED_PERCENT else _log.info
    tell("%d of %d samples (%.2g percent) were spikes and are replaced", count, found.size, share)
    height = np.where(found, local, surface.height_um).astype(surface.height_um.dtype)
    return replace(surface, height_um=height)


def _check_despiked(*, radius_px: int, threshold: float) -> None:
    """Refuse an impossible window before anything runs."""
    refuse(within(1, LARGEST_RADIUS, radius_px=radius_px), above_zero(threshold=threshold))
