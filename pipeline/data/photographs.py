"""Photographs, as cameras give them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from pipeline.data.arrays import BoolArray, FloatArray

SIMULTANEOUS = "simultaneous"
"""Key in a sequence's metadata that says ``yes`` where one exposure gave all photographs, so that none can be moved."""


@dataclass(frozen=True, eq=False)
class Photo:
    """One linear photograph.

    Attributes
    ----------
    image : ndarray of shape (M, N) or (M, N, 3), float32
        Linear signal; 1 is the sensor's full scale.
    saturated : ndarray of shape (M, N), bool
        Pixels at or above full scale.
    exposure_s : float or None
        Exposure time.
    metadata : dict of str to str
        What the camera said about itself (model, ISO, aperture, ...).
    """

    image: FloatArray
    saturated: BoolArray
    exposure_s: float | None = None
    metadata: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class PolarizerPhoto:
    """One photograph through a polariser.

    Attributes
    ----------
    photo : Photo
        The photograph.
    polarizer_rad : float
        Where the polariser stood.
    """

    photo: Photo
    polarizer_rad: float


@dataclass(frozen=True, eq=False)
class PolarizerSequence:
    """Photographs of one scene through a linear polariser at several angles.

    Attributes
    ----------
    images : ndarray of shape (K, M, N), float32
        Linear photographs; 1 is the sensor's full scale.
    polarizer_rad : ndarray of shape (K,), float64
        Angle of the polariser's transmitted direction in each photograph.
    valid : ndarray of shape (M, N), bool
        Pixels inside the photographer's mask that are finite and unsaturated in every photograph.
    pixel_mm : float or None
        Pixel pitch on the sample.
    wavelength_nm : float or None
        Centre of the spectral filter.
    exposure_s : tuple of float or None
        Exposure time of each photograph.
    metadata : dict of str to str
        What the camera said about itself.
    """

    images: FloatArray
    polarizer_rad: FloatArray
    valid: BoolArray
    pixel_mm: float | None = None
    wavelength_nm: float | None = None
    exposure_s: tuple[float, ...] | None = None
    metadata: Mapping[str, str] = field(default_factory=dict)
