"""How well any estimator could know the orientations of a sample from such photographs."""

from __future__ import annotations

import numpy as np

from pipeline.data.gratings import GratingSample
from pipeline.data.metrics import Metrics
from pipeline.data.photographs import PolarizerSequence
from pipeline.errors import InputError
from pipeline.limits import above_zero, refuse
from pipeline.optics.response_curve import FilmedGrating, orientation_bound, response_curve
from pipeline.optics.sampling import at_pixel_centres

_tolerance_bound = {"metrics": 1e-3}


def bound(photos: PolarizerSequence, truth: GratingSample, *, electrons: float) -> Metrics:
    """Cramer-Rao bound of the photon noise, for a pixel whose brightness and orientation are unknown.

    Everything else is taken as known: film and zeroth order, and where the photographs lie.

    Parameters
    ----------
    photos : PolarizerSequence
        Of shape (K, M, N); only their angles count.
    truth : GratingSample
        Of shape (q M, q N) with an odd whole number q, under one film and of one kind of grating.
    electrons : float
        From the longest period's grating through an open polariser, as the simulated camera has them.

    Returns
    -------
    Metrics
        ``bound_mean_deg``: mean absolute error of normal errors with the bound's standard deviation, averaged over the
        diffracting pixels.

    Raises
    ------
    InputError
        The truth does not fit the photographs or varies over the sample, or ``electrons`` is not above 0.

    References
    ----------
    Kay, Fundamentals of Statistical Signal Processing: Estimation Theory (1993), section 3.9.
    """
    _check_bound(electrons=electrons)
    common = (truth.amplitude_ratio, truth.phase_rad, truth.retardation_rad, truth.film_axis_rad)
    if any(np.ndim(value) for value in common):
        raise InputError("the sample's film or zeroth order varies over it", expected="one film, one kind of grating")
    orientation = at_pixel_centres(truth.orientation_rad, photos.valid.shape)
    period = at_pixel_centres(truth.period_um, photos.valid.shape)
    if orientation is None or period is None:
        raise InputError(
            f"a truth of {truth.orientation_rad.shape} does not lie on photographs of {photos.valid.shape}",
            expected="a truth that is an odd whole number of times finer",
        )
    diffracts = np.isfinite(orientation)
    efficiency = (period[diffracts] / np.nanmax(truth.period_um)) ** 2
    curve = response_curve(FilmedGrating(*(float(value) for value in common)))
    of_one = orientation_bound(curve, photos.polarizer_rad, electrons * curve.brightness)
    here = np.interp(orientation[diffracts], curve.orientation_rad, of_one, period=np.pi)
    mean = float(np.mean(here / np.sqrt(efficiency))) * np.sqrt(2 / np.pi)
    return Metrics({"bound_mean_deg": float(np.rad2deg(mean))})


def _check_bound(*, electrons: float, **_: object) -> None:
    """Refuse photographs without light before anything runs."""
    refuse(above_zero(electrons=electrons))
