"""Estimated orientation against the sample that was drawn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import GratingSample, OrientationError, OrientationMap
from pipeline.errors import InputError
from pipeline.optics.angles import axial_difference, axial_median
from pipeline.optics.sampling import at_pixel_centres

# What maps that are equal within 1e-4 rad may give; versions of NumPy also sum a million pixels in different orders.
_tolerance_orientation = {"error_rad": 1e-4, "offset_rad": 1e-4, "metrics": 1e-3}


def orientation(estimate: OrientationMap, truth: GratingSample, *, keep_offset: bool = False) -> OrientationError:
    """Compare an orientation map with the truth, one global offset removed unless it is to be kept.

    The sample is known on a finer grid than the camera's; the truth of a camera pixel is that at its centre. The offset
    is the axial median of the differences over all pixels where both are known: the turn that makes the mean absolute
    error smallest, which pixels that mix two facets do not move.

    Parameters
    ----------
    estimate : OrientationMap
        Of shape (M, N).
    truth : GratingSample
        Of shape (q M, q N) with an odd whole number q.
    keep_offset : bool
        Remove nothing, for a map that claims to be absolute; the offset is still reported.

    Returns
    -------
    OrientationError
        With the figures ``orientation_error_mean_deg``, ``_std_deg``, ``_median_deg`` and ``_p95_deg`` of the absolute
        error, ``offset_deg`` that was found, ``masked_share_percent`` (share of the truth's diffracting pixels that
        the map lacks), ``falsely_kept_percent`` (share of the map's pixels that do not diffract) and
        ``correlation_mean``, left out where it is not known.

    Raises
    ------
    InputError
        The truth is not an odd whole number of times finer than the estimate, or they share no pixel.
    """
    true_rad = at_pixel_centres(truth.orientation_rad, estimate.mask.shape)
    if true_rad is None:
        raise InputError(
            f"a truth of {truth.orientation_rad.shape} does not lie on a map of {estimate.mask.shape}",
            expected="a truth that is an odd whole number of times finer",
        )
    diffracts = np.isfinite(true_rad)
    known = estimate.mask & np.isfinite(estimate.orientation_rad)
    both = diffracts & known
    if not both.any():
        raise InputError("the map and the truth share no diffracting pixel", expected="a map of the same sample")
    turn = axial_difference(estimate.orientation_rad[both], true_rad[both])
    offset = float(axial_difference(axial_median(turn), 0.0))
    error = turn if keep_offset else axial_difference(turn, offset)
    map_rad = np.full(both.shape, np.nan, np.float32)
    map_rad[both] = error
    metrics = _figures(np.rad2deg(np.abs(error)))
    metrics["offset_deg"] = float(np.rad2deg(offset))
    metrics["masked_share_percent"] = 100 * float(np.sum(diffracts & ~known) / np.sum(diffracts))
    metrics["falsely_kept_percent"] = 100 * float(np.sum(known & ~diffracts) / np.sum(known))
    correlation = estimate.correlation[known]
    if np.isfinite(correlation).any():
        metrics["correlation_mean"] = float(np.nanmean(correlation, dtype=np.float64))
    return OrientationError(map_rad, 0.0 if keep_offset else offset, metrics)


def _figures(absolute_deg: NDArray[np.float64]) -> dict[str, float]:
    return {
        "orientation_error_mean_deg": float(np.mean(absolute_deg)),
        "orientation_error_std_deg": float(np.std(absolute_deg)),
        "orientation_error_median_deg": float(np.median(absolute_deg)),
        "orientation_error_p95_deg": float(np.percentile(absolute_deg, 95)),
    }
