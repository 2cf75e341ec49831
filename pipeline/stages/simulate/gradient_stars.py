"""A tile of stars of several sizes, each filled with a gradient of orientation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import GratingSample
from pipeline.devices.drawn_sample import blank, drawn_sample, foreseen, undrawable
from pipeline.limits import above_zero, refuse, zero_or_more
from pipeline.optics.drawing import Map, Point, star

Float64Array = NDArray[np.float64]

DESIGN_WIDTH_MM = 25.0
_SIZES_MM = ((4.2, 3), (2.8, 6), (1.8, 12), (1.1, 24), (0.7, 40))
"""Radius of the stars and how many of each are tried for, the largest first."""
_GAP_MM = 0.15
_TRIES = 200


@dataclass(frozen=True)
class _Star:
    centre_mm: Point
    radius_mm: float
    turn_deg: float


def gradient_stars(
    *,
    width_mm: float = 25.0,
    margin_mm: float = 0.7,
    pixel_mm: float = 0.01,
    period_um: float = 1.3,
    seed: int = 0,
    depth_um: float = 0.12,
    amplitude_ratio: float = 1.1,
    phase_deg: float = 45.0,
    retardation_deg: float = 3.0,
    film_axis_deg: float = 0.0,
    ground_reflectance: float = 0.03,
) -> GratingSample:
    """Draw the tile: stars of five points and five sizes, scattered without touching on a dull ground.

    At its centre a star diffracts along the line through its first point; from there the orientation turns evenly, by
    90 degrees anticlockwise up to that point, by as much clockwise on the other side. Stars are turned at random,
    so all orientations are about equally common on the tile.

    Parameters
    ----------
    width_mm, margin_mm : float
        Width of the tile, and of the ground around it.
    pixel_mm : float
        Pitch of the map; a third of the camera's in ``rig=polarization_tile_simulated``.
    period_um : float
        The same everywhere.
    seed : int
        Of the places and turns of the stars.
    depth_um, amplitude_ratio, phase_deg, retardation_deg, film_axis_deg, ground_reflectance : float
        Profile, zeroth order, film and ground, as in ``simulate.logo``.

    Returns
    -------
    GratingSample
        Map of (width + 2 margin) / pixel points a side.

    Raises
    ------
    InputError, InputErrors
        No width or period, a negative margin or seed, or a map too large to draw.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018),
    figure 20a and section 6.2.
    """
    _check_gradient_stars(
        period_um=period_um,
        seed=seed,
        width_mm=width_mm,
        margin_mm=margin_mm,
        pixel_mm=pixel_mm,
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        ground_reflectance=ground_reflectance,
    )
    drawing = blank(width_mm=width_mm, margin_mm=margin_mm, pixel_mm=pixel_mm)
    scale = width_mm / DESIGN_WIDTH_MM
    for one in _scattered(np.random.default_rng(seed)):
        centre, radius = (one.centre_mm[0] * scale, one.centre_mm[1] * scale), one.radius_mm * scale
        gradient = _gradient(centre, radius, np.deg2rad(one.turn_deg))
        for kite in star(centre, radius, points=5, waist=0.5, turn_deg=one.turn_deg):
            drawing.polygon(kite, gradient, period_um)
    return drawn_sample(
        drawing,
        "tile of stars",
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        phase_deg=phase_deg,
        retardation_deg=retardation_deg,
        film_axis_deg=film_axis_deg,
        ground_reflectance=ground_reflectance,
    )


def _gradient(centre: Point, radius: float, along_rad: float) -> Map:
    c, s = np.cos(along_rad), np.sin(along_rad)
    return lambda x, y: along_rad + np.pi / 2 * ((x - centre[0]) * c + (y - centre[1]) * s) / radius


def _scattered(rng: np.random.Generator) -> list[_Star]:
    """Stars whose circles neither touch nor leave the tile, the largest placed first."""
    placed: list[_Star] = []
    for radius, count in _SIZES_MM:
        reach = DESIGN_WIDTH_MM / 2 - radius
        for _ in range(count):
            for x, y in rng.uniform(-reach, reach, (_TRIES, 2)):
                if all(
                    np.hypot(x - other.centre_mm[0], y - other.centre_mm[1]) > radius + other.radius_mm + _GAP_MM
                    for other in placed
                ):
                    placed.append(_Star((float(x), float(y)), radius, float(rng.uniform(0, 360))))
                    break
    return placed


_foresee_gradient_stars = foreseen


def _check_gradient_stars(*, period_um: float, seed: int, **common: Any) -> None:
    """Refuse what cannot be drawn, before anything runs."""
    refuse(above_zero(period_um=period_um), zero_or_more(seed=seed), undrawable(**common))
