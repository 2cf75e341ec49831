"""Maps turned into colours: orientations as hues, pictures for a display, sizes fit for a page."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

MOST_PIXELS = 640
"""Longest side of a map in the report."""

GROUND = 0.12
"""Grey of masked pixels."""

Rgb = NDArray[np.float32]


def orientation_colours(orientation_rad: NDArray[np.floating]) -> Rgb:
    """Hue twice round the circle in a full turn: 0 and 180 degrees are the same red; NaN is dark grey.

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
    """The colour wheel of :func:`orientation_colours`, y up, with transparency around and in the middle."""
    y, x = np.mgrid[1 : -1 : size * 1j, -1 : 1 : size * 1j]
    radius = np.hypot(x, y)
    rgba = np.ones((size, size, 4), np.float32)
    rgba[..., :3] = orientation_colours(np.arctan2(y, x))
    rgba[..., 3] = (radius < 1) & (radius > 0.45)
    return rgba


def reduced(values: NDArray[np.floating], *, axial: bool = False) -> tuple[NDArray[np.floating], int]:
    """A map small enough for a page, by averaging what is known, and the factor; axial angles as such."""
    factor = int(np.ceil(max(values.shape[:2]) / MOST_PIXELS))
    if factor == 1:
        return np.asarray(values), 1
    if axial:
        double = np.stack([np.cos(2 * values), np.sin(2 * values)], axis=-1)
        mean, _ = reduced(double)
        return np.mod(np.arctan2(mean[..., 1], mean[..., 0]) / 2, np.pi), factor
    rows, columns = (length // factor * factor for length in values.shape[:2])
    blocks = np.asarray(values[:rows, :columns]).reshape(rows // factor, factor, columns // factor, factor, -1)
    known = np.isfinite(blocks)
    count = known.sum(axis=(1, 3))
    total = np.where(known, blocks, 0).sum(axis=(1, 3))
    mean = np.where(2 * count >= factor * factor, total / np.maximum(count, 1), np.nan)
    return mean.reshape(rows // factor, columns // factor, *values.shape[2:]), factor
