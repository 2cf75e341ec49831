"""Stripes of one orientation each, bunched: hard for whoever assumes that all are equally common."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.data.gratings import GratingSample
from pipeline.devices.drawn_sample import blank, drawn_sample, foreseen, undrawable
from pipeline.errors import InputError
from pipeline.limits import refuse


def facets(
    *,
    width_mm: float = 15.0,
    margin_mm: float = 0.6,
    pixel_mm: float = 0.006666666666666667,
    orientations_deg: tuple[float, ...] = (10.0, 20.0, 30.0, 40.0, 55.0, 60.0, 90.0),
    period_um: float = 1.2,
    depth_um: float = 0.12,
    amplitude_ratio: float = 1.08,
    phase_deg: float = 40.0,
    retardation_deg: float = 8.0,
    film_axis_deg: float = 0.0,
    ground_reflectance: float = 0.03,
) -> GratingSample:
    """Draw upright stripes side by side, from left to right, on a square.

    Parameters
    ----------
    width_mm, margin_mm : float
        Side of the square, and of the ground around it.
    pixel_mm : float
        Pitch of the map; a third of the default camera's.
    orientations_deg : tuple of float
        Of each stripe.
    period_um, depth_um : float
        Of all gratings; the depth from peak to valley.
    amplitude_ratio, phase_deg : float
        ``R = r exp(i zeta)`` of the zeroth order.
    retardation_deg, film_axis_deg : float
        Protective film.
    ground_reflectance : float
        Of the unpolarised ground, relative to the zeroth order.

    Returns
    -------
    GratingSample
        Map of (width + 2 margin) / pixel points a side.

    Raises
    ------
    InputError
        No stripe, no period, no width, a negative margin, or a map too large to draw.
    """
    common = {"margin_mm": margin_mm, "pixel_mm": pixel_mm, "depth_um": depth_um}
    common |= {"amplitude_ratio": amplitude_ratio, "ground_reflectance": ground_reflectance}
    _check_facets(orientations_deg=orientations_deg, period_um=period_um, width_mm=width_mm, **common)
    drawing = blank(width_mm=width_mm, margin_mm=margin_mm, pixel_mm=pixel_mm)
    half, edges = width_mm / 2, np.linspace(-width_mm / 2, width_mm / 2, len(orientations_deg) + 1)
    for left, right, orientation in zip(edges, edges[1:], orientations_deg, strict=False):
        stripe = np.array([(left, -half), (right, -half), (right, half), (left, half)])
        drawing.polygon(stripe, float(np.deg2rad(orientation % 180)), period_um)
    return drawn_sample(
        drawing,
        "facets",
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        phase_deg=phase_deg,
        retardation_deg=retardation_deg,
        film_axis_deg=film_axis_deg,
        ground_reflectance=ground_reflectance,
    )


_foresee_facets = foreseen


def _check_facets(*, orientations_deg: tuple[float, ...], period_um: float, **common: Any) -> None:
    """Refuse what cannot be drawn, before anything runs."""
    problems = []
    if not orientations_deg:
        problems.append(InputError("there is no stripe", where="orientations_deg", expected="an orientation or more"))
    if period_um <= 0:
        problems.append(InputError(f"period_um is {period_um}", where="period_um", expected="above 0"))
    refuse(problems, undrawable(**common))
