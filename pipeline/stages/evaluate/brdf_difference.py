"""How far one BRDF map is from another of the same surface."""

from __future__ import annotations

import numpy as np

from pipeline.data.diffraction import BrdfMap
from pipeline.data.metrics import Metrics
from pipeline.errors import InputError
from pipeline.optics.colour import LUMINANCE

_tolerance_brdf_difference = {"metrics": 1e-2}


def brdf_difference(estimate: BrdfMap, reference: BrdfMap) -> Metrics:
    """Compare a map with a reference, colour by colour.

    Parameters
    ----------
    estimate, reference : BrdfMap
        Of the same size, under the same lights.

    Returns
    -------
    Metrics
        ``brdf_error_max_percent``, the largest difference of any colour relative to the reference's largest value;
        ``brdf_error_rms_percent``, the root mean square difference relative to that of the reference away from the
        mirror's direction, which would hide the rest, absent where nothing else is lit; and ``brdf_energy_percent``,
        the sum of luminances relative to the reference's.

    Raises
    ------
    InputError
        The maps differ in size or lights, or the reference is dark.
    """
    if estimate.rgb.shape != reference.rgb.shape or not np.allclose(estimate.light, reference.light):
        raise InputError("the maps differ in size or lights", expected="the same light_deg and size_px in both")
    first, second = estimate.rgb.astype(np.float64), reference.rgb.astype(np.float64)
    bright = second @ LUMINANCE
    if not second.any():
        raise InputError("the reference is dark", expected="light in some direction of the disc")
    usual = bright < np.percentile(bright[second.any(axis=-1)], 99.5)
    difference = first - second
    rms, usual_rms = (np.sqrt((part[usual] ** 2).mean()) for part in (difference, second))
    figures = {"brdf_error_max_percent": 100 * float(np.abs(difference).max() / np.abs(second).max())}
    if usual_rms > 0:
        figures["brdf_error_rms_percent"] = 100 * float(rms / usual_rms)
    return Metrics(figures | {"brdf_energy_percent": 100 * float((first @ LUMINANCE).sum() / bright.sum())})
