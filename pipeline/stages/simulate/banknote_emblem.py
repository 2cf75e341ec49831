"""An emblem as banknotes carry: bands of orientation, and fine rings of a longer period."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import GratingSample
from pipeline.devices.drawn_sample import blank, drawn_sample, foreseen, undrawable, unordered_periods
from pipeline.limits import above_zero, refuse
from pipeline.optics.drawing import Drawing, Map, star

Float64Array = NDArray[np.float64]

DESIGN_WIDTH_MM = 25.0
_MEDALLION_MM = (0.0, -3.5)
_BAND_SLOPE = 0.08


def banknote_emblem(
    *,
    width_mm: float = 25.0,
    margin_mm: float = 0.7,
    pixel_mm: float = 0.01,
    periods_um: tuple[float, ...] = (1.4, 1.1),
    band_mm: float = 0.9,
    turn_deg: float = 25.0,
    ring_mm: float = 0.8,
    depth_um: float = 0.12,
    amplitude_ratio: float = 1.1,
    phase_deg: float = 45.0,
    retardation_deg: float = 3.0,
    film_axis_deg: float = 0.0,
    ground_reflectance: float = 0.03,
) -> GratingSample:
    """Draw the emblem: a coronet of five points above a medallion, crossed by bands, the medallion ringed.

    Bands run almost level through the whole emblem; from each to the next above it, the orientation turns by
    ``turn_deg``. Rings of the longest period, a quarter as wide as they are apart, go around the medallion's centre;
    between them, and in the coronet, the period is the shorter one. A star in the middle lies across the bands.

    Parameters
    ----------
    width_mm, margin_mm : float
        Side of the square that holds the emblem, and width of the ground around it.
    pixel_mm : float
        Pitch of the map; a third of the camera's in ``rig=polarization_tile_simulated``.
    periods_um : tuple of float
        Of the rings, and of the rest.
    band_mm, turn_deg : float
        Height of a band in an emblem 25 mm wide, and turn of the orientation from one to the next.
    ring_mm : float
        Distance of the rings in an emblem 25 mm wide.
    depth_um, amplitude_ratio, phase_deg, retardation_deg, film_axis_deg, ground_reflectance : float
        Profile, zeroth order, film and ground, as in ``simulate.logo``.

    Returns
    -------
    GratingSample
        Map of (width + 2 margin) / pixel points a side.

    Raises
    ------
    InputError, InputErrors
        Not two periods above 0, the longer first; no width, band or ring, a negative margin, or a map
        too large to draw.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018),
    figure 19 and section 6.2.
    """
    _check_banknote_emblem(
        periods_um=periods_um,
        band_mm=band_mm,
        ring_mm=ring_mm,
        width_mm=width_mm,
        margin_mm=margin_mm,
        pixel_mm=pixel_mm,
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        ground_reflectance=ground_reflectance,
    )
    drawing = blank(width_mm=width_mm, margin_mm=margin_mm, pixel_mm=pixel_mm)
    scale = width_mm / DESIGN_WIDTH_MM
    bands = _bands(band_mm * scale, np.deg2rad(turn_deg))
    rings = _rings(ring_mm * scale, scale, periods_um)
    _coronet(drawing, scale, bands, periods_um[1])
    centre = (_MEDALLION_MM[0] * scale, _MEDALLION_MM[1] * scale)
    drawing.annulus(centre, (0.0, 7.4 * scale), bands, rings)
    drawing.annulus(centre, (7.9 * scale, 8.5 * scale), bands, periods_um[0])

    def across(x: Float64Array, y: Float64Array) -> Float64Array:
        return bands(x, y) + np.pi / 2

    for kite in star(centre, 2.6 * scale, points=8, waist=0.5, turn_deg=90.0):
        drawing.polygon(kite, across, periods_um[0])
    return drawn_sample(
        drawing,
        "banknote emblem",
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        phase_deg=phase_deg,
        retardation_deg=retardation_deg,
        film_axis_deg=film_axis_deg,
        ground_reflectance=ground_reflectance,
    )


def _bands(height_mm: float, turn_rad: float) -> Map:
    return lambda x, y: turn_rad * np.floor((y - _BAND_SLOPE * x) / height_mm)


def _rings(apart_mm: float, scale: float, periods_um: tuple[float, ...]) -> Map:
    x0, y0 = _MEDALLION_MM[0] * scale, _MEDALLION_MM[1] * scale

    def period(x: Float64Array, y: Float64Array) -> Float64Array:
        return np.where(np.hypot(x - x0, y - y0) % apart_mm > 0.75 * apart_mm, *periods_um)

    return period


def _coronet(drawing: Drawing, scale: float, orientation_rad: Map, period_um: float) -> None:
    """Five points on a circlet, each with a ball."""
    circlet = np.array([(-7.0, 5.7), (7.0, 5.7), (7.3, 6.9), (-7.3, 6.9)])
    drawing.polygon(circlet * scale, orientation_rad, period_um)
    for index, height in enumerate((10.0, 10.8, 11.2, 10.8, 10.0)):
        foot = 2.85 * (index - 2)
        tip = (1.12 * foot, height)
        drawing.polygon(np.array([(foot - 1.3, 7.2), (foot + 1.3, 7.2), tip]) * scale, orientation_rad, period_um)
        ball = (tip[0] * scale, (height + 0.2) * scale)
        drawing.annulus(ball, (0.0, 0.75 * scale), orientation_rad, period_um)


_foresee_banknote_emblem = foreseen


def _check_banknote_emblem(*, periods_um: tuple[float, ...], band_mm: float, ring_mm: float, **common: Any) -> None:
    """Refuse what cannot be drawn, before anything runs."""
    refuse(unordered_periods(periods_um, 2), above_zero(band_mm=band_mm, ring_mm=ring_mm), undrawable(**common))
