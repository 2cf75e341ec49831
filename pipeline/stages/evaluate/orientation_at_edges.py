"""How much worse orientations are where gratings meet than inside them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from pipeline.data.gratings import GratingSample, OrientationError
from pipeline.data.metrics import Metrics
from pipeline.errors import InputError
from pipeline.limits import above_zero, refuse
from pipeline.optics.angles import axial_difference
from pipeline.optics.sampling import at_pixel_centres

_tolerance_orientation_at_edges = {"metrics": 1e-3}


def orientation_at_edges(
    error: OrientationError, truth: GratingSample, *, edge_mm: float = 0.6, turn_deg: float = 5.0
) -> Metrics:
    """Tell the errors within ``edge_mm`` of an edge of the drawing from those further inside.

    An edge is where neighbouring pixels of the drawing differ by more than ``turn_deg``, or only one diffracts.

    Parameters
    ----------
    error : OrientationError
        Of shape (M, N).
    truth : GratingSample
        With which the map was compared, of shape (q M, q N).
    edge_mm : float
        Up to which distance from an edge's pixels a pixel lies at it.
    turn_deg : float
        More than orientations turn from pixel to pixel inside a grating.

    Returns
    -------
    Metrics
        ``edge_error_mean_deg`` and ``_median_deg`` of the absolute errors at edges, ``inner_error_mean_deg`` and
        ``_median_deg`` of the others, and ``edge_share_percent``: how many of the pixels lie at edges.

    Raises
    ------
    InputError
        The truth does not fit, or all pixels or none lie at edges.

    Notes
    -----
    Toisoul, Dhillon and Ghosh 2018, section 7.2: tiles that lie beside each other err most at the polygons' edges.
    """
    _check_orientation_at_edges(edge_mm=edge_mm, turn_deg=turn_deg)
    true_rad = at_pixel_centres(truth.orientation_rad, error.error_rad.shape)
    if true_rad is None:
        raise InputError(
            f"a truth of {truth.orientation_rad.shape} does not lie on errors of {error.error_rad.shape}",
            expected="the truth from which they were worked out",
        )
    pixel_mm = truth.pixel_mm * truth.orientation_rad.shape[0] / true_rad.shape[0]
    edge = _edges(true_rad, np.deg2rad(turn_deg))
    beside = edge.any() & (distance_transform_edt(~edge) * pixel_mm <= edge_mm)
    absolute = np.rad2deg(np.abs(error.error_rad.astype(np.float64)))
    known = np.isfinite(absolute)
    at_edge, inside = absolute[known & beside], absolute[known & ~beside]
    if not (at_edge.size and inside.size):
        raise InputError(
            f"{at_edge.size} pixels lie at edges and {inside.size} inside",
            where="edge_mm",
            expected="a drawing of gratings that are larger than twice as much",
        )
    return Metrics(
        {
            "edge_error_mean_deg": float(at_edge.mean()),
            "edge_error_median_deg": float(np.median(at_edge)),
            "inner_error_mean_deg": float(inside.mean()),
            "inner_error_median_deg": float(np.median(inside)),
            "edge_share_percent": 100 * at_edge.size / (at_edge.size + inside.size),
        }
    )


def _edges(tangent: NDArray[np.floating], turn_rad: float) -> NDArray[np.bool_]:
    """Both pixels at each side of an edge."""
    edge = np.zeros(tangent.shape, bool)
    for turned, marked in ((tangent, edge), (tangent.T, edge.T)):
        one, other = turned[:-1], turned[1:]
        differ = np.abs(axial_difference(np.nan_to_num(one), np.nan_to_num(other))) > turn_rad
        differ = np.where(np.isfinite(one) & np.isfinite(other), differ, np.isfinite(one) != np.isfinite(other))
        marked[:-1] |= differ
        marked[1:] |= differ
    return edge


def _check_orientation_at_edges(*, edge_mm: float, turn_deg: float, **_: object) -> None:
    """Refuse impossible distances and turns before anything runs."""
    refuse(above_zero(edge_mm=edge_mm, turn_deg=turn_deg))
