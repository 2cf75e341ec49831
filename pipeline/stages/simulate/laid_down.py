"""A sample laid under the camera by hand: shifted and turned."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np

from pipeline.data.arrays import FloatArray
from pipeline.data.gratings import GratingSample
from pipeline.limits import refuse, within
from pipeline.optics.angles import wrap_axial
from pipeline.optics.rigid import RigidMotion
from pipeline.optics.rigid_sampling import resampled

_log = logging.getLogger(__name__)


def laid_down(sample: GratingSample, *, x_mm: float = 0.0, y_mm: float = 0.0, turn_deg: float = 0.0) -> GratingSample:
    """Turn a sample about its centre and shift it; its gratings and its film turn with it.

    Parameters
    ----------
    sample : GratingSample
        Of shape (M, N).
    x_mm, y_mm : float
        Where its centre then lies, x right and y up.
    turn_deg : float
        Anticlockwise.

    Returns
    -------
    GratingSample
        Of the same shape, each point that of the nearest of the sample; ground comes in from outside. What leaves the
        map is lost, with a warning.

    Raises
    ------
    InputError
        ``turn_deg`` is more than half a turn.
    """
    _check_laid_down(turn_deg=turn_deg)
    turn, shape = np.deg2rad(turn_deg), sample.orientation_rad.shape
    # A point of the new map is where turning back and shifting back leads to in the old one.
    back = RigidMotion(-turn).after(0.0, np.array([y_mm, -x_mm]) / sample.pixel_mm)
    orientation = resampled(sample.orientation_rad, back, shape, order=0)
    period = resampled(sample.period_um, back, shape, order=0)
    known = np.isfinite(orientation)
    orientation = wrap_axial(np.where(known, orientation, 0) + turn).astype(np.float32)
    orientation[orientation >= np.float32(np.pi)] = 0
    orientation[~known] = np.nan
    lost = 1 - int(np.count_nonzero(known)) / (int(np.count_nonzero(sample.diffracts)) or 1)
    if lost > 0.001:
        _log.warning("%.1f percent of the gratings lie outside the map where the sample was laid down.", 100 * lost)
    axis = _laid(sample.film_axis_rad, back)
    return replace(
        sample,
        orientation_rad=orientation,
        period_um=period,
        amplitude_ratio=_laid(sample.amplitude_ratio, back),
        phase_rad=_laid(sample.phase_rad, back),
        retardation_rad=_laid(sample.retardation_rad, back),
        film_axis_rad=float(wrap_axial(axis + turn))
        if isinstance(axis, float)
        else wrap_axial(axis + turn).astype(np.float32),
        veil=_laid(sample.veil, back),
    )


def _laid(values: float | FloatArray, back: RigidMotion) -> float | FloatArray:
    """A property of the sample where it then lies; outside the map what is usual in it."""
    if not isinstance(values, np.ndarray):
        return float(values)
    return resampled(values, back, values.shape, order=0, outside=float(np.median(values)))


def _check_laid_down(*, turn_deg: float, **_: object) -> None:
    """Refuse more than half a turn before anything runs."""
    refuse(within(-180, 180, turn_deg=turn_deg))
