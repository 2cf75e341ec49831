"""A plastic plate over a grating, seen obliquely: what its birefringence and its face do to the polarisation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64Array = NDArray[np.float64]


@dataclass(frozen=True)
class Incidence:
    """Directions in which light arrives at the points of a plate and, mirrored, leaves them.

    Attributes
    ----------
    angle_rad : ndarray
        Between the direction and the normal, in air.
    azimuth_rad : ndarray
        Of the plane of incidence, anticlockwise from +x.
    """

    angle_rad: Float64Array
    azimuth_rad: Float64Array

    def inside_rad(self, index: float) -> Float64Array:
        """The angle to the normal inside a plate, by Snell's law."""
        return np.arcsin(np.sin(self.angle_rad) / index)


def towards(camera_mm: ArrayLike, x_mm: ArrayLike, y_mm: ArrayLike) -> Incidence:
    """Incidence at points of the plane z = 0 whose mirror reflection a camera sees."""
    camera = np.asarray(camera_mm, np.float64)
    right, up = camera[0] - np.asarray(x_mm, np.float64), camera[1] - np.asarray(y_mm, np.float64)
    return Incidence(np.arctan2(np.hypot(right, up), camera[2]), np.arctan2(up, right))


def plate_retardation(
    incidence: Incidence,
    *,
    thickness_um: float,
    index: float,
    wavelength_nm: float,
    in_plane: ArrayLike,
    axis_rad: ArrayLike,
    vertical: float,
) -> tuple[Float64Array, Float64Array]:
    """Retardation of one pass through a moulded plate, and the direction of its axis.

    In the plane the indices along and across ``axis_rad`` differ by ``in_plane``. The index along the normal is lower
    than both by ``vertical``, so that light at an angle ``t`` to the normal, inside, meets ``vertical sin^2 t`` more
    across its plane of incidence than along it. Both anisotropies are small: as tensors in the plane they add, and
    so do ``retardation exp(2 i axis)``. The path grows as ``1 / cos t``.

    Parameters
    ----------
    incidence : Incidence
        Where the light comes from.
    thickness_um, index, wavelength_nm : float
        Of the plate, and of the light.
    in_plane, axis_rad : array_like
        Index across the axis less that along it, and the axis.
    vertical : float
        Index in the plane less that along the normal.

    Returns
    -------
    retardation_rad, axis_rad : ndarray
        The field across the axis lags; the axis lies in (-pi/2, pi/2].

    References
    ----------
    Fu, Mansuripur and Lam, Measurement of the wavelength dependence of birefringence for optical disk substrates,
    Applied Optics 33, 7406 (1994). Born and Wolf, Principles of Optics, section 15.2 (the index ellipsoid).
    """
    inside = incidence.inside_rad(index)
    difference = in_plane * np.exp(2j * np.asarray(axis_rad, np.float64))
    difference = difference + vertical * np.sin(inside) ** 2 * np.exp(2j * incidence.azimuth_rad)
    waves = thickness_um / (wavelength_nm / 1000) / np.cos(inside)
    return 2 * np.pi * waves * np.abs(difference), np.angle(difference) / 2


def face_transmission_ratio(incidence: Incidence, index: float) -> Float64Array:
    """Amplitude along the plane of incidence over that across it, after passing a plate's face in and out.

    By Fresnel's formulas each passage gives ``t_p / t_s = 1 / cos(i - t)``.
    """
    return 1 / np.cos(incidence.angle_rad - incidence.inside_rad(index)) ** 2
