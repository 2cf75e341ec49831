"""Fraunhofer diffraction at a row of equal slits, as seen on a screen far behind them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64Array = NDArray[np.float64]


def slit_intensity(
    sine: ArrayLike, slits: int, *, slit_um: float, separation_um: float, wavelength_um: ArrayLike
) -> Float64Array:
    """Intensity behind a row of slits, relative to straight ahead.

    ``sinc(b s / lambda)^2 (sin(n pi d s / lambda) / (n sin(pi d s / lambda)))^2`` for ``n`` slits ``b`` wide and ``d``
    from middle to middle: maxima of the same height as straight ahead, but for the first factor, at ``d s = m lambda``,
    and ``n - 2`` lower ones between them.

    Parameters
    ----------
    sine : array_like
        Sine ``s`` of the angle from straight ahead.
    slits : int
        How many.
    slit_um, separation_um : float
        Width of a slit, and distance of the middles of neighbours.
    wavelength_um : array_like
        Wavelengths, broadcast with ``sine``.

    References
    ----------
    Born and Wolf, Principles of Optics, section 8.6.1, equation 5.
    """
    per_wavelength = np.asarray(sine, np.float64) / np.asarray(wavelength_um, np.float64)
    one_slit = np.sinc(slit_um * per_wavelength)
    return np.asarray((one_slit * interference_factor(separation_um * per_wavelength, slits)) ** 2)


def interference_factor(place: ArrayLike, count: int) -> Float64Array:
    """``sin(n pi x) / (n sin(pi x))``, the mean of ``n`` phases one ``x`` apart; 1 or -1 at whole ``x``."""
    place = np.asarray(place, np.float64)
    nearest = np.rint(place)
    away = place - nearest
    sign = np.where((nearest * (count - 1)) % 2 == 0, 1.0, -1.0)
    return np.asarray(sign * np.sinc(count * away) / np.sinc(away))
