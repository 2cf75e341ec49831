"""Brackets of exposures merged into one linear photograph each."""

from __future__ import annotations

import logging
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.data.flash import FlashBrackets, FlashPhotographs
from pipeline.errors import InputError
from pipeline.limits import above_zero, refuse
from pipeline.optics.hdr import full_scale, merged, response_curve, unsaturated, weighted_mean

_log = logging.getLogger(__name__)

_NOTICED_PERCENT = 0.5
_tolerance_radiance = {"radiance": 1e-3, "response": 1e-2}


def radiance(
    brackets: FlashBrackets,
    *,
    method: Literal["auto", "debevec", "weighted"] = "auto",
    smoothness: float = 10.0,
) -> FlashPhotographs:
    """Merge each bracket of exposures into radiance.

    Parameters
    ----------
    brackets : FlashBrackets
        Photographs as the camera stores them.
    method : {"auto", "debevec", "weighted"}
        By the camera's response curve, found from all brackets together; or the mean of level over time, levels that
        are not linear being taken for sRGB. ``auto`` looks for a curve where there is one.
    smoothness : float
        Weight of the curve's second differences.

    Returns
    -------
    FlashPhotographs
        Not rectified yet; 1 fills the sensor in the shortest exposure.

    Raises
    ------
    InputError
        A response curve is asked for of a single exposure, or of photographs of 16 bits; or none is told.

    Notes
    -----
    Debevec and Malik 1997, by OpenCV; Toisoul, Dhillon and Ghosh 2018, section 4.1.
    """
    _check_radiance(smoothness=smoothness)
    images, times = brackets.images, np.asarray(brackets.exposure_s, np.float64)
    usable = len(times) > 1 and images.dtype == np.uint8
    if method == "debevec" and not usable:
        raise InputError(
            f"no response curve can be found from {len(times)} exposures of {8 * images.dtype.itemsize} bits",
            where="method",
            expected="two exposures of 8 bits or more, or method: weighted",
        )
    by_curve = method == "debevec" or (method == "auto" and usable and not brackets.linear)
    if method == "auto" and not by_curve and not brackets.linear:
        _log.warning("a single exposure does not tell the camera's response curve: its levels are taken for sRGB")
    curve = response_curve(images, times, smoothness) if by_curve else None
    if curve is not None and not (curve[-1] > curve[0]).all():
        raise InputError(
            "the brackets tell no response curve of the camera",
            where="method",
            expected="photographs that are brighter the longer the exposure, or method: weighted",
        )
    pictures = np.stack([_merged(bracket, times, curve, brackets.linear) for bracket in images])
    pictures *= np.float32(times.min() / (1.0 if curve is None else full_scale(curve)))
    valid = np.stack([unsaturated(bracket, times) for bracket in images])
    lost = 100 * (1 - float(valid.mean()))
    tell = _log.warning if lost > _NOTICED_PERCENT else _log.info
    tell("%.2g percent of the pixels are saturated even in the shortest exposure, %g s", lost, times.min())
    return FlashPhotographs(
        radiance=pictures,
        valid=valid,
        light_mm=brackets.light_mm,
        camera_mm=brackets.camera_mm,
        wavelength_nm=brackets.wavelength_nm,
        bandwidth_nm=brackets.bandwidth_nm,
        light_sigma_mm=brackets.light_sigma_mm,
        room=None if brackets.room is None else _room(brackets.room, curve, brackets.linear),
        sheet_mm=brackets.sheet_mm,
        corners_px=brackets.corners_px,
        response=curve,
        metrics={"saturated_percent": lost},
    )


def _check_radiance(*, smoothness: float, **_: object) -> None:
    """Refuse an impossible weight before anything runs."""
    refuse(above_zero(smoothness=smoothness))


def _merged(
    bracket: NDArray[np.unsignedinteger],
    exposure_s: NDArray[np.float64],
    curve: NDArray[np.float64] | None,
    linear: bool,
) -> NDArray[np.float32]:
    if curve is None:
        return weighted_mean(bracket, exposure_s, linear=linear)
    return merged(bracket, exposure_s, curve)


def _room(levels: NDArray[np.unsignedinteger], curve: NDArray[np.float64] | None, linear: bool) -> NDArray[np.float32]:
    """The photograph under room light, linear; 1 is full scale."""
    if curve is None or levels.dtype != np.uint8:
        return weighted_mean(levels[None], np.ones(1), linear=linear)
    shade = (curve / full_scale(curve)).astype(np.float32)
    return np.stack([shade[levels[..., channel], channel] for channel in range(3)], axis=-1)
