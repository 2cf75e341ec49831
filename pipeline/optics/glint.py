"""Where a small light makes a grating shine: a first-order prediction that needs no depth, colour or exposure."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64Array = NDArray[np.float64]

_ORDERS = 6


def half_vectors(position_mm: Float64Array, light_mm: ArrayLike, camera_mm: ArrayLike) -> Float64Array:
    """In-plane components of ``omega_i + omega_r``, both pointing away from the sheet z = 0.

    Parameters
    ----------
    position_mm : ndarray of shape (P, 2)
        Points of the sheet: x right, y up, origin at its centre.
    light_mm, camera_mm : array of shape (3,)
        Where light and camera stand.

    Returns
    -------
    ndarray of shape (P, 2), float64
    """
    points = np.concatenate([position_mm, np.zeros((len(position_mm), 1))], axis=1)
    towards = [np.asarray(place, np.float64) - points for place in (light_mm, camera_mm)]
    return np.asarray(sum(v / np.linalg.norm(v, axis=1, keepdims=True) for v in towards))[:, :2]


def luminous_efficiency(wavelength_um: ArrayLike, spread_um: ArrayLike = 0.0) -> Float64Array:
    """The eye's photopic response, ``1.019 exp(-285.4 (lambda - 0.559)^2)`` with lambda in micrometres.

    With ``spread_um``, its mean over a Gaussian of that standard deviation around the wavelength.

    References
    ----------
    Wyman, Sloan and Shirley, Simple analytic approximations to the CIE XYZ colour matching functions, JCGT 2 (2013).
    """
    own = 1 / (2 * 285.4)
    variance = own + np.asarray(spread_um, np.float64) ** 2
    away = np.asarray(wavelength_um, np.float64) - 0.559
    return np.asarray(1.019 * np.sqrt(own / variance) * np.exp(-0.5 * away**2 / variance))


def glint(half: Float64Array, orientation_rad: ArrayLike, period_um: ArrayLike, spread: Float64Array) -> Float64Array:
    """Relative luminance of gratings under one light.

    With ``u`` the half vector's component along the tangent and ``v`` that across it, order m sends wavelength
    ``u period / m`` to the camera, within a Gaussian of ``v``; the same Gaussian in ``u`` mixes wavelengths. Higher
    orders are taken to fall as ``1 / m^2``.

    Parameters
    ----------
    half : ndarray of shape (..., P, 2)
        In-plane half vectors.
    orientation_rad, period_um : array of shape (P,)
        The gratings.
    spread : array of shape (..., P)
        Standard deviation of the Gaussian: the angular size of the light, and the coherence window.
    """
    c, s = np.cos(orientation_rad), np.sin(orientation_rad)
    along = np.abs(half[..., 0] * c + half[..., 1] * s)
    across = half[..., 1] * c - half[..., 0] * s
    period = np.asarray(period_um, np.float64)
    bright = np.zeros(along.shape)
    for order in range(1, _ORDERS + 1):
        bright += luminous_efficiency(along * period / order, spread * period / order) / order**2
    return np.asarray(np.exp(-0.5 * (across / spread) ** 2) * bright)
