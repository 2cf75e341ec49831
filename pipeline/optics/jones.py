"""Jones calculus of a grating under a birefringent film, seen through a linear polariser.

Fields are column vectors of complex amplitudes along x and y; angles are anticlockwise from +x. Toisoul, Dhillon and
Ghosh 2018, "Acquiring spatially varying appearance of printed holographic surfaces", section 5.2, equations 4 to 9.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

CIRCULAR = np.array([1.0, -1.0j])
"""The circularly polarised light of the panel, ``e_i`` of equation 4."""


def rotation(angle_rad: ArrayLike) -> NDArray[np.float64]:
    """Matrix from components along x and y to components along axes turned by ``angle_rad``; shape (..., 2, 2)."""
    angle = np.asarray(angle_rad, dtype=np.float64)
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([np.stack([c, s], axis=-1), np.stack([-s, c], axis=-1)], axis=-2)


def retarder(retardation_rad: ArrayLike, axis_rad: ArrayLike = 0.0) -> NDArray[np.complex128]:
    """One pass through a film that retards the field across its axis; shape (..., 2, 2)."""
    retardation, axis = np.broadcast_arrays(np.asarray(retardation_rad, float), np.asarray(axis_rad, float))
    own = np.zeros((*retardation.shape, 2, 2), dtype=np.complex128)
    own[..., 0, 0] = 1.0
    own[..., 1, 1] = np.exp(1j * retardation)
    return _turned(own, axis)


def grating(orientation_rad: ArrayLike, amplitude_ratio: float, phase_rad: float) -> NDArray[np.complex128]:
    """Zeroth order of a grating whose tangent has the given orientation; shape (..., 2, 2).

    Along the tangent the field is reflected with -1, across it with ``R = r exp(i zeta)``.
    """
    own = np.diag([-1.0, amplitude_ratio * np.exp(1j * phase_rad)])
    return _turned(own, orientation_rad)


def _turned(own: NDArray[np.complex128], angle_rad: ArrayLike) -> NDArray[np.complex128]:
    """A matrix given along its own axes, in axes that these are turned from."""
    turn = rotation(angle_rad).astype(np.complex128)
    return np.swapaxes(turn, -1, -2) @ own @ turn


def polarizer_response(
    polarizer_rad: ArrayLike,
    orientation_rad: ArrayLike,
    *,
    amplitude_ratio: float,
    phase_rad: float,
    retardation_rad: float = 0.0,
    film_axis_rad: float = 0.0,
) -> NDArray[np.float64]:
    """Intensity behind the polariser, ``I = |S e_i|^2`` of equations 6 and 7.

    Parameters
    ----------
    polarizer_rad, orientation_rad : array_like
        Angles of the polariser and of the grating's tangent; broadcast against each other.
    amplitude_ratio, phase_rad : float
        ``R = r exp(i zeta)``, s to p amplitude in the zeroth order.
    retardation_rad, film_axis_rad : float
        Retardation of one pass through the film, and the direction of its axis.

    Returns
    -------
    ndarray
        Of the broadcast shape; 1 is the intensity of a grating with R = 1 without a film.
    """
    film = retarder(retardation_rad, film_axis_rad)
    reflected = film @ grating(orientation_rad, amplitude_ratio, phase_rad) @ film @ CIRCULAR
    polarizer = np.asarray(polarizer_rad, dtype=np.float64)
    amplitude = np.cos(polarizer) * reflected[..., 0] + np.sin(polarizer) * reflected[..., 1]
    return np.abs(amplitude) ** 2


def offset_without_film(amplitude_ratio: float, phase_rad: float) -> float | None:
    """How far ahead of the grating's tangent the polariser stands where it is brightest, in [0, pi).

    Half the phase of equation 9, whose last term is ``-r sin(zeta) sin 2 psi`` (the printed text drops a "sin"); None
    where the polariser changes nothing, R being 1 or -1.
    """
    cosine, sine = 1 - amplitude_ratio**2, -2 * amplitude_ratio * np.sin(phase_rad)
    if np.hypot(cosine, sine) <= 1e-12 * (1 + amplitude_ratio**2):
        return None
    return float(np.mod(np.arctan2(sine, cosine) / 2, np.pi))


def stokes_parameters(
    orientation_rad: ArrayLike,
    *,
    amplitude_ratio: ArrayLike,
    phase_rad: ArrayLike,
    retardation_rad: ArrayLike = 0.0,
    film_axis_rad: ArrayLike = 0.0,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Stokes parameters ``S0``, ``S1``, ``S2`` of the light before the polariser.

    An ideal polariser at ``psi`` lets ``(S0 + S1 cos 2 psi + S2 sin 2 psi) / 2`` through, which is
    :func:`polarizer_response`: three maps give the photographs at all angles. The matrices of equation 6 are written
    out in the film's own axes, in which circularly polarised light stays what it is but for a phase.

    Parameters
    ----------
    orientation_rad : array_like
        Angle of the grating's tangent.
    amplitude_ratio, phase_rad : array_like
        ``R = r exp(i zeta)``, s to p amplitude in the zeroth order.
    retardation_rad, film_axis_rad : array_like
        Retardation of one pass through the film, and the direction of its axis.

    Returns
    -------
    tuple of ndarray
        Each of the shape that the parameters broadcast to.
    """
    axis = np.asarray(film_axis_rad, np.float64)
    doubled = 2 * (np.asarray(orientation_rad, np.float64) - axis)
    ratio = amplitude_ratio * np.exp(1j * np.asarray(phase_rad, np.float64))
    delay = np.exp(1j * np.asarray(retardation_rad, np.float64))
    half_sum, half_difference = (ratio + 1) / 2, (ratio - 1) / 2
    turned = half_sum * np.cos(doubled)
    crossed = half_sum * np.sin(doubled)
    incident = CIRCULAR[1] * delay
    along = half_difference - turned - crossed * incident
    across = delay * ((half_difference + turned) * incident - crossed)
    along_power, across_power = np.abs(along) ** 2, np.abs(across) ** 2
    first, second = along_power - across_power, 2 * np.real(along * np.conj(across))
    c, s = np.cos(2 * axis), np.sin(2 * axis)
    return along_power + across_power, first * c - second * s, first * s + second * c
