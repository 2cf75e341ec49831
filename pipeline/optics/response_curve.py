"""The closed curve on which the polarisation of a printed sample lies, traced by the orientation of its gratings.

Behind an ideal linear polariser a pixel's photographs hold three numbers, ``I(psi) = m (1 + s1 cos 2 psi + s2 sin 2
psi)``. The brightness ``m`` is the pixel's own; ``(s1, s2)`` is a point in the unit disc that depends on the
orientation ``theta`` and on what the whole sample has in common: the complex ratio ``r exp(i zeta)`` of the zeroth
order, and the film's retardation and axis. As ``theta`` turns by half a circle the point runs along a closed curve.
Without a film it is a circle around the origin; a film moves it, bends it, and may let it cross itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.optics.jones import stokes_parameters

Float64Array = NDArray[np.float64]

DARK = 0.005
"""Noise of a dark pixel relative to that of the mean one: keeps a vanishing photograph from having no noise at all."""


@dataclass(frozen=True)
class FilmedGrating:
    """What a sample's gratings have in common.

    ``(r, zeta, theta)`` and ``(1 / r, -zeta, theta + 90 deg)`` are one and the same grating up to its brightness, so
    ``zeta`` is taken from 0 to 180 degrees.

    Attributes
    ----------
    amplitude_ratio, phase_rad : float
        ``R = r exp(i zeta)``, s to p amplitude in the zeroth order.
    retardation_rad : float
        Of one pass through the film.
    film_axis_rad : float
        Direction of the film's axis.
    """

    amplitude_ratio: float
    phase_rad: float
    retardation_rad: float = 0.0
    film_axis_rad: float = 0.0


@dataclass(frozen=True)
class ResponseCurve:
    """A curve, sampled at T equal steps of the orientation over half a circle.

    Attributes
    ----------
    orientation_rad : ndarray of shape (T,)
        From 0 to pi.
    stokes : ndarray of shape (T, 2)
        ``(s1, s2)``, the second and third Stokes parameter relative to the first.
    slope : ndarray of shape (T, 2)
        Their derivative with respect to the orientation.
    brightness : ndarray of shape (T,)
        Mean intensity over a turn of the polariser; 1 for a grating with R = 1.
    """

    orientation_rad: Float64Array
    stokes: Float64Array
    slope: Float64Array
    brightness: Float64Array


def relative_stokes(
    orientation_rad: ArrayLike, grating: FilmedGrating | Float64Array
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Brightness ``m`` and relative Stokes parameters ``s1``, ``s2``: ``I(psi) = m (1 + s1 cos 2 psi + s2 sin 2 psi)``.

    ``grating`` may be many, an array whose last axis holds ratio, phase, retardation and axis; its other axes are
    broadcast against the orientations.
    """
    ratio, phase, film, axis = (
        np.moveaxis(grating, -1, 0)
        if isinstance(grating, np.ndarray)
        else (grating.amplitude_ratio, grating.phase_rad, grating.retardation_rad, grating.film_axis_rad)
    )
    whole, first, second = stokes_parameters(
        orientation_rad, amplitude_ratio=ratio, phase_rad=phase, retardation_rad=film, film_axis_rad=axis
    )
    return whole / 2, first / whole, second / whole


def response_curve(grating: FilmedGrating, count: int = 1024) -> ResponseCurve:
    """Sample the curve at ``count`` orientations."""
    step = np.pi / count
    orientation = np.arange(count, dtype=np.float64) * step

    reach = 1e-4
    brightness, first, second = relative_stokes(orientation + np.array([[0.0], [reach], [-reach]]), grating)
    stokes = np.stack([first, second], axis=-1)
    return ResponseCurve(orientation, stokes[0], (stokes[1] - stokes[2]) / (2 * reach), brightness[0])


class StokesNoise:
    """Noise of ``(s1, s2)`` as weighted least squares finds them from photographs with shot noise.

    Parameters
    ----------
    polarizer_rad, photo_weights : array_like of shape (K,)
        The photographs.
    """

    def __init__(self, polarizer_rad: ArrayLike, photo_weights: ArrayLike) -> None:
        self._design = harmonic_design(polarizer_rad)
        weights = np.asarray(photo_weights, np.float64)
        root = np.sqrt(weights)[:, None]
        inverse = np.linalg.pinv(self._design * root) * root.T
        self._products = np.einsum("ak,bk->kab", inverse, inverse).reshape(len(weights), 9)
        left = np.eye(len(weights)) - self._design @ inverse
        self._left = (left**2 * weights[:, None]).sum(axis=0)

    def covariance(self, stokes: Float64Array) -> Float64Array:
        """Of a pixel whose brightness is one electron, at points (T, 2); shape (T, 2, 2)."""
        whole = (self._variance(stokes) @ self._products).reshape(-1, 3, 3)
        towards = np.zeros((len(stokes), 2, 3))
        towards[:, :, 0] = -stokes
        towards[:, 0, 1] = towards[:, 1, 2] = 1
        return np.asarray(towards @ whole @ np.swapaxes(towards, -1, -2))

    def residual(self, stokes: Float64Array) -> Float64Array:
        """Expected weighted sum of squares of what the three numbers leave over, of such a pixel; shape (T,)."""
        return np.asarray(self._variance(stokes) @ self._left)

    def _variance(self, stokes: Float64Array) -> Float64Array:
        return np.maximum(1 + stokes @ self._design[:, 1:].T, 0) + DARK


def orientation_bound(curve: ResponseCurve, polarizer_rad: ArrayLike, electrons: ArrayLike) -> Float64Array:
    """Cramer-Rao bound of the orientation's standard deviation, in radians; the brightness is unknown too.

    Photographs with independent noise of variance ``m (1 + s1 cos 2 psi + s2 sin 2 psi)`` electrons have the Fisher
    information ``F = D^T V^-1 D`` with ``D`` the derivatives of the intensities with respect to ``(m, theta)``; the
    bound is the root of ``(F^-1)_theta,theta``. The smaller term of the variance's own dependence is left out.

    Parameters
    ----------
    curve : ResponseCurve
        Of T orientations.
    polarizer_rad : array_like of shape (K,)
        Polariser angles.
    electrons : array_like, broadcast to (T,)
        Mean brightness ``m`` of a pixel in one photograph.
    """
    design = harmonic_design(polarizer_rad)[:, 1:]
    level = np.broadcast_to(np.asarray(electrons, np.float64), curve.orientation_rad.shape)[:, None]
    shape = 1 + curve.stokes @ design.T
    turning = level * (curve.slope @ design.T)
    variance = np.maximum(level * shape, 1e-9)
    brightness = (shape**2 / variance).sum(axis=1)
    mixed = (shape * turning / variance).sum(axis=1)
    orientation = (turning**2 / variance).sum(axis=1)
    information = orientation - mixed**2 / brightness
    with np.errstate(divide="ignore"):
        return np.asarray(1 / np.sqrt(np.maximum(information, 0)))


def harmonic_design(polarizer_rad: ArrayLike) -> Float64Array:
    """``[1, cos 2 psi, sin 2 psi]`` of each photograph, shape (K, 3)."""
    double = 2 * np.asarray(polarizer_rad, np.float64)
    return np.stack([np.ones_like(double), np.cos(double), np.sin(double)], axis=1)
