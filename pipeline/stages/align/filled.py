"""A height map without gaps."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np

from pipeline.data.height_fields import HeightField
from pipeline.optics.gaps import membrane

NOTICED_PERCENT = 1.0

_log = logging.getLogger(__name__)


def filled(surface: HeightField) -> HeightField:
    """Fill what is not known as a stretched membrane would, and say how much that was.

    What computes with light needs every height. A gap that is filled is smooth, and diffracts like a smooth patch.

    Parameters
    ----------
    surface : HeightField
        NaN where nothing was measured.

    Returns
    -------
    HeightField
        Measured heights as they were, the others by Laplace's equation, see :func:`pipeline.optics.gaps.membrane`.
    """
    unknown = ~np.isfinite(surface.height_um)
    count = int(np.count_nonzero(unknown))
    share = 100 * count / unknown.size
    tell = _log.warning if share > NOTICED_PERCENT else _log.info
    tell("%d of %d samples (%.2g percent) were not known and are filled", count, unknown.size, share)
    height = membrane(surface.height_um, periodic=surface.periodic)
    return replace(surface, height_um=np.where(unknown, height, surface.height_um).astype(surface.height_um.dtype))
