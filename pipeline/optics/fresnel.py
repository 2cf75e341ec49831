"""Reflection at a plane surface, of a dielectric or of a metal.

Indices are ``n + i k`` with ``k >= 0`` in what absorbs, fields go as ``exp(-i omega t)``. Amplitudes have the signs of
ellipsometry (Muller 1969, "Definitions and conventions in ellipsometry", Surface Science 16): the p axis, the s axis
and the direction in which the light travels are right-handed before and after, so the p axis turns round on reflection
and at normal incidence ``r_p = -r_s``.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Complex128Array = NDArray[np.complex128]


def refracted_cosine(incident_index: ArrayLike, index: ArrayLike, incidence_rad: ArrayLike) -> Complex128Array:
    """Cosine of the angle of refraction by Snell's law, of the wave that decays into the second medium.

    Parameters
    ----------
    incident_index, index : array_like
        Of the medium from which the light comes, and of the one behind the surface; the latter may be complex.
    incidence_rad : array_like
        Angle of incidence from the normal.
    """
    sine = np.asarray(incident_index, np.complex128) * np.sin(incidence_rad) / np.asarray(index, np.complex128)
    return np.sqrt(1 - sine**2 + 0j)


def reflection(
    incident_index: ArrayLike, index: ArrayLike, incidence_rad: ArrayLike
) -> tuple[Complex128Array, Complex128Array]:
    """Fresnel's amplitudes of reflection ``(r_p, r_s)``, of the broadcast shape.

    Parameters
    ----------
    incident_index, index : array_like
        Of the medium from which the light comes, and of the one behind the surface; the latter may be complex.
    incidence_rad : array_like
        Angle of incidence from the normal, in [0, pi/2].

    References
    ----------
    Born and Wolf, Principles of Optics (1999), section 1.5.2, equation 21, with its sign of ``r_p``.
    """
    before, behind = np.asarray(incident_index, np.complex128), np.asarray(index, np.complex128)
    cos_before, cos_behind = np.cos(incidence_rad), refracted_cosine(before, behind, incidence_rad)
    r_p = (behind * cos_before - before * cos_behind) / (behind * cos_before + before * cos_behind)
    r_s = (before * cos_before - behind * cos_behind) / (before * cos_before + behind * cos_behind)
    return r_p, r_s


def zeroth_order_ratio(
    index: complex, *, incidence_rad: float, film_index: float = 1.0, p_axis: Literal["reversed", "kept"] = "reversed"
) -> complex:
    """``R``, the s to p amplitude of a flat surface under a film, as it stands in ``D = diag(-1, R)``.

    Parameters
    ----------
    index : complex
        Of the metal.
    incidence_rad : float
        Angle of incidence in air, before the film refracts it.
    film_index : float
        Of the film on the metal; 1 is none.
    p_axis : {"reversed", "kept"}
        Which axes the reflected field is written in. Reversed: those of ellipsometry, ``D ~ diag(r_p, r_s)``, and R
        is +1 at normal incidence. Kept: those of the incident field, ``D ~ diag(-r_p, r_s)``, and R is -1 there.

    Notes
    -----
    Toisoul, Dhillon and Ghosh 2018, equation 6, take the first. Since they turn the reflected field back by the same
    angle as if its axes had been kept, a plain mirror then is to them a half-wave plate that turns with the grating;
    with axes kept, D is -1 times unity at normal incidence, and turning the mirror changes nothing.

    ``-r_s / r_p = cos(a - b) / cos(a + b)`` with the angles of incidence and refraction, so near the normal
    ``R = 1 + 2 incidence^2 / (film_index index)`` to second order.
    """
    inside = np.arcsin(np.sin(incidence_rad) / film_index)
    r_p, r_s = reflection(film_index, index, inside)
    return complex(-r_s / r_p if p_axis == "reversed" else r_s / r_p)
