"""A tile of fireworks: bursts of strokes, circles and small stars."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import GratingSample
from pipeline.devices.drawn_sample import blank, drawn_sample, foreseen, undrawable
from pipeline.limits import above_zero, refuse
from pipeline.optics.drawing import Drawing, Map, Point, azimuth, polar, star

Float64Array = NDArray[np.float64]

DESIGN_WIDTH_MM = 25.0
_GOLDEN_DEG = 180 * (3 - 5**0.5)
_SPRINKLED = 70


@dataclass(frozen=True)
class _Burst:
    """Strokes that fly apart from a centre, in a tile 25 mm wide."""

    centre_mm: Point
    radius_mm: float
    strokes: int


_BURSTS = (
    _Burst((-5.0, 4.6), 6.6, 28),
    _Burst((6.6, 6.8), 4.6, 20),
    _Burst((5.4, -5.2), 6.2, 24),
    _Burst((-6.8, -7.4), 4.0, 16),
)


def fireworks(
    *,
    width_mm: float = 25.0,
    margin_mm: float = 0.7,
    pixel_mm: float = 0.01,
    period_um: float = 1.3,
    twist_deg: float = 60.0,
    depth_um: float = 0.12,
    amplitude_ratio: float = 1.1,
    phase_deg: float = 45.0,
    retardation_deg: float = 3.0,
    film_axis_deg: float = 0.0,
    ground_reflectance: float = 0.03,
) -> GratingSample:
    """Draw the tile: four bursts of strokes, a ring around each centre, circles and small stars between them.

    A stroke diffracts along itself where it starts and ``twist_deg`` further anticlockwise where it ends, so that light
    runs outwards when the lamp is carried around. Rings and circles diffract away from their centres, small stars along
    their first point. Strokes are as wide as 0.2 to 0.4 mm, the finest features of all scenes.

    Parameters
    ----------
    width_mm, margin_mm : float
        Width of the tile, and of the ground around it.
    pixel_mm : float
        Pitch of the map; a third of the camera's in ``rig=polarization_tile_simulated``.
    period_um : float
        The same everywhere.
    twist_deg : float
        Turn of the orientation along a stroke.
    depth_um, amplitude_ratio, phase_deg, retardation_deg, film_axis_deg, ground_reflectance : float
        Profile, zeroth order, film and ground, as in ``simulate.logo``.

    Returns
    -------
    GratingSample
        Map of (width + 2 margin) / pixel points a side.

    Raises
    ------
    InputError, InputErrors
        No width or period, a negative margin, or a map too large to draw.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018),
    figure 20b and section 6.2.
    """
    _check_fireworks(
        period_um=period_um,
        width_mm=width_mm,
        margin_mm=margin_mm,
        pixel_mm=pixel_mm,
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        ground_reflectance=ground_reflectance,
    )
    drawing = blank(width_mm=width_mm, margin_mm=margin_mm, pixel_mm=pixel_mm)
    scale = width_mm / DESIGN_WIDTH_MM
    _sprinkle(drawing, scale, period_um)
    for burst in _BURSTS:
        centre, radius = _scaled(burst.centre_mm, scale), burst.radius_mm * scale
        for index in range(burst.strokes):
            stroke = _stroke(centre, radius * (1.0 if index % 2 else 0.8), 360 * index / burst.strokes)
            drawing.polygon(stroke, _twisted(centre, radius, np.deg2rad(twist_deg)), period_um)
        drawing.annulus(centre, (0.07 * radius, 0.15 * radius), azimuth(centre), period_um)
    return drawn_sample(
        drawing,
        "tile of fireworks",
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        phase_deg=phase_deg,
        retardation_deg=retardation_deg,
        film_axis_deg=film_axis_deg,
        ground_reflectance=ground_reflectance,
    )


def _sprinkle(drawing: Drawing, scale: float, period_um: float) -> None:
    """Circles and stars in turn, on a spiral of the golden angle, where no burst is."""
    for index in range(_SPRINKLED):
        place = polar(1.9 * np.sqrt(index + 0.5), _GOLDEN_DEG * index)
        if max(map(abs, place)) > 11.5 or any(
            np.hypot(*np.subtract(place, b.centre_mm)) < b.radius_mm for b in _BURSTS
        ):
            continue
        centre, turn = _scaled(place, scale), _GOLDEN_DEG * index
        if index % 3 == 0:
            drawing.annulus(centre, (0.0, 0.55 * scale), azimuth(centre), period_um)
        else:
            for kite in star(centre, 0.75 * scale, points=5, waist=0.45, turn_deg=turn):
                drawing.polygon(kite, np.deg2rad(turn), period_um)


def _stroke(centre: Point, radius: float, angle_deg: float) -> Float64Array:
    """A kite that begins as a point, is widest at three quarters of the way, and ends round the corner."""
    across = np.array(polar(0.03 * radius, angle_deg + 90))
    start, shoulder, stop = (np.array(polar(share * radius, angle_deg, centre)) for share in (0.2, 0.75, 1.0))
    return np.array([start, shoulder - across, stop, shoulder + across])


def _twisted(centre: Point, radius: float, twist_rad: float) -> Map:
    direction = azimuth(centre)

    def orientation(x: Float64Array, y: Float64Array) -> Float64Array:
        return direction(x, y) + twist_rad * np.hypot(x - centre[0], y - centre[1]) / radius

    return orientation


def _scaled(point: Point, scale: float) -> Point:
    return point[0] * scale, point[1] * scale


_foresee_fireworks = foreseen


def _check_fireworks(*, period_um: float, **common: Any) -> None:
    """Refuse what cannot be drawn, before anything runs."""
    refuse(above_zero(period_um=period_um), undrawable(**common))
