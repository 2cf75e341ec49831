"""Two height maps of one surface compared."""

from __future__ import annotations

import numpy as np

from pipeline.data.height_fields import HeightField
from pipeline.data.metrics import Metrics
from pipeline.errors import InputError

_tolerance_height_difference = {"metrics": 1e-3}


def height_difference(estimate: HeightField, reference: HeightField) -> Metrics:
    """Measure by how much two maps differ, whatever the zero of either.

    Parameters
    ----------
    estimate, reference : HeightField
        Of one shape and pitch.

    Returns
    -------
    Metrics
        ``height_difference_rms_um``, of the estimate less the reference without its mean, and
        ``height_difference_percent``, that over the root mean square height of the reference.

    Raises
    ------
    InputError
        The maps are of different shapes or pitches, or share no known height.
    """
    if estimate.height_um.shape != reference.height_um.shape:
        what = f"maps of {estimate.height_um.shape} and {reference.height_um.shape} samples"
        raise InputError(what, expected="two maps of the same surface and shape")
    if not np.isclose(estimate.pitch_um, reference.pitch_um, rtol=1e-6, atol=0):
        what = f"maps of {estimate.pitch_um:g} and {reference.pitch_um:g} um pitch"
        raise InputError(what, expected="two maps of the same pitch")
    both = np.isfinite(estimate.height_um) & np.isfinite(reference.height_um)
    if not both.any():
        raise InputError("the maps share no known height", expected="two maps of the same surface")
    truth = reference.height_um[both].astype(np.float64)
    rms = float(np.std(estimate.height_um[both] - truth))
    figures = {"height_difference_rms_um": rms}
    if truth.std() > 0:
        figures["height_difference_percent"] = 100 * rms / float(truth.std())
    return Metrics(figures)
