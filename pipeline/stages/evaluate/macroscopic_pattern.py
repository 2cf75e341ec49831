"""Whether a rendering shows the same pattern as photographs, whatever lies in its single shapes."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.data.flash import FlashPhotographs
from pipeline.data.metrics import Metrics
from pipeline.data.pictures import PictureSeries
from pipeline.errors import InputError
from pipeline.limits import above_zero, refuse, zero_or_more
from pipeline.optics.flash.highlight import blurred
from pipeline.optics.flash.lobes import mirror_point

_tolerance_macroscopic_pattern = {"metrics": 1e-2}

_SECTORS = 72
_REACH = 0.9
"""Of the least distance from a highlight to the sheet's edge, as far as its surroundings are read."""


def macroscopic_pattern(
    photos: FlashPhotographs, rendering: PictureSeries, *, blur_mm: float = 6.0, keep_off_mm: float = 15.0
) -> Metrics:
    """Compare blurred photographs of a sheet with pictures rendered under the same lights.

    Each is averaged over shapes, and the highlight, which shows in any, is left out. Colours are compared channel by
    channel. The polar profile is the mean distance from the highlight, weighted by brightness, in each direction.

    Parameters
    ----------
    photos : FlashPhotographs
        Rectified.
    rendering : PictureSeries
        Rectified, under as many lights.
    blur_mm : float
        Standard deviation of the blur.
    keep_off_mm : float
        Radius around the highlight that is left out.

    Returns
    -------
    Metrics
        ``pattern_correlation`` of all channels, and ``pattern_polar_correlation`` of the profiles, the means over the
        lights; 1 where the patterns are equal.

    Raises
    ------
    InputError
        The pictures are not rectified, or of other lights.
    """
    _check_macroscopic_pattern(blur_mm=blur_mm, keep_off_mm=keep_off_mm)
    if photos.pixel_mm is None or rendering.pixel_mm is None:
        raise InputError("both have to be rectified", expected="align.rectified, and view: rectified")
    if len(photos.radiance) != len(rendering.rgb):
        raise InputError(
            f"{len(rendering.rgb)} pictures are not of the {len(photos.radiance)} lights of the photographs",
            expected="a rendering under the same lights_mm",
        )
    rows, columns = photos.valid.shape[1:]
    pixel = photos.pixel_mm
    x, y = np.meshgrid((np.arange(columns) - (columns - 1) / 2) * pixel, ((rows - 1) / 2 - np.arange(rows)) * pixel)
    whole, polar = [], []
    for light, radiance, valid, rgb in zip(
        rendering.light_mm, photos.radiance, photos.valid, rendering.rgb, strict=True
    ):
        middle = mirror_point(light, rendering.camera_mm)
        away = np.hypot(x - middle[0], y - middle[1])
        compared = (away > keep_off_mm) & valid
        seen, made = (
            np.stack([blurred(part[..., k], compared, blur_mm / pixel) for k in range(3)])
            for part in (radiance, _resampled(rgb, (rows, columns)))
        )
        whole.append(_correlation(seen[:, compared], made[:, compared]))
        near = compared & (away < _REACH * _room(middle, x, y))
        turn = np.floor((np.arctan2(y - middle[1], x - middle[0]) / (2 * np.pi) + 0.5) * _SECTORS).astype(int)
        profiles = [_profile(part.mean(axis=0)[near], away[near], turn[near]) for part in (seen, made)]
        polar.append(_correlation(*profiles))
    return Metrics({"pattern_correlation": float(np.mean(whole)), "pattern_polar_correlation": float(np.mean(polar))})


def _resampled(rgb: NDArray[np.floating], shape: tuple[int, int]) -> NDArray[np.float32]:
    """A picture of the same sheet with as many pixels."""
    return np.asarray(cv2.resize(rgb.astype(np.float32), shape[::-1], interpolation=cv2.INTER_AREA))


def _room(middle: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    return float(min(x.max() - middle[0], middle[0] - x.min(), y.max() - middle[1], middle[1] - y.min()))


def _profile(
    brightness: NDArray[np.floating], away: NDArray[np.float64], turn: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Mean distance by brightness in each direction."""
    count = _SECTORS
    weight = np.bincount(turn % count, brightness, minlength=count)
    return np.asarray(np.bincount(turn % count, brightness * away, minlength=count) / np.maximum(weight, 1e-300))


def _correlation(left: NDArray[np.floating], right: NDArray[np.floating]) -> float:
    a, b = (part - part.mean(dtype=np.float64) for part in (left, right))
    return float((a * b).sum() / max(np.sqrt((a * a).sum() * (b * b).sum()), 1e-300))


def _check_macroscopic_pattern(*, blur_mm: float, keep_off_mm: float, **_: object) -> None:
    """Refuse impossible lengths before anything runs."""
    refuse(above_zero(blur_mm=blur_mm), zero_or_more(keep_off_mm=keep_off_mm))
