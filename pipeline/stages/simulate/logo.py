"""A printed logo: an iris of facets, each of one orientation, in the manner of registration badges and seals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.data import GratingSample
from pipeline.errors import InputError
from pipeline.limits import above_zero, refuse, zero_or_more

DESIGN_RADIUS_MM = 7.5
LARGEST_SIDE = 20_000


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
    side = round((width_mm + 2 * margin_mm) / pixel_mm)
    scale = width_mm / (2 * DESIGN_RADIUS_MM)
    orientation = np.full((side, side), np.nan, np.float32)
    period = np.full((side, side), np.nan, np.float32)
    for facet in _facets():
        rows, columns, inside = _rasterise(facet.vertices_mm * scale, side, pixel_mm)
        orientation[rows, columns][inside] = np.deg2rad(facet.orientation_deg)
        period[rows, columns][inside] = periods_um[facet.period]
    return GratingSample(
        orientation_rad=orientation,
        period_um=period,
        pixel_mm=pixel_mm,
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        phase_rad=float(np.deg2rad(phase_deg)),
        retardation_rad=float(np.deg2rad(retardation_deg)),
        film_axis_rad=float(np.deg2rad(film_axis_deg)),
        ground_reflectance=ground_reflectance,
        name="iris logo",
    )


def _check_logo(
    *,
    width_mm: float,
    margin_mm: float,
    pixel_mm: float,
    periods_um: tuple[float, ...],
    depth_um: float,
    amplitude_ratio: float,
    ground_reflectance: float,
    **_: object,
) -> None:
    """Refuse what cannot be drawn, before anything runs."""
    problems = []
    if len(periods_um) != 3 or max(periods_um) != periods_um[0] or min(periods_um) <= 0:
        right = "three periods above 0, the longest first"
        problems.append(InputError(f"periods_um is {list(periods_um)}", where="periods_um", expected=right))
    refuse(
        problems,
        above_zero(width_mm=width_mm, pixel_mm=pixel_mm),
        zero_or_more(margin_mm=margin_mm, depth_um=depth_um, amplitude_ratio=amplitude_ratio),
        zero_or_more(ground_reflectance=ground_reflectance),
    )
    side = (width_mm + 2 * margin_mm) / pixel_mm
    if not 1 <= side <= LARGEST_SIDE:
        raise InputError(
            f"the map would have {side:.0f} points a side", where="pixel_mm", expected=f"1 to {LARGEST_SIDE} points"
        )


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
        corners = [_polar(1.6, start), _polar(5.6, start), _polar(5.6, start + 30), _polar(5.6, start + 60)]
        corners.append(_polar(1.6, start + 60))
        facets.append(_Facet(np.array(corners), orientation, period))
    facets.append(_Facet(np.array([_polar(1.35, 60 * k + 30) for k in range(6)]), 105, 0))
    rays = [(20, 0), (80, 1), (110, 2)]
    for index, (orientation, period) in enumerate(rays):
        facets.append(_Facet(_ray(1.9, 5.2, 240.0 + 30 + 12 * (index - 1), 0.35), orientation, period))
    return facets


def _polar(radius: float, angle_deg: float) -> tuple[float, float]:
    angle = np.deg2rad(angle_deg)
    return float(radius * np.cos(angle)), float(radius * np.sin(angle))


def _sector(inner: float, outer: float, start_deg: float, stop_deg: float, *, gap_mm: float) -> NDArray[np.float64]:
    trims = [np.rad2deg(gap_mm / 2 / radius) for radius in (inner, outer)]
    return np.array(
        [
            _polar(inner, start_deg + trims[0]),
            _polar(outer, start_deg + trims[1]),
            _polar(outer, stop_deg - trims[1]),
            _polar(inner, stop_deg - trims[0]),
        ]
    )


def _ray(inner: float, outer: float, angle_deg: float, width_mm: float) -> NDArray[np.float64]:
    along = np.array(_polar(1.0, angle_deg))
    across = np.array(_polar(width_mm / 2, angle_deg + 90))
    return np.array([inner * along - across, outer * along - across, outer * along + across, inner * along + across])


def _rasterise(vertices_mm: NDArray[np.float64], side: int, pixel_mm: float) -> tuple[slice, slice, NDArray[np.bool_]]:
    """Window and mask of the pixels whose centres lie inside a convex polygon."""
    left, low = vertices_mm.min(axis=0) / pixel_mm + side / 2
    right, high = vertices_mm.max(axis=0) / pixel_mm + side / 2
    columns = slice(max(int(left), 0), min(int(right) + 1, side))
    rows = slice(max(int(side - high), 0), min(int(side - low) + 1, side))
    x = (np.arange(columns.start, columns.stop) + 0.5 - side / 2) * pixel_mm
    y = (side / 2 - np.arange(rows.start, rows.stop) - 0.5) * pixel_mm
    inside = np.ones((len(y), len(x)), bool)
    for (x0, y0), (x1, y1) in zip(vertices_mm, np.roll(vertices_mm, -1, axis=0), strict=True):
        inside &= (x1 - x0) * (y[:, None] - y0) - (y1 - y0) * (x[None, :] - x0) >= 0
    return rows, columns, inside
