"""Half vectors on a sheet under a small flash, and the lobes that its gratings show there.

With unit vectors from a point of the sheet to light and camera, the half vector is their sum. A grating of period a
sends order m of wavelength lambda to the camera where the half vector's component u along its tangent is
``m lambda / a`` and that across it, v, is 0 (Stam 1999; Toisoul, Dhillon and Ghosh 2018, equation 2). A light that is
not small, a coherence window that is not wide, a filter's band and a pixel's area spread that as Gaussians do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.optics.gratings import window_spread

Float64Array = NDArray[np.float64]
FWHM = float(2 * np.sqrt(2 * np.log(2)))
"""Full width at half maximum of a Gaussian in units of its standard deviation."""
_UPRIGHT = 1e-9
"""Length of a half vector that has no direction: in the highlight."""


@dataclass(frozen=True, eq=False)
class HalfVectors:
    """What light and camera make of points on the sheet; arrays of one shape.

    Attributes
    ----------
    x, y, w : ndarray
        Components of the half vector in the sheet's plane, and along its normal.
    gain : ndarray
        Radiance that an order's share of the light gives there: Stam's geometry, the light's obliquity and the inverse
        square of its distance in metres.
    light_mm, eye_mm : ndarray
        Distances to the light and to the camera.
    light_x, light_y : ndarray
        Part of the unit vector to the light in the sheet's plane.
    """

    x: Float64Array
    y: Float64Array
    w: Float64Array
    gain: Float64Array
    light_mm: Float64Array
    eye_mm: Float64Array
    light_x: Float64Array
    light_y: Float64Array

    @property
    def length(self) -> Float64Array:
        """Of the part in the plane."""
        return np.hypot(self.x, self.y)

    @property
    def azimuth_rad(self) -> Float64Array:
        """Direction of the part in the plane: that of the tangents which diffract here."""
        return np.arctan2(self.y, self.x)

    def light_along(self, x: Float64Array, y: Float64Array) -> Float64Array:
        """Half vectors that a millimetre of the light's extent is along a unit vector (x, y) of the plane.

        It is foreshortened where the light stands aslant in that direction.
        """
        return np.asarray(np.sqrt(1 - (self.light_x * x + self.light_y * y) ** 2) / self.light_mm)


def half_vectors(x_mm: ArrayLike, y_mm: ArrayLike, light_mm: Float64Array, eye_mm: Float64Array) -> HalfVectors:
    """Half vectors at points of the sheet's plane, of any shape.

    Parameters
    ----------
    x_mm, y_mm : array_like
        The points.
    light_mm, eye_mm : ndarray of shape (3,)
        Places of light and camera.
    """
    x, y = np.asarray(x_mm, np.float64), np.asarray(y_mm, np.float64)
    (lx, ly, lz), (cx, cy, cz) = light_mm, eye_mm
    light = np.sqrt((lx - x) ** 2 + (ly - y) ** 2 + lz**2)
    eye = np.sqrt((cx - x) ** 2 + (cy - y) ** 2 + cz**2)
    hx, hy = (lx - x) / light + (cx - x) / eye, (ly - y) / light + (cy - y) / eye
    cos_light, cos_eye = lz / light, cz / eye
    w = cos_light + cos_eye
    between = (hx**2 + hy**2 + w**2) / 2 - 1
    gain = (1 + between) ** 2 / (cos_eye * w**2) * (1000 / light) ** 2
    return HalfVectors(hx, hy, w, gain, light, eye, (lx - x) / light, (ly - y) / light)


def mirror_point(light_mm: ArrayLike, eye_mm: ArrayLike) -> Float64Array:
    """Where a mirror in the sheet's plane shows the light, shape (..., 2): there the half vector is upright."""
    light, eye = np.asarray(light_mm, np.float64), np.asarray(eye_mm, np.float64)
    heights = light[..., 2:] + eye[..., 2:]
    return (light[..., :2] * eye[..., 2:] + eye[..., :2] * light[..., 2:]) / heights


def light_above(highlight_mm: ArrayLike, light_height_mm: ArrayLike, eye_mm: ArrayLike) -> Float64Array:
    """The light of a height whose mirror image lies at ``highlight_mm``, shape (..., 3)."""
    seen, eye = np.asarray(highlight_mm, np.float64), np.asarray(eye_mm, np.float64)
    height = np.broadcast_to(np.asarray(light_height_mm, np.float64), seen.shape[:-1])[..., None]
    beyond = seen + (seen - eye[..., :2]) * height / eye[..., 2:]
    return np.concatenate([beyond, height], axis=-1)


def point_variance(half: HalfVectors, *, coherence_um: float, wavelength_um: float, pixel_mm: float) -> Float64Array:
    """Variance of a lobe of a light without extent, in half vectors: coherence window and pixel."""
    pixel = pixel_mm * (1 / half.light_mm + 1 / half.eye_mm)
    return np.asarray(window_spread(wavelength_um, coherence_um) ** 2 + pixel**2 / 12)


def light_variance(half: HalfVectors, light_sigma_mm: float) -> Float64Array:
    """What the light's extent adds to it across the tangents that diffract here."""
    length = np.maximum(half.length, _UPRIGHT)
    return np.asarray((light_sigma_mm * half.light_along(-half.y / length, half.x / length)) ** 2)


def light_sigma(spread: float, *, light_mm: float, coherence_um: float, wavelength_um: float) -> float:
    """Standard deviation of the extent, in mm, of a light that makes the highlight's ``spread`` in half vectors."""
    window = float(window_spread(wavelength_um, coherence_um))
    return float(light_mm * np.sqrt(max(spread**2 - window**2, 0.0)))
