"""A sheet photographed under a flash that is put in one place after another."""

from __future__ import annotations

import logging
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pipeline.data.flash import FlashBrackets
from pipeline.data.gratings import GratingSample
from pipeline.data.photographs import Photo
from pipeline.devices.protocols import FlashRig
from pipeline.errors import DeviceError
from pipeline.progress import advance
from pipeline.steps import step

_SATURATION_WARNING = 1e-3

_log = logging.getLogger(__name__)

# Libraries round the simulated light differently in its last bits, which moves few pixels by one level.
_tolerance_flash_photographs = {"images": 1.0, "room": 1.0}


def flash_photographs(sample: GratingSample | None = None, *, rig: FlashRig) -> FlashBrackets:
    """Photograph a sheet under a flash in several places, a bracket of exposures each, and once under room light.

    Parameters
    ----------
    sample : GratingSample, optional
        Virtual sample to lay before a simulated rig; a real rig photographs what lies there, a replay what lay there.
    rig : FlashRig
        Camera and flash.

    Returns
    -------
    FlashBrackets
        Images of shape (places, exposures, M, N, 3), as the camera stores them, and exposures as it says them to be.

    Raises
    ------
    DeviceError
        A device failed; the photographs that it took are kept.

    Notes
    -----
    Toisoul, Dhillon and Ghosh 2018, section 4.1.
    """
    rig.place(sample)
    places = len(rig.light.light_mm)
    exposures = sorted(rig.camera.exposure_s)
    plan: list[tuple[int | None, float | None]] = [(place, time) for place in range(places) for time in exposures]
    plan += [(None, None)] if rig.has_room else []
    stored, taken, metadata = [], [], {}
    with rig:
        for done, (place, time) in enumerate(plan):
            photo = step(done, partial(_take, rig, place, time))
            stored.append(_levels(photo, rig.bits))
            taken.append(photo.exposure_s if photo.exposure_s is not None else time)
            metadata = dict(photo.metadata)
            advance(done + 1, len(plan))
    if len({image.shape for image in stored}) > 1:
        raise DeviceError("the camera changed the size of its photographs")
    room = stored.pop() if rig.has_room else None
    images = np.stack(stored).reshape(places, len(exposures), *stored[0].shape)
    _warn_of_saturation(images[:, 0])
    return FlashBrackets(
        images=images,
        exposure_s=np.asarray(taken[: len(exposures)], np.float64),
        linear=rig.linear,
        room=room,
        light_mm=np.asarray(rig.light.light_mm, np.float64),
        camera_mm=np.asarray(rig.camera_mm, np.float64),
        sheet_mm=rig.sheet_mm,
        corners_px=None if rig.corners_px is None else np.asarray(rig.corners_px, np.float64),
        wavelength_nm=rig.wavelength_nm,
        bandwidth_nm=rig.bandwidth_nm,
        light_sigma_mm=rig.light_sigma_mm,
        metadata=metadata,
    )


def _check_flash_photographs(*, rig: FlashRig) -> None:
    """The rig checks itself."""


def _take(rig: FlashRig, place: int | None, exposure_s: float | None) -> Photo:
    rig.light.put(place)
    return rig.camera.expose_for(exposure_s)


def _levels(photo: Photo, bits: int) -> NDArray[np.unsignedinteger]:
    """Whole numbers as the camera stored them; grey photographs get three equal channels."""
    image = photo.image if photo.image.ndim == 3 else np.repeat(photo.image[..., None], 3, axis=2)
    kind = np.uint8 if bits == 8 else np.uint16
    scaled = image * np.float32(np.iinfo(kind).max)
    return np.asarray(np.rint(np.clip(scaled, 0, np.iinfo(kind).max)), kind)


def _warn_of_saturation(shortest: NDArray[np.unsignedinteger]) -> None:
    share = float(np.mean(shortest.max(axis=-1) == np.iinfo(shortest.dtype).max))
    if share > _SATURATION_WARNING:
        _log.warning("%.2g percent of the pixels are saturated even in the shortest exposure", 100 * share)
