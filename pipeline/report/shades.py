"""Maps turned into colours: orientations as hues, numbers by perceptual scales; sizes fit for a page."""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

MOST_PIXELS = 700
"""Longest side of a map in the report."""

GROUND = 0.2
"""Grey of masked pixels, in every map."""

Rgb = NDArray[np.float32]
Shades = Literal["viridis", "diverging"]

RED_TO_BLUE = (
    "67001f",
    "b2182b",
    "d6604d",
    "f4a582",
    "fddbc7",
    "f7f7f7",
    "d1e5f0",
    "92c5de",
    "4393c3",
    "2166ac",
    "053061",
)
"""ColorBrewer's RdBu in 11 classes (Brewer 2003)."""


def orientation_colours(orientation_rad: NDArray[np.floating]) -> Rgb:
    """Hue goes once round while the orientation goes half round: 0 and 180 degrees are the same red; NaN is dark grey.

    Parameters
    ----------
    orientation_rad : ndarray of shape (M, N)
        Axial angles.
    """
    known = np.isfinite(orientation_rad)
    hue = np.where(known, np.mod(orientation_rad, np.pi) / np.pi * 360, 0).astype(np.float32)
    full = np.ones_like(hue)
    rgb = cv2.cvtColor(np.stack([hue, full, full], axis=-1), cv2.COLOR_HSV2RGB)
    rgb[~known] = GROUND
    return np.asarray(rgb, dtype=np.float32)


def wheel_colours(size: int) -> NDArray[np.float32]:
    """The colour wheel of :func:`orientation_colours` as a ring, y up, transparent around it and in the middle."""
    y, x = np.mgrid[1 : -1 : size * 1j, -1 : 1 : size * 1j]
    radius = np.hypot(x, y)
    rgba = np.ones((size, size, 4), np.float32)
    rgba[..., :3] = orientation_colours(np.arctan2(y, x))
    edge = size / 2
    rgba[..., 3] = np.clip((1 - radius) * edge, 0, 1) * np.clip((radius - WHEEL_HOLE) * edge, 0, 1)
    return rgba


WHEEL_HOLE = 0.66
"""Inner radius of the wheel's ring, of its outer one."""


def colours(values: NDArray[np.floating], low: float, high: float, shades: Shades) -> Rgb:
    """Numbers as colours, clipped to ``low`` and ``high``; NaN is dark grey."""
    known = np.isfinite(values)
    share = (np.where(known, values, low) - low) / (high - low)
    rgb = _scale(shades)[np.clip(np.rint(share * 255), 0, 255).astype(np.uint8)]
    rgb[~known] = GROUND
    return rgb


@lru_cache
def _scale(shades: Shades) -> Rgb:
    """256 colours of a scale, low to high."""
    if shades == "diverging":
        nodes = np.array([list(bytes.fromhex(c)) for c in reversed(RED_TO_BLUE)], np.float32) / 255
        at = np.linspace(0, len(nodes) - 1, 256)
        table = np.stack([np.interp(at, np.arange(len(nodes)), nodes[:, i]) for i in range(3)], axis=-1)
    else:
        table = cv2.applyColorMap(np.arange(256, dtype=np.uint8)[:, None], cv2.COLORMAP_VIRIDIS)[:, 0, ::-1] / 255
    return table.astype(np.float32)


def reduced(
    values: NDArray[np.floating] | NDArray[np.bool_], *, most: int = MOST_PIXELS, axial: bool = False
) -> NDArray[np.float32]:
    """A map whose longest side is at most ``most``, by averaging over area what is known.

    Parameters
    ----------
    values : ndarray of shape (M, N) or (M, N, C)
        Where less than half of a new pixel's area is known, it is NaN.
    most : int
        Longest side of the result; smaller maps come back as they are.
    axial : bool
        The values are angles in radians, and the same half a turn further.
    """
    rows, columns = values.shape[:2]
    shrink = most / max(rows, columns)
    if shrink >= 1:
        return np.asarray(values, dtype=np.float32)
    if axial:
        double = 2 * np.asarray(values, dtype=np.float32)
        mean = reduced(np.stack([np.cos(double), np.sin(double)], axis=-1), most=most)
        return np.mod(np.arctan2(mean[..., 1], mean[..., 0]) / 2, np.float32(np.pi))
    size = (max(1, round(columns * shrink)), max(1, round(rows * shrink)))
    whole = np.ascontiguousarray(values, dtype=np.float32)
    known = np.isfinite(whole)
    if known.all():
        return np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA))
    total = cv2.resize(np.where(known, whole, np.float32(0)), size, interpolation=cv2.INTER_AREA)
    share = cv2.resize(known.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    return np.where(share >= 0.5, total / np.maximum(share, np.float32(1e-6)), np.float32(np.nan))
