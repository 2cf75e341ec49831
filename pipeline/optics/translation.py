"""Images moved by fractions of a pixel; without a turn the two directions part, which is twice as fast."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.optics.spline import quintic_taps

Float32Array = NDArray[np.float32]


def sample_translated(coefficients: Float32Array, shift_px: tuple[float, float]) -> Float32Array:
    """The spline at ``(row + shift_px[0], column + shift_px[1])`` for every pixel; the border is mirrored.

    Parameters
    ----------
    coefficients : ndarray of shape (M, N), float32
        From :func:`pipeline.optics.spline.quintic_coefficients`.
    shift_px : tuple of float
        Rows downwards, columns to the right.

    Returns
    -------
    ndarray of shape (M, N), float32
    """
    height, width = coefficients.shape
    whole = [int(np.floor(shift)) for shift in shift_px]
    pads = [(max(2 - step, 0), max(3 + step, 0)) for step in whole]
    result = np.pad(coefficients, pads, mode="reflect")
    for axis, (shift, step, size) in enumerate(zip(shift_px, whole, (height, width), strict=True)):
        weights = np.array(quintic_taps(shift - step))
        start = pads[axis][0] + step
        # With origin -1, correlate1d reads the pixels i - 2 ... i + 3.
        filtered = ndimage.correlate1d(result, weights, axis=axis, output=np.float32, mode="nearest", origin=-1)
        result = filtered[start : start + size] if axis == 0 else filtered[:, start : start + size]
    return np.ascontiguousarray(result)
