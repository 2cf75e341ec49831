"""The mirror image of a flash, found in a photograph of a patterned sheet."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]

_STEPS = 30
_WINDOW = 2.5
"""Standard deviations within which the highlight is measured."""


def blurred(brightness: NDArray[np.floating], valid: NDArray[np.bool_], sigma_px: float) -> NDArray[np.float32]:
    """Mean around each pixel of those that are valid; 0 where none is near."""
    weight = valid.astype(np.float32)
    known = np.where(valid, brightness, 0).astype(np.float32)
    total, share = (
        cv2.GaussianBlur(part, (0, 0), sigma_px, borderType=cv2.BORDER_CONSTANT) for part in (known, weight)
    )
    return np.where(share > 0.02, total / np.maximum(share, 1e-6), 0).astype(np.float32)


def bright_spot(brightness: NDArray[np.floating], pattern_px: float) -> tuple[float, float, float]:
    """Column, row and standard deviation, in pixels, of the brightest spot of a picture that is Gaussian around it.

    The sheet's pattern is averaged over ``pattern_px``; from the brightest place on, a window of two and a half
    standard deviations is centred on the mean of what it holds, and made as wide as that is, corrected for what the
    window itself cuts off, until both stay.
    """
    valid = np.isfinite(brightness)
    smooth = blurred(brightness, valid, pattern_px)
    row, column = (float(i) for i in np.unravel_index(int(np.argmax(smooth)), smooth.shape))
    smooth = np.maximum(smooth - np.float32(np.percentile(smooth, 20)), 0)
    peak = smooth.max()
    sigma = max(pattern_px, float(np.sqrt(np.count_nonzero(smooth > peak / 2) / (2 * np.pi * np.log(2)))))
    rows, columns = np.indices(smooth.shape, dtype=np.float32)
    for _ in range(_STEPS):
        square = (columns - column) ** 2 + (rows - row) ** 2
        weight = smooth * np.exp(-square / (2 * sigma**2)) * (square < (_WINDOW * 2 * sigma) ** 2)
        total = float(weight.sum(dtype=np.float64)) or 1.0
        moved = (
            float((weight * columns).sum(dtype=np.float64)) / total,
            float((weight * rows).sum(dtype=np.float64)) / total,
        )
        # A Gaussian times the window: 1 / variance is the sum of both, each sigma^2 at the fixed point.
        product = float((weight * square).sum(dtype=np.float64)) / total / 2
        own = 1 / max(1 / max(product, 1e-6) - 1 / sigma**2, 1e-6)
        step = abs(moved[0] - column) + abs(moved[1] - row) + abs(np.sqrt(own) - sigma)
        column, row = moved
        sigma = float(np.clip(np.sqrt(own), 0.5 * sigma, 1.5 * sigma))
        if step < 0.01:
            break
    return column, row, float(np.sqrt(max(sigma**2 - pattern_px**2, 0.25)))
