"""Photographs of one sample through a polariser that turns from photo to photo."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.data.arrays import FloatArray
from pipeline.data.gratings import GratingSample
from pipeline.data.photographs import PolarizerPhoto, PolarizerSequence
from pipeline.devices.protocols import PolarizationRig
from pipeline.errors import InputError
from pipeline.limits import at_least, refuse
from pipeline.progress import advance
from pipeline.steps import step

LEAST_ANGLES = 3
MOST_PHOTOGRAPHS = 1000
_SAME_EXPOSURE = 1e-3
_WORST_CONDITION = 1e6
SATURATION_WARNING = 0.001

log = logging.getLogger(__name__)

# Libraries round the simulated light differently in its last bits, which moves few pixels by a step of 14 bits.
_tolerance_polarizer_sequence = {"images": 6.2e-5}


def polarizer_sequence(
    sample: GratingSample | None = None,
    *,
    rig: PolarizationRig,
    count: int = 12,
    span_deg: float = 180.0,
    step_deg: float | None = None,
) -> PolarizerSequence:
    """Photograph a sample at equal steps of the polariser.

    Parameters
    ----------
    sample : GratingSample, optional
        Virtual sample to put before a simulated rig; a real rig photographs what lies there, a replay what lay there.
    rig : PolarizationRig
        Camera, polariser mount and light.
    count : int
        Photographs; a mount with fixed stops, such as a replay, takes each of its stops instead.
    span_deg : float
        Angle that the steps divide, its end excluded; 180 degrees bring the polariser back to where it was.
    step_deg : float, optional
        The step itself, whatever ``count`` and ``span_deg`` say of it: 13 photographs at 15 degrees begin and end at
        the same angle.

    Returns
    -------
    PolarizerSequence
        Images of shape (count, M, N), full scale 1; ``valid`` leaves out what is saturated or no number in any photo.

    Raises
    ------
    InputError
        Fewer than three distinct angles: brightness, modulation and phase are three unknowns.
    DeviceError
        A device failed; motion is stopped and the light is off.

    Notes
    -----
    Toisoul, Dhillon and Ghosh 2018, section 5.1 and 5.3: 12 or 13 photographs over 180 degrees, at least four.
    """
    angles = _stops(rig, count, span_deg, step_deg)
    images, reached, exposures, saturated, metadata = [], [], [], [], {}
    rig.place(sample)
    with rig:
        rig.light.switch(True)
        try:
            for done, angle in enumerate(angles):
                taken = step(done, partial(_take, rig, float(angle)))
                photo = taken.photo
                reached.append(taken.polarizer_rad)
                images.append(photo.image)
                saturated.append(photo.saturated)
                exposures.append(photo.exposure_s)
                metadata = dict(photo.metadata)
                advance(done + 1, len(angles))
        finally:
            rig.light.switch(False)
    stack = _of_one_exposure(np.stack(images).astype(np.float32, copy=False), exposures)
    burnt = np.logical_or.reduce(saturated)
    warns_itself = hasattr(rig, "saturation_warning")
    if burnt.mean() > SATURATION_WARNING and not warns_itself:
        log.warning("%.2f percent of the pixels are saturated in some photo and left out", 100 * burnt.mean())
    valid = ~burnt & np.isfinite(stack).all(axis=0)
    mask = getattr(rig, "mask", None)
    if mask is not None:
        valid &= mask
    return PolarizerSequence(
        images=stack,
        polarizer_rad=np.asarray(reached, dtype=np.float64),
        valid=valid,
        pixel_mm=rig.pixel_mm,
        wavelength_nm=rig.wavelength_nm,
        exposure_s=None if None in exposures or exposures[0] is None else (exposures[0],) * len(exposures),
        metadata=metadata,
    )


def _of_one_exposure(stack: FloatArray, exposures: list[float | None]) -> FloatArray:
    """Photographs as if all had been exposed as long as the first, where their exposures are known and differ."""
    if None in exposures:
        return stack
    times = np.array(exposures, np.float64)
    if np.ptp(times) <= _SAME_EXPOSURE * times.max():
        return stack
    log.warning(
        "The exposures differ, %g to %g s; the photographs are scaled to the first's %g s.",
        times.min(),
        times.max(),
        times[0],
    )
    return stack * (times[0] / times).astype(np.float32)[:, None, None]


def _take(rig: PolarizationRig, angle_rad: float) -> PolarizerPhoto:
    reached = rig.mount.move_to(angle_rad)
    return PolarizerPhoto(rig.camera.expose(), reached)


def _check_polarizer_sequence(
    *,
    rig: PolarizationRig,
    count: int,
    span_deg: float,
    step_deg: float | None = None,
    sample: Mapping[str, Any] | None = None,
) -> None:
    """Refuse what could not be fitted, and a sample that does not fit a simulated rig, before anything runs."""
    if sample and "pixel_mm" in sample and hasattr(rig, "check_pitch"):
        try:
            rig.check_pitch(sample["pixel_mm"])
        except InputError as error:
            raise InputError(error.what, where=f"sample.pixel_mm, rig.{error.where}", expected=error.expected) from None
    if rig.mount.stops_rad is None:
        refuse(at_least(LEAST_ANGLES, "as many as there are unknowns", count=count))
    _stops(rig, count, span_deg, step_deg)


def _stops(rig: PolarizationRig, count: int, span_deg: float, step_deg: float | None) -> NDArray[np.float64]:
    """Angles to go to."""
    if count > MOST_PHOTOGRAPHS:
        raise InputError(f"count is {count}", where="count", expected=f"at most {MOST_PHOTOGRAPHS} photographs")
    fixed = rig.mount.stops_rad
    spread = "span_deg" if step_deg is None else "step_deg"
    step_rad = np.deg2rad(span_deg) / max(count, 1) if step_deg is None else np.deg2rad(step_deg)
    stops = step_rad * np.arange(count) if fixed is None else np.asarray(fixed, np.float64)
    distinct = len(np.unique(np.round(np.exp(2j * stops), 9)))
    if distinct < LEAST_ANGLES:
        raise InputError(
            f"{len(stops)} photographs at {distinct} distinct angles of the polariser",
            where=f"count, {spread}" if fixed is None else "",
            expected=f"at least {LEAST_ANGLES} angles that differ modulo 180 degrees",
        )
    design = np.stack([np.ones(len(stops)), np.cos(2 * stops), np.sin(2 * stops)], axis=1)
    if np.linalg.cond(design) > _WORST_CONDITION:
        raise InputError(
            f"the angles of the polariser lie within {np.rad2deg(np.ptp(stops)):.2g} degrees",
            where=spread if fixed is None else "",
            expected="angles spread over a good part of 180 degrees",
        )
    return stops
