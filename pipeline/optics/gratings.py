"""Diffraction by sinusoidal gratings: what share of the light each order takes, and how wide it spreads.

Height ``h(x) = h0/2 (1 + cos(2 pi x / a))`` along the tangent. With the non-normalised half vector
``(u, v, w) = -omega_i - omega_r`` in the grating's frame, the reflected light is a sum of Gaussians, one per order m,
centred at ``u = m lambda / a``, ``v = 0`` (Stam 1999; Toisoul, Dhillon and Ghosh 2018, equation 2).
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import jv

Float64Array = NDArray[np.float64]
Form = Literal["exact", "second order"]


def order_efficiency(order: ArrayLike, phase_depth: ArrayLike) -> Float64Array:
    """Share of the light in an order, exact for any depth: ``J_m(k w h0 / 2)^2`` (Jacobi-Anger).

    Parameters
    ----------
    order : array_like of int
        Diffraction order m.
    phase_depth : array_like
        ``k w h0``, the phase between crest and trough; broadcast against ``order``.
    """
    return jv(np.asarray(order), np.asarray(phase_depth) / 2) ** 2


def order_efficiency_second_order(order: ArrayLike, phase_depth: ArrayLike) -> Float64Array:
    """Share of the light in an order where ``exp(i k w h)`` is expanded to second order, as in the paper.

    With ``q = k w h0 / 2`` and the constant phase left out, ``exp(i q cos t)`` becomes
    ``1 - q^2/4 + i q cos t - q^2/4 cos 2t``: no order beyond 2, and good for ``q`` well below 1 only.
    """
    m = np.abs(np.asarray(order))
    q = np.asarray(phase_depth, dtype=np.float64) / 2
    amplitudes = [1 - q**2 / 4, q / 2, q**2 / 8]
    return np.select([m == n for n in range(3)], [a**2 for a in amplitudes], default=0.0)


def efficiencies(form: Form, order: ArrayLike, phase_depth: ArrayLike) -> Float64Array:
    """Share of the light in an order, in the exact or the paper's second-order form."""
    return (order_efficiency if form == "exact" else order_efficiency_second_order)(order, phase_depth)


def window_spread(wavelength_um: ArrayLike, coherence_um: float) -> Float64Array:
    """Standard deviation, in the half vector's components, of an order seen through the coherence window.

    The window's squared transform is ``exp(-sigma_s^2 k^2 |q|^2)``.

    Parameters
    ----------
    wavelength_um : array_like
        Wavelength.
    coherence_um : float
        Width ``4 sigma_s`` of the window; 65 um for sunlight.
    """
    sigma_s = coherence_um / 4
    return np.asarray(wavelength_um) / (2 * np.pi * np.sqrt(2.0) * sigma_s)


def highest_order(period_um: float, wavelength_um: float, largest_u: float) -> int:
    """Highest order that can reach a viewer: ``m lambda / a`` up to ``largest_u``, and one more for its width."""
    return int(np.ceil(period_um * largest_u / wavelength_um)) + 1
