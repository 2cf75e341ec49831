"""A tile of kinematic paper: spokes that turn when the light moves."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import GratingSample
from pipeline.devices.drawn_sample import blank, drawn_sample, foreseen, undrawable
from pipeline.limits import above_zero, refuse
from pipeline.optics.drawing import Map

Float64Array = NDArray[np.float64]


def kinematic_tile(
    *,
    width_mm: float = 25.0,
    margin_mm: float = 0.7,
    pixel_mm: float = 0.01,
    sectors: int = 10,
    period_um: float = 1.3,
    depth_um: float = 0.12,
    amplitude_ratio: float = 1.1,
    phase_deg: float = 45.0,
    retardation_deg: float = 3.0,
    film_axis_deg: float = 0.0,
    ground_reflectance: float = 0.03,
) -> GratingSample:
    """Draw the tile: sectors around its centre, in each of which the orientation turns once through 180 degrees.

    Orientation grows anticlockwise with the direction in which a point lies from the centre, ``sectors / 2`` times as
    fast, and is 0 to the right of it. A lamp lights the points of one orientation, hence as many spokes as there are
    sectors, which turn as the lamp is carried around. Outside the inscribed circle the same pattern goes around each
    of the four corners, so that tiles laid side by side show four smaller wheels where they meet.

    Parameters
    ----------
    width_mm, margin_mm : float
        Width of the tile, and of the ground around it.
    pixel_mm : float
        Pitch of the map; a third of the camera's in ``rig=polarization_tile_simulated``.
    sectors : int
        Half turns of the orientation on the way around the centre.
    period_um : float
        The same everywhere.
    depth_um, amplitude_ratio, phase_deg, retardation_deg, film_axis_deg, ground_reflectance : float
        Profile, zeroth order, film and ground, as in ``simulate.logo``.

    Returns
    -------
    GratingSample
        Map of (width + 2 margin) / pixel points a side.

    Raises
    ------
    InputError, InputErrors
        No width, period or sector, a negative margin, or a map too large to draw.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018),
    figures 12 and 16 and section 5.3.
    """
    _check_kinematic_tile(
        sectors=sectors,
        period_um=period_um,
        width_mm=width_mm,
        margin_mm=margin_mm,
        pixel_mm=pixel_mm,
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        ground_reflectance=ground_reflectance,
    )
    drawing = blank(width_mm=width_mm, margin_mm=margin_mm, pixel_mm=pixel_mm)
    half = width_mm / 2
    tile = drawing.window(-half, -half, half, half)
    inside = (np.abs(tile.x_mm) <= half) & (np.abs(tile.y_mm) <= half)
    drawing.paint(tile, inside, _wheels(half, sectors), period_um)
    return drawn_sample(
        drawing,
        "kinematic tile",
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        phase_deg=phase_deg,
        retardation_deg=retardation_deg,
        film_axis_deg=film_axis_deg,
        ground_reflectance=ground_reflectance,
    )


def _wheels(half_mm: float, sectors: int) -> Map:
    """Orientation around the centre inside the inscribed circle, around the nearest corner outside."""

    def orientation(x: Float64Array, y: Float64Array) -> Float64Array:
        outside = np.hypot(x, y) > half_mm
        centre_x = np.where(outside, np.copysign(half_mm, x), 0.0)
        centre_y = np.where(outside, np.copysign(half_mm, y), 0.0)
        return sectors / 2 * np.arctan2(y - centre_y, x - centre_x)

    return orientation


_foresee_kinematic_tile = foreseen


def _check_kinematic_tile(*, sectors: int, period_um: float, **common: Any) -> None:
    """Refuse what cannot be drawn, before anything runs."""
    refuse(above_zero(sectors=sectors, period_um=period_um), undrawable(**common))
