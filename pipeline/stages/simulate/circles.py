"""Concentric circles side by side, as on holographic gift bags."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.data.gratings import GratingSample
from pipeline.devices.drawn_sample import blank, drawn_sample, foreseen, undrawable
from pipeline.errors import InputError
from pipeline.limits import above_zero, refuse, zero_or_more
from pipeline.optics.drawing import azimuth


def circles(
    *,
    width_mm: float = 25.0,
    margin_mm: float = 0.0,
    pixel_mm: float = 0.025,
    count: int = 4,
    gap_mm: float = 0.25,
    hub_mm: float = 0.0,
    period_um: float = 1.6666666666666667,
    lines_per_mm: float | None = None,
    depth_um: float = 0.12,
    amplitude_ratio: float = 1.1,
    phase_deg: float = 45.0,
    retardation_deg: float = 3.0,
    film_axis_deg: float = 0.0,
    ground_reflectance: float = 0.03,
) -> GratingSample:
    """Draw a square of discs, ``count`` along each side, whose grating lines are circles around each disc's centre.

    Each point diffracts along the radius: its orientation is the direction in which it lies from the centre of its
    disc. Under a small light a disc shows a bow, on circles around where the half vector vanishes.

    Parameters
    ----------
    width_mm, margin_mm : float
        Width of the square, and of the ground around it.
    pixel_mm : float
        Pitch of the map.
    count : int
        Discs along a side; 1 for a single disc.
    gap_mm : float
        Between neighbouring discs; half as much lies between them and the square's edge.
    hub_mm : float
        Diameter of the ground in the middle of each disc.
    period_um : float
        Of all gratings; the default is 600 lines per mm.
    lines_per_mm : float, optional
        The same as a line density, instead of ``period_um``.
    depth_um, amplitude_ratio, phase_deg, retardation_deg, film_axis_deg, ground_reflectance : float
        Profile, zeroth order, film and ground, as in ``simulate.logo``.

    Returns
    -------
    GratingSample
        Map of (width + 2 margin) / pixel points a side.

    Raises
    ------
    InputError, InputErrors
        No width, period or disc, discs that the gap or the hub leaves nothing of, or a map too large to draw.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018),
    figures 5 and 22.
    """
    _check_circles(
        count=count,
        gap_mm=gap_mm,
        hub_mm=hub_mm,
        period_um=period_um,
        lines_per_mm=lines_per_mm,
        width_mm=width_mm,
        margin_mm=margin_mm,
        pixel_mm=pixel_mm,
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        ground_reflectance=ground_reflectance,
    )
    drawing = blank(width_mm=width_mm, margin_mm=margin_mm, pixel_mm=pixel_mm)
    period = period_um if lines_per_mm is None else 1000 / lines_per_mm
    cell = width_mm / count
    centres = (np.arange(count) + 0.5) * cell - width_mm / 2
    for y in centres.tolist():
        for x in centres.tolist():
            drawing.annulus((x, y), (hub_mm / 2, (cell - gap_mm) / 2), azimuth((x, y)), period)
    return drawn_sample(
        drawing,
        "circles",
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        phase_deg=phase_deg,
        retardation_deg=retardation_deg,
        film_axis_deg=film_axis_deg,
        ground_reflectance=ground_reflectance,
    )


_foresee_circles = foreseen


def _check_circles(
    *,
    count: int,
    gap_mm: float,
    hub_mm: float,
    period_um: float,
    lines_per_mm: float | None,
    width_mm: float,
    **common: Any,
) -> None:
    """Refuse what cannot be drawn, before anything runs."""
    refuse(
        above_zero(count=count, period_um=period_um, lines_per_mm=lines_per_mm),
        zero_or_more(gap_mm=gap_mm, hub_mm=hub_mm),
        undrawable(width_mm=width_mm, **common),
    )
    disc = width_mm / count - gap_mm
    if disc <= hub_mm:
        raise InputError(
            f"gap_mm {gap_mm:g} and hub_mm {hub_mm:g} leave nothing of discs {width_mm / count:g} mm apart",
            where="gap_mm, hub_mm",
            expected=f"together less than {width_mm / count:g}",
        )
