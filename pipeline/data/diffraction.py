"""What height fields make of light."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pipeline.data.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class BrdfMap:
    """How a surface shines in all directions, relative to a mirror at normal incidence.

    Attributes
    ----------
    rgb : ndarray of shape (L, M, M, 3), float32
        Linear sRGB over discs of directions of view, whose pixel (row, column) looks along (x, y) of the disc with y up
        and the edge at grazing view; 0 outside.
    light : ndarray of shape (L, 3), float64
        Unit vectors towards the light.
    evaluator : str
        How the response was found.
    caption : str
        Of what surface.
    metrics : dict of str to float
        Figures for the table: each name ends in its unit, where it has one.
    """

    rgb: FloatArray
    light: FloatArray
    evaluator: str = ""
    caption: str = ""
    metrics: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class DiffractionPeaks:
    """How bright a surface is in the plane of incidence, and where an order of diffraction is brightest.

    Angles of view are signed: negative on the other side of the normal than the light.

    Attributes
    ----------
    wavelength_nm : ndarray of shape (L,), float64
        Wavelengths.
    view_rad : ndarray of shape (A,), float64
        Angles of view.
    response : ndarray of shape (L, A), float32
        Relative to a mirror in its direction.
    peak_rad : ndarray of shape (L,), float64
        Angle at which the order is brightest; NaN where no peak stands out.
    period_um : ndarray of shape (L,), float64
        Period that each peak gives; NaN where there is none.
    light_rad, azimuth_rad : float
        The light's angle from the normal, and the direction of the plane, anticlockwise from +x.
    order : int
        Order of diffraction; above 0 on the light's side of the mirror's direction.
    near_um : float
        Period around which peaks were looked for; NaN if none was known or found.
    evaluator, caption : str
        How the response was found, and of what surface.
    metrics : dict of str to float
        Figures for the table: each name ends in its unit, where it has one.
    """

    wavelength_nm: FloatArray
    view_rad: FloatArray
    response: FloatArray
    peak_rad: FloatArray
    period_um: FloatArray
    light_rad: float
    azimuth_rad: float
    order: int
    near_um: float
    evaluator: str
    caption: str
    metrics: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class SlitPatterns:
    """What a row of slits throws on a screen far away, for several numbers of slits.

    Attributes
    ----------
    position_mm : ndarray of shape (X,), float64
        Places on the screen, from the middle.
    slits : ndarray of shape (K,), int64
        Numbers of slits.
    intensity : ndarray of shape (K, X), float32
        Of light of one wavelength, relative to the middle.
    white_rgb : ndarray of shape (K, X, 3), float32
        Linear sRGB under white light; the middle is white.
    wavelength_nm : float
        Of the light of one wavelength.
    caption : str
        Slits and screen.
    metrics : dict of str to float
        Figures for the table: each name ends in its unit, where it has one.
    """

    position_mm: FloatArray
    slits: NDArray[np.integer]
    intensity: FloatArray
    white_rgb: FloatArray
    wavelength_nm: float
    caption: str
    metrics: Mapping[str, float]
