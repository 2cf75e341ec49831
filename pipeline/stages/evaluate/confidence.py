"""Whether an orientation map knows where it is wrong."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import GratingSample, OrientationMap
from pipeline.data.metrics import Metrics
from pipeline.errors import InputError
from pipeline.limits import above_zero, refuse
from pipeline.optics.angles import axial_difference, axial_median
from pipeline.optics.sampling import at_pixel_centres

_tolerance_confidence = {"metrics": 0.1}


def confidence(
    estimate: OrientationMap, truth: GratingSample, *, bad_deg: float = 1.0, doubt_deg: float = 0.5
) -> Metrics:
    """Compare what a map says of its own pixels with how wrong they are.

    A pixel doubts itself where its standard error exceeds ``doubt_deg``. A map without standard errors is judged by its
    correlation ``c``, as the angle by which the part that is not explained could turn a cosine: ``arccos(c) / 2``.
    A map that is not absolute is compared with one offset removed.

    Parameters
    ----------
    estimate : OrientationMap
        Of shape (M, N).
    truth : GratingSample
        Of shape (q M, q N) with an odd whole number q.
    bad_deg : float
        Error beyond which a pixel is bad.
    doubt_deg : float
        Stated error beyond which a pixel counts as flagged.

    Returns
    -------
    Metrics
        ``error_mean_deg``, ``bad_percent`` of the pixels, ``bad_flagged_percent`` of the bad ones (left out if there
        are none), ``good_flagged_percent`` of the good ones, and ``calibration``: median error over what the median of
        the stated one is for a normal error; left out where nothing is stated.

    Raises
    ------
    InputError
        The truth does not fit the map, they share no pixel, or a limit is not above 0.
    """
    _check_confidence(bad_deg=bad_deg, doubt_deg=doubt_deg)
    true_rad = at_pixel_centres(truth.orientation_rad, estimate.mask.shape)
    if true_rad is None:
        raise InputError(
            f"a truth of {truth.orientation_rad.shape} does not lie on a map of {estimate.mask.shape}",
            expected="a truth that is an odd whole number of times finer",
        )
    both = np.isfinite(true_rad) & estimate.mask & np.isfinite(estimate.orientation_rad)
    if not both.any():
        raise InputError("the map and the truth share no diffracting pixel", expected="a map of the same sample")
    turn = axial_difference(estimate.orientation_rad[both], true_rad[both])
    if not estimate.absolute:
        turn = axial_difference(turn, axial_median(turn))
    error, doubt = np.rad2deg(np.abs(turn)), np.rad2deg(_doubt(estimate)[both])
    bad, flagged = error > bad_deg, ~(doubt <= doubt_deg)
    metrics = {"error_mean_deg": float(error.mean()), "bad_percent": 100 * float(bad.mean())}
    if bad.any():
        metrics["bad_flagged_percent"] = 100 * float(flagged[bad].mean())
    if not bad.all():
        metrics["good_flagged_percent"] = 100 * float(flagged[~bad].mean())
    if estimate.standard_error_rad is not None:
        metrics["calibration"] = float(np.median(error) / (0.6745 * np.median(doubt)))
    return Metrics(metrics)


def _check_confidence(*, bad_deg: float, doubt_deg: float, **_: object) -> None:
    """Refuse limits that are none before anything runs."""
    refuse(above_zero(bad_deg=bad_deg, doubt_deg=doubt_deg))


def _doubt(estimate: OrientationMap) -> NDArray[np.floating]:
    if estimate.standard_error_rad is not None:
        return estimate.standard_error_rad
    return np.arccos(np.clip(estimate.correlation, -1, 1)) / 2
