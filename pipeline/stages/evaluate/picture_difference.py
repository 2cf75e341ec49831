"""How far pictures are from others of the same scene."""

from __future__ import annotations

import numpy as np

from pipeline.data.metrics import Metrics
from pipeline.data.pictures import Pictures, PictureSeries
from pipeline.errors import InputError
from pipeline.limits import above_zero_up_to, refuse
from pipeline.optics.colour import encode_srgb

_tolerance_picture_difference = {"metrics": 1e-2}


def picture_difference(
    estimate: Pictures | PictureSeries, reference: Pictures | PictureSeries, *, white_percentile: float = 98.0
) -> Metrics:
    """Compare pictures with references where these are not black.

    Parameters
    ----------
    estimate, reference : Pictures or PictureSeries
        As many, of the same size.
    white_percentile : float
        Percentile of the references' brightest colours that is shown as white.

    Returns
    -------
    Metrics
        ``picture_error_max_percent``, the largest difference of any colour relative to the references' largest value;
        ``picture_error_rms_percent``, the root mean square difference of the pictures encoded for a display, of full
        scale; ``picture_light_percent``, the sum of all light relative to the references'; ``picture_correlation`` of
        the encoded pictures, left out where one is even.

    Raises
    ------
    InputError
        The pictures differ in number or size, or the references are black.
    """
    _check_picture_difference(white_percentile=white_percentile)
    if estimate.rgb.shape != reference.rgb.shape:
        raise InputError("the pictures differ in number or size", expected="the same settings for both")
    first, second = estimate.rgb.astype(np.float64), reference.rgb.astype(np.float64)
    lit = second.any(axis=-1)
    if not lit.any():
        raise InputError("the reference is black", expected="light on some pixel")
    white = np.percentile(second.max(axis=-1)[lit], white_percentile)
    encoded = [encode_srgb(part[lit] / white).astype(np.float64).ravel() for part in (first, second)]
    metrics = {
        "picture_error_max_percent": 100 * float(np.abs(first - second).max() / second.max()),
        "picture_error_rms_percent": 100 * float(np.sqrt(((encoded[0] - encoded[1]) ** 2).mean())),
        "picture_light_percent": 100 * float(first.sum() / second.sum()),
    }
    if min(np.ptp(part) for part in encoded) > 0:
        metrics["picture_correlation"] = float(np.corrcoef(encoded[0], encoded[1])[0, 1])
    return Metrics(metrics)


def _check_picture_difference(*, white_percentile: float) -> None:
    """Refuse what is no percentile before anything runs."""
    refuse(above_zero_up_to(100, white_percentile=white_percentile))
