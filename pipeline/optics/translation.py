"""Images moved by fractions of a pixel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Float32Array = NDArray[np.float32]


def quintic_coefficients(image: Float32Array) -> Float32Array:
    """B-spline coefficients of degree 5 of ``image``, mirrored at its border; non-finite pixels count as 0."""
    return np.asarray(
        ndimage.spline_filter(np.nan_to_num(image, posinf=0.0, neginf=0.0), order=5, output=np.float32, mode="mirror")
    )


def quintic_weights(fraction: float) -> NDArray[np.float64]:
    """Weights of the coefficients ``i - 2 ... i + 3`` for the spline at ``i + fraction``, 0 <= fraction < 1."""
    distance = np.abs(fraction - np.arange(-2.0, 4.0))
    inner = (66 - 60 * distance**2 + 30 * distance**4 - 10 * distance**5) / 120
    middle = (51 + 75 * distance - 210 * distance**2 + 150 * distance**3 - 45 * distance**4 + 5 * distance**5) / 120
    outer = np.maximum(3 - distance, 0) ** 5 / 120
    return np.where(distance < 1, inner, np.where(distance < 2, middle, outer))


def quintic_slopes(fraction: float) -> NDArray[np.float64]:
    """Derivative of the interpolated signal with respect to position, in the taps of :func:`quintic_weights`."""
    offset = fraction - np.arange(-2.0, 4.0)
    distance = np.abs(offset)
    inner = (-120 * distance + 120 * distance**3 - 50 * distance**4) / 120
    middle = (75 - 420 * distance + 450 * distance**2 - 180 * distance**3 + 25 * distance**4) / 120
    outer = -(np.maximum(3 - distance, 0) ** 4) / 24
    return np.sign(offset) * np.where(distance < 1, inner, np.where(distance < 2, middle, outer))


def sample_translated(coefficients: Float32Array, shift_px: tuple[float, float]) -> Float32Array:
    """The spline at ``(row + shift_px[0], column + shift_px[1])`` for every pixel; the border is mirrored.

    Parameters
    ----------
    coefficients : ndarray of shape (M, N), float32
        From :func:`quintic_coefficients`.
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
        weights = quintic_weights(shift - step)
        start = pads[axis][0] + step
        # With origin -1, correlate1d reads the pixels i - 2 ... i + 3.
        filtered = ndimage.correlate1d(result, weights, axis=axis, output=np.float32, mode="nearest", origin=-1)
        result = filtered[start : start + size] if axis == 0 else filtered[:, start : start + size]
    return np.ascontiguousarray(result)
