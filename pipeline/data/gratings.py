"""Maps of gratings: as drawn, as measured, and how far the two are apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pipeline.data.arrays import BoolArray, FloatArray

PARAMETER = "parameter_"
"""What precedes the name of a map's parameter among the attributes of its EXR file."""


@dataclass(frozen=True, eq=False)
class GratingSample:
    """A printed holographic sample, known exactly because it was drawn.

    Attributes
    ----------
    orientation_rad : ndarray of shape (M, N), float32
        Orientation of the grating's tangent (the direction in which it diffracts), in [0, pi); NaN on the ground.
    period_um : ndarray of shape (M, N), float32
        Grating period; NaN on the ground.
    pixel_mm : float
        Pitch of this map; finer than any camera that photographs it.
    depth_um : float
        Peak-to-valley depth of the sinusoidal profile.
    amplitude_ratio, phase_rad : float or ndarray of shape (M, N), float32
        ``R = r exp(i zeta)``, complex ratio of s to p amplitude in the zeroth order.
    retardation_rad : float or ndarray of shape (M, N), float32
        Retardation of one pass through the protective film.
    film_axis_rad : float or ndarray of shape (M, N), float32
        Direction of the film's optical axis.
    ground_reflectance : float
        Unpolarised reflectance of the ground relative to the zeroth order of the longest period.
    name : str
        What is drawn.
    veil : float or ndarray of shape (M, N), float32
        Unpolarised reflectance of what lies over all of it, as print and scratches, relative to the same.
    """

    orientation_rad: FloatArray
    period_um: FloatArray
    pixel_mm: float
    depth_um: float
    amplitude_ratio: float | FloatArray
    phase_rad: float | FloatArray
    retardation_rad: float | FloatArray
    film_axis_rad: float | FloatArray
    ground_reflectance: float
    name: str
    veil: float | FloatArray = 0.0

    @property
    def diffracts(self) -> BoolArray:
        """Where the sample carries a grating, shape (M, N)."""
        return np.isfinite(self.orientation_rad)


@dataclass(frozen=True, eq=False)
class OrientationMap:
    """Orientation of the grating's tangent at every pixel.

    Attributes
    ----------
    orientation_rad : ndarray of shape (M, N), float32
        In [0, pi); NaN outside ``mask``.
    correlation : ndarray of shape (M, N), float32
        Normalised correlation of the fitted model with the photographs, in [0, 1]; NaN outside ``mask``, and everywhere
        where the photographs are no more than the model's unknowns.
    intensity : ndarray of shape (M, N), float32
        Mean over the photographs, full scale 1.
    mask : ndarray of shape (M, N), bool
        Pixels that diffract.
    pixel_mm : float or None
        Pixel pitch on the sample.
    absolute : bool
        False where the map is known only up to one offset, the same for every pixel.
    standard_error_rad : ndarray of shape (M, N), float32, or None
        Standard error of the orientation as the fit states it; NaN outside ``mask``.
    parameters : dict of str to float
        What the fit found that the whole sample has in common: each name ends in its unit.
    stokes : ndarray of shape (P, 2), float32, or None
        Relative Stokes parameters ``(s1, s2)`` of some of the pixels, where the fit found their curve.
    metrics : dict of str to float
        Figures for the table that need no truth: each name ends in its unit.
    """

    orientation_rad: FloatArray
    correlation: FloatArray
    intensity: FloatArray
    mask: BoolArray
    pixel_mm: float | None = None
    absolute: bool = False
    standard_error_rad: FloatArray | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    stokes: FloatArray | None = None
    metrics: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of_angles(cls, orientation_rad: FloatArray, *, pixel_mm: float | None, absolute: bool) -> OrientationMap:
        """A map of angles in [0, pi), NaN where nothing diffracts, without photographs behind it."""
        unknown = np.full(orientation_rad.shape, np.nan, np.float32)
        return cls(orientation_rad, unknown, unknown, np.isfinite(orientation_rad), pixel_mm, absolute)


@dataclass(frozen=True, eq=False)
class PeriodMap:
    """Grating period at every pixel.

    Attributes
    ----------
    period_um : ndarray of shape (M, N), float32
        NaN outside ``mask``.
    mask : ndarray of shape (M, N), bool
        Pixels that diffract.
    pixel_mm : float or None
        Pixel pitch on the sample.
    relative : bool
        True where only ratios of periods were measured and the longest was given.
    standard_error_um : ndarray of shape (M, N), float32, or None
        Standard error of the period as the fit states it; NaN outside ``mask``.
    metrics : dict of str to float
        Figures for the table that need no truth: each name ends in its unit.
    """

    period_um: FloatArray
    mask: BoolArray
    pixel_mm: float | None = None
    relative: bool = True
    standard_error_um: FloatArray | None = None
    metrics: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class OrientationError:
    """Signed difference between an estimated orientation and the truth.

    Attributes
    ----------
    error_rad : ndarray of shape (M, N), float32
        Estimate minus truth minus offset, in [-pi/2, pi/2); NaN where either is masked.
    offset_rad : float
        The one offset removed from every pixel.
    metrics : dict of str to float
        Figures for the table: each name ends in its unit.
    """

    error_rad: FloatArray
    offset_rad: float
    metrics: Mapping[str, float]
