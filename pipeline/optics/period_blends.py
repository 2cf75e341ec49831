"""Grating periods that follow the orientation, so that a pattern of one period comes apart into colours."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64Array = NDArray[np.float64]
Blend = Literal["quadratic", "squared sine", "closed squared sine"]


def blended_periods(
    orientation_rad: ArrayLike, shortest_um: float, longest_um: float, blend: Blend, bins: int
) -> Float64Array:
    """Periods between two ends by the bin in which an orientation lies.

    Bins are as wide as 180 degrees over their number and centred on 0 and its multiples, so that orientations of whole
    degrees lie in the middle of 180 bins. With the bin's number over that of the last, ``t`` from 0 to 1, the period is
    ``shortest + (longest - shortest) f(t)``, where f is

    - ``t^2`` for ``quadratic``: 0 at 0 degrees, 1 in the last bin, and a jump back where 180 degrees close;
    - ``sin^2(pi t / 2)`` for ``squared sine``: between the same ends, level at both, and the same jump;
    - ``sin^2(pi t)`` for ``closed squared sine``: 0 in the first and last bin, 1 at 90 degrees, and no jump.

    Parameters
    ----------
    orientation_rad : array_like
        Axial angles; NaN stays NaN.
    shortest_um, longest_um : float
        Periods where f is 0 and 1.
    blend : str
        As above.
    bins : int
        2 or more.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018), section
    6.4.
    """
    t = np.arange(bins) / (bins - 1)
    if blend == "quadratic":
        share = t**2
    elif blend == "squared sine":
        share = np.sin(np.pi / 2 * t) ** 2
    else:
        share = np.sin(np.pi * t) ** 2
    period = shortest_um + (longest_um - shortest_um) * share
    turns = np.asarray(orientation_rad, np.float64) / np.pi
    known = np.isfinite(turns)
    number = np.rint(np.where(known, turns, 0) * bins).astype(np.intp) % bins
    return np.where(known, period[number], np.nan)
