"""A printed logo: an iris of facets, each of one orientation, in the manner of registration badges and seals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import GratingSample
from pipeline.devices.drawn_sample import blank, drawn_sample, foreseen, undrawable, unordered_periods
from pipeline.limits import refuse
from pipeline.optics.drawing import polar, ray

DESIGN_RADIUS_MM = 7.5


@dataclass(frozen=True)
class _Facet:
    """A convex polygon, its vertices anticlockwise, y up, in a design 15 mm wide."""

    vertices_mm: NDArray[np.float64]
    orientation_deg: float
    period: int


def logo(
    *,
    width_mm: float = 15.0,
    margin_mm: float = 0.6,
    pixel_mm: float = 0.006666666666666667,
    periods_um: tuple[float, ...] = (1.4, 1.2, 1.0),
    depth_um: float = 0.12,
    amplitude_ratio: float = 1.1,
    phase_deg: float = 45.0,
    retardation_deg: float = 3.0,
    film_axis_deg: float = 0.0,
    ground_reflectance: float = 0.03,
) -> GratingSample:
    """Draw the logo: a ring of ten facets around an iris of six blades, a hexagon and a band of rays.

    Facets carry one orientation and one of three periods each. Orientations are those a designer would choose so that
    neighbours light up one after the other: bunched between 0 and 60 degrees, with a few repeats. Blades touch each
    other, the ring's facets stand apart by gaps of 0.15 mm, the rays are 0.35 mm wide.

    Parameters
    ----------
    width_mm, margin_mm : float
        Width of the logo, and of the ground around it.
    pixel_mm : float
        Pitch of the map; a third of the default camera's.
    periods_um : tuple of float
        Three periods, the longest first.
    depth_um : float
        Peak-to-valley depth of the sinusoidal profile.
    amplitude_ratio, phase_deg : float
        ``R = r exp(i zeta)`` of the zeroth order; the defaults are those of the paper's figure 14b.
    retardation_deg, film_axis_deg : float
        Protective film; the default retardation is that of the paper's figures 15b to 15d.
    ground_reflectance : float
        Of the unpolarised ground, relative to the zeroth order of the longest period.

    Returns
    -------
    GratingSample
        Map of (width + 2 margin) / pixel points a side.

    Raises
    ------
    InputError
        Not three periods above 0, the longest first; no width, a negative margin, or a map too large to draw.
    """
    _check_logo(
        width_mm=width_mm,
        margin_mm=margin_mm,
        pixel_mm=pixel_mm,
        periods_um=periods_um,
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        ground_reflectance=ground_reflectance,
    )
    drawing = blank(width_mm=width_mm, margin_mm=margin_mm, pixel_mm=pixel_mm)
    scale = width_mm / (2 * DESIGN_RADIUS_MM)
    for facet in _facets():
        drawing.polygon(facet.vertices_mm * scale, np.deg2rad(facet.orientation_deg), periods_um[facet.period])
    return drawn_sample(
        drawing,
        "iris logo",
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        phase_deg=phase_deg,
        retardation_deg=retardation_deg,
        film_axis_deg=film_axis_deg,
        ground_reflectance=ground_reflectance,
    )


_foresee_logo = foreseen


def _check_logo(*, periods_um: tuple[float, ...], **common: Any) -> None:
    """Refuse what cannot be drawn, before anything runs."""
    refuse(unordered_periods(periods_um, 3), undrawable(**common))


def _facets() -> list[_Facet]:
    """The design, later facets on top."""
    facets = []
    ring = [(10, 0), (25, 0), (40, 1), (40, 0), (55, 0), (75, 2), (90, 0), (120, 1), (135, 0), (150, 0)]
    for index, (orientation, period) in enumerate(ring):
        start, stop = 36.0 * index, 36.0 * (index + 1)
        facets.append(_Facet(_sector(6.0, 7.5, start, stop, gap_mm=0.15), orientation, period))
    blades = [(0, 0), (15, 1), (30, 0), (50, 2), (60, 0), (165, 1)]
    for index, (orientation, period) in enumerate(blades):
        start = 60.0 * index
        corners = [polar(1.6, start), polar(5.6, start), polar(5.6, start + 30), polar(5.6, start + 60)]
        corners.append(polar(1.6, start + 60))
        facets.append(_Facet(np.array(corners), orientation, period))
    facets.append(_Facet(np.array([polar(1.35, 60 * k + 30) for k in range(6)]), 105, 0))
    rays = [(20, 0), (80, 1), (110, 2)]
    for index, (orientation, period) in enumerate(rays):
        facets.append(_Facet(ray((1.9, 5.2), 240.0 + 30 + 12 * (index - 1), 0.35), orientation, period))
    return facets


def _sector(inner: float, outer: float, start_deg: float, stop_deg: float, *, gap_mm: float) -> NDArray[np.float64]:
    trims = [np.rad2deg(gap_mm / 2 / radius) for radius in (inner, outer)]
    return np.array(
        [
            polar(inner, start_deg + trims[0]),
            polar(outer, start_deg + trims[1]),
            polar(outer, stop_deg - trims[1]),
            polar(inner, stop_deg - trims[0]),
        ]
    )
