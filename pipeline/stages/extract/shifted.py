"""A tile that repeats, begun elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.data.height_fields import HeightField
from pipeline.limits import refuse, within

_tolerance_shifted = {"height_um": 1e-12}


def shifted(surface: HeightField, *, right: float = 0.0, up: float = 0.0) -> HeightField:
    """Move a height map, and let what leaves it on one side come in on the other.

    Only of a tile that repeats does that leave the surface as it is; of another it shows what hangs on where the map
    happens to begin.

    Parameters
    ----------
    surface : HeightField
        The map.
    right, up : float
        By which share of its width and height, to the nearest sample.
    """
    _check_shifted(right=right, up=up)
    rows, columns = surface.height_um.shape
    by = -round(up * rows), round(right * columns)
    return replace(surface, height_um=np.roll(surface.height_um, by, axis=(0, 1)))


def _check_shifted(*, right: float, up: float) -> None:
    """Refuse more than a whole tile before anything runs."""
    refuse(within(-1, 1, right=right), within(-1, 1, up=up))
