"""Row maxima of a simulated map against the straight line that the paper reads orientations from."""

from __future__ import annotations

import numpy as np

from pipeline.data.arrays import FloatArray
from pipeline.data.polarization import LineDeviation, PolarizerResponse
from pipeline.errors import InputError
from pipeline.optics.row_maxima import deviation_from_branches, deviation_from_line, winding
from pipeline.optics.row_maxima import row_maxima as maxima_of

_tolerance_row_maxima = {"deviation_rad": 1e-6, "prenormalized_rad": 1e-6, "metrics": 1e-4}


def row_maxima(response: PolarizerResponse, prenormalized: PolarizerResponse | None = None) -> LineDeviation:
    """Measure how far row maxima lie from ``psi = theta + offset``, the offset being the best one.

    Parameters
    ----------
    response : PolarizerResponse
        The map.
    prenormalized : PolarizerResponse, optional
        The same after pre-normalisation.

    Returns
    -------
    LineDeviation
        With the figures ``deviation_mean_deg`` and ``deviation_max_deg`` of the absolute deviation,
        ``branch_deviation_mean_deg`` of that from the nearer of two lines a right angle apart, ``offset_deg``, and
        ``winding`` (half turns of the row maxima in one of the grating: 1 on the line; left out where they leap), all
        of them also led by ``prenormalized_``; ``amplitude_min`` (of the weakest row's cosine; 1 is the mean of a
        grating with R = 1) and ``cosine_error_rms`` (what a cosine leaves of ``I_norm``). Figures of a map with flat
        rows are left out.

    Raises
    ------
    InputError
        The two maps are not over the same orientations.
    """
    if prenormalized is not None and not np.array_equal(response.orientation_rad, prenormalized.orientation_rad):
        raise InputError("the maps are over different orientations", expected="a map and its pre-normalised form")
    deviation, figures = _against_line(response)
    own, after = np.full_like(deviation, np.nan), dict[str, float]()
    if prenormalized is not None:
        own, after = _against_line(prenormalized)
    metrics: dict[str, float] = {}
    for name in {**figures, **after}:
        metrics |= {name: figures[name]} if name in figures else {}
        metrics |= {f"prenormalized_{name}": after[name]} if name in after else {}
    return LineDeviation(response.orientation_rad, deviation, own, metrics | _of_the_rows(response))


def _against_line(response: PolarizerResponse) -> tuple[FloatArray, dict[str, float]]:
    deviation, offset = deviation_from_line(response.row_maximum_rad, response.orientation_rad)
    absolute = np.rad2deg(np.abs(deviation))
    if np.isnan(absolute).any():
        return deviation, {}
    branches = np.rad2deg(np.abs(deviation_from_branches(response.row_maximum_rad, response.orientation_rad)))
    figures = {
        "deviation_mean_deg": float(absolute.mean()),
        "deviation_max_deg": float(absolute.max()),
        "branch_deviation_mean_deg": float(branches.mean()),
        "offset_deg": float(np.rad2deg(offset)),
    }
    turns = winding(response.row_maximum_rad)
    return deviation, figures if np.isnan(turns) else {**figures, "winding": turns}


def _of_the_rows(response: PolarizerResponse) -> dict[str, float]:
    """How strong the rows are, and how well cosines go through them."""
    rows = maxima_of(response.intensity, response.polarizer_rad)
    figures = {"amplitude_min": float(rows.amplitude.min())}
    if np.isfinite(rows.residual).all():
        figures["cosine_error_rms"] = float(np.sqrt(np.mean(rows.residual**2)))
    return figures
