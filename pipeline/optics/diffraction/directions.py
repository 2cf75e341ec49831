"""Where light comes from and goes to, and what the surface's geometry and Fresnel reflection make of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64Array = NDArray[np.float64]


@dataclass(frozen=True)
class Directions:
    """Many pairs of a light's and a viewer's direction, in a frame whose z is the surface's normal.

    Attributes
    ----------
    light, view : ndarray of shape (M, N, 3)
        Unit vectors away from the surface; either may have lengths of 1 that stand for all of M or N. Those that do not
        exist, such as outside a disc of directions, are NaN.
    """

    light: Float64Array
    view: Float64Array

    @property
    def uvw(self) -> tuple[Float64Array, Float64Array, Float64Array]:
        """``(u, v, w) = -light - view`` (Stam 1999), each of shape (M, N)."""
        whole = -self.light - self.view
        return whole[..., 0], whole[..., 1], whole[..., 2]


def unit_vector(theta_rad: ArrayLike, phi_rad: ArrayLike = 0.0) -> Float64Array:
    """Direction at an angle ``theta`` from the normal and ``phi`` anticlockwise from +x, shape (..., 3)."""
    theta, phi = np.broadcast_arrays(np.asarray(theta_rad, np.float64), np.asarray(phi_rad, np.float64))
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def disc_of_views(light: Float64Array, size: int) -> Directions:
    """All directions of view over the surface, seen from above: pixel (row, column) looks along ``(x, y)`` of the disc.

    Parameters
    ----------
    light : ndarray of shape (3,)
        Unit vector towards the light.
    size : int
        Pixels across the disc, whose edge is at grazing view; what lies outside is NaN.
    """
    places = (2 * np.arange(size) + 1) / size - 1
    x, y = np.meshgrid(places, -places)
    square = x**2 + y**2
    z = np.sqrt(np.where(square < 1, 1 - square, np.nan))
    return Directions(light[None, None, :], np.stack([x, y, z], axis=-1))


def relative_gain(directions: Directions, *, refractive_index: float = 1.5, shadowed: bool = True) -> Float64Array:
    """What the response is multiplied with to be radiance relative to that of a mirror at normal incidence.

    ``F^2 / F_0^2 (1 + i . r)^2 / ((cos i + cos r)^2 cos r)`` times the shadowing of V-shaped grooves, which removes the
    pole at grazing views. Over ``cos i`` it is a BRDF, the same both ways. F is the amplitude, so its square is the
    reflectance, which is Schlick's; the source takes that for F and squares it, which makes grazing views up to 25
    times too bright.

    References
    ----------
    Single, Diffraction Shader (2014), equation 1.34; Cook and Torrance 1982 for the grooves.
    """
    cos_light, cos_view = directions.light[..., 2], directions.view[..., 2]
    between = (directions.light * directions.view).sum(axis=-1)
    bright = schlick(directions, refractive_index) / ((refractive_index - 1) / (refractive_index + 1)) ** 2
    geometry = (1 + between) ** 2 / ((cos_light + cos_view) ** 2 * cos_view)
    return np.asarray(bright * geometry * (_grooves(directions) if shadowed else 1.0))


def schlick(directions: Directions, refractive_index: float) -> Float64Array:
    """Schlick's approximation of the Fresnel reflectance, at the angle between light and half vector."""
    normal = ((refractive_index - 1) / (refractive_index + 1)) ** 2
    cosine = np.sqrt((1 + (directions.light * directions.view).sum(axis=-1)) / 2)
    return np.asarray(normal + (1 - normal) * (1 - cosine) ** 5)


def _grooves(directions: Directions) -> Float64Array:
    cos_light, cos_view = directions.light[..., 2], directions.view[..., 2]
    half = directions.light + directions.view
    length = np.sqrt((half**2).sum(axis=-1))
    towards = (directions.view * half).sum(axis=-1) / length
    steep = 2 * half[..., 2] / length * np.minimum(cos_light, cos_view) / towards
    return np.asarray(np.minimum(1.0, steep))
