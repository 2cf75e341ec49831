"""The interpolating B-spline of degree 5."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.optics.compiled import njit

Float32Array = NDArray[np.float32]


def quintic_coefficients(image: Float32Array) -> Float32Array:
    """B-spline coefficients of degree 5 of ``image``, mirrored at its border; non-finite pixels count as 0."""
    return np.asarray(
        ndimage.spline_filter(np.nan_to_num(image, posinf=0.0, neginf=0.0), order=5, output=np.float32, mode="mirror")
    )


@njit(inline="always", error_model="numpy")
def quintic_taps(fraction):  # type: ignore[no-untyped-def]
    """Weights of the coefficients ``i - 2 ... i + 3`` for the quintic spline at ``i + fraction``, 0 <= fraction < 1.

    References
    ----------
    Thevenaz, Blu and Unser, Interpolation revisited, IEEE Trans. Medical Imaging 19 (2000), and their code.
    """
    f = fraction
    f2 = f * f
    w5 = f * f2 * f2 / 120
    f2 -= f
    f4 = f2 * f2
    f -= 0.5
    t = f2 * (f2 - 3)
    w0 = (1 / 5 + f2 + f4) / 24 - w5
    even, odd = (f2 * (f2 - 5) + 46 / 5) / 24, -f * (t + 4) / 12
    outer_even, outer_odd = (9 / 5 - t) / 16, f * (f4 - f2 - 5) / 24
    return w0, outer_even + outer_odd, even + odd, even - odd, outer_even - outer_odd, w5


@njit(inline="always", error_model="numpy")
def quintic_slope_taps(fraction):  # type: ignore[no-untyped-def]
    """Derivative of the spline with respect to position, in the taps of :func:`quintic_taps`."""
    return (
        _slope(fraction + 2),
        _slope(fraction + 1),
        _slope(fraction),
        _slope(fraction - 1),
        _slope(fraction - 2),
        _slope(fraction - 3),
    )


@njit(error_model="numpy")
def _slope(offset):  # type: ignore[no-untyped-def]
    distance = abs(offset)
    if distance < 1:
        slope = distance * (-120 + distance**2 * (120 - 50 * distance)) / 120
    elif distance < 2:
        slope = (75 + distance * (-420 + distance * (450 + distance * (-180 + 25 * distance)))) / 120
    else:
        slope = -((3 - distance) ** 4) / 24
    return slope if offset > 0 else -slope
