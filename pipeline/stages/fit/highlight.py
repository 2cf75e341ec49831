"""Where each flash photograph shows the flash itself, and how large."""

from __future__ import annotations

import logging

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.data.flash import FlashPhotographs
from pipeline.data.flash_maps import Highlights
from pipeline.errors import InputError
from pipeline.limits import above_zero, refuse
from pipeline.optics.flash.highlight import bright_spot
from pipeline.optics.flash.lobes import half_vectors, light_sigma, mirror_point

_log = logging.getLogger(__name__)

_tolerance_highlight = {"place_mm": 1e-2, "sigma_mm": 1e-2, "light_sigma_mm": 1e-2, "metrics": 1e-2}

_SHOWN_PX = 640
_WHITE_UM = 0.55
_NEIGHBOURHOOD_MM = 1.0
"""Radius around the middle of a highlight in which pixels without a right exposure count."""


def highlight(
    photos: FlashPhotographs,
    *,
    pattern_mm: float = 1.5,
    tolerance_mm: float = 1.5,
    coherence_um: float = 65.0,
) -> Highlights:
    """Find the mirror image of the flash in each photograph, from the photograph alone.

    The brightest spot is measured as a Gaussian, the sheet's pattern averaged out. Its size tells the flash's extent:
    in half vectors, the highlight is as wide as the flash is seen from the sheet, and the coherence window. There is a
    warning where the spot was too bright for every exposure, lies on the edge of the picture, or away from where the
    stated places of flash and camera put it. One on the edge, or stated to lie outside, is given back as NaN.

    Parameters
    ----------
    photos : FlashPhotographs
        Rectified.
    pattern_mm : float
        Standard deviation of the Gaussian that averages the pattern.
    tolerance_mm : float
        Distance from the stated place beyond which there is a warning.
    coherence_um : float
        Width 4 sigma_s of the coherence window; 65 um for sunlight.

    Raises
    ------
    InputError
        The photographs are not rectified, or a length is not above 0.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018),
    sections 4.1 and 4.3.
    """
    _check_highlight(pattern_mm=pattern_mm, tolerance_mm=tolerance_mm, coherence_um=coherence_um)
    pixel = photos.pixel_mm
    if pixel is None:
        raise InputError("the photographs are not rectified", expected="align.rectified")
    rows, columns = photos.valid.shape[1:]
    count = len(photos.radiance)
    place, sigma = np.full((count, 2), np.nan), np.full(count, np.nan)
    stated = mirror_point(photos.light_mm, photos.camera_mm)
    extent_mm = np.array([columns, rows]) * pixel / 2
    saturated, outside = np.zeros(count, bool), np.zeros(count, bool)
    beyond: NDArray[np.bool_] = np.any(np.abs(stated) > extent_mm, axis=1)
    for index, (radiance, valid) in enumerate(zip(photos.radiance, photos.valid, strict=True)):
        brightness = radiance.mean(axis=-1, dtype=np.float32)
        column, row, spread = bright_spot(brightness, pattern_mm / pixel)
        edge = min(column, row, columns - 1 - column, rows - 1 - row)
        outside[index] = edge < 0.5 * spread or beyond[index]
        saturated[index] = _unread(valid, column, row, _NEIGHBOURHOOD_MM / pixel)
        if beyond[index]:
            _log.warning(
                "flash %d shows no highlight: the stated places of flash and camera put it at (%.1f, %.1f) mm, outside "
                "the sheet of %.4g x %.4g mm",
                *(index + 1, *stated[index], *(2 * extent_mm)),
            )
            continue
        if outside[index]:
            _log.warning("flash %d shows no highlight: the brightest spot lies on the edge of the sheet", index + 1)
            continue
        if saturated[index]:
            _log.warning("the highlight of flash %d is too bright for every exposure: it looks too wide", index + 1)
        place[index] = (column - (columns - 1) / 2) * pixel, ((rows - 1) / 2 - row) * pixel
        sigma[index] = spread * pixel
    away = np.linalg.norm(place - stated, axis=1)
    for off in np.flatnonzero(away > tolerance_mm):
        _log.warning(
            "the highlight of flash %d lies %.1f mm from where the stated places of flash and camera put it: at "
            "(%.1f, %.1f), not (%.1f, %.1f) mm",
            *(off + 1, away[off], *place[off], *stated[off]),
        )
    extent = _extent(photos, place, sigma, saturated, coherence_um)
    metrics = {"highlights_found": float(np.isfinite(sigma).sum()), "highlights_saturated": float(saturated.sum())}
    if np.isfinite(away).any():
        metrics["highlight_off_max_mm"] = float(np.nanmax(away))
    if extent is not None:
        metrics["light_sigma_mm"] = extent
    shrink = min(1.0, _SHOWN_PX / max(rows, columns))
    return Highlights(
        place_mm=place,
        sigma_mm=sigma,
        saturated=saturated,
        outside=outside,
        stated_mm=stated,
        light_sigma_mm=extent,
        photographs=np.stack([_smaller(radiance.mean(axis=-1), shrink) for radiance in photos.radiance]),
        pixel_mm=pixel / shrink,
        metrics=metrics,
    )


def _extent(
    photos: FlashPhotographs,
    place: NDArray[np.float64],
    sigma: NDArray[np.float64],
    saturated: NDArray[np.bool_],
    coherence_um: float,
) -> float | None:
    """Median over the photographs of the light's extent that makes the highlight so large."""
    wavelength = (photos.wavelength_nm or 1000 * _WHITE_UM) / 1000
    found = []
    for light, middle, wide in zip(photos.light_mm[~saturated], place[~saturated], sigma[~saturated], strict=True):
        half = half_vectors(middle[0], middle[1], light, np.asarray(photos.camera_mm, np.float64))
        spread = float(wide * (1 / half.light_mm + 1 / half.eye_mm))
        if np.isfinite(spread):
            found.append(
                light_sigma(spread, light_mm=float(half.light_mm), coherence_um=coherence_um, wavelength_um=wavelength)
            )
    return float(np.median(found)) if found else None


def _unread(valid: NDArray[np.bool_], column: float, row: float, radius: float) -> bool:
    """Whether most pixels in the middle of a highlight had no right exposure."""
    rows, columns = (slice(max(int(middle - radius), 0), int(middle + radius) + 2) for middle in (row, column))
    return float(valid[rows, columns].mean()) < 0.5


def _smaller(brightness: NDArray[np.floating], shrink: float) -> NDArray[np.float32]:
    size = max(round(brightness.shape[1] * shrink), 1), max(round(brightness.shape[0] * shrink), 1)
    return np.asarray(cv2.resize(brightness.astype(np.float32), size, interpolation=cv2.INTER_AREA))


def _check_highlight(*, pattern_mm: float, tolerance_mm: float, coherence_um: float, **_: object) -> None:
    """Refuse lengths that are none before anything runs."""
    refuse(above_zero(pattern_mm=pattern_mm, tolerance_mm=tolerance_mm, coherence_um=coherence_um))
