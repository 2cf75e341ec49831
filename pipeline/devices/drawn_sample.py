"""A drawing made a sample: the optics that all printed samples share, and their limits."""

from __future__ import annotations

import numpy as np

from pipeline.data.gratings import GratingSample
from pipeline.errors import InputError
from pipeline.limits import above_zero, zero_or_more
from pipeline.optics.drawing import Drawing

LARGEST_SIDE = 20_000


def blank(*, width_mm: float, margin_mm: float, pixel_mm: float) -> Drawing:
    """An empty drawing of a width, and of the ground around it."""
    return Drawing(round((width_mm + 2 * margin_mm) / pixel_mm), pixel_mm)


def foreseen(*, pixel_mm: float, **_: object) -> dict[str, float]:
    """What is known of a sample before it is drawn, so that what is to photograph it can refuse it."""
    return {"pixel_mm": pixel_mm}


def drawn_sample(
    drawing: Drawing,
    name: str,
    *,
    depth_um: float,
    amplitude_ratio: float,
    phase_deg: float,
    retardation_deg: float,
    film_axis_deg: float,
    ground_reflectance: float,
) -> GratingSample:
    """The sample that a drawing shows, under one film and with one kind of grating throughout.

    Parameters
    ----------
    drawing : Drawing
        Orientation and period.
    name : str
        What is drawn.
    depth_um : float
        Peak-to-valley depth of the sinusoidal profile.
    amplitude_ratio, phase_deg : float
        ``R = r exp(i zeta)`` of the zeroth order.
    retardation_deg, film_axis_deg : float
        One pass through the protective film, and the direction of its axis.
    ground_reflectance : float
        Of the unpolarised ground, relative to the zeroth order of the longest period.
    """
    return GratingSample(
        orientation_rad=drawing.orientation_rad,
        period_um=drawing.period_um,
        pixel_mm=drawing.pixel_mm,
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        phase_rad=float(np.deg2rad(phase_deg)),
        retardation_rad=float(np.deg2rad(retardation_deg)),
        film_axis_rad=float(np.deg2rad(film_axis_deg)),
        ground_reflectance=ground_reflectance,
        name=name,
    )


def undrawable(
    *,
    width_mm: float,
    margin_mm: float,
    pixel_mm: float,
    depth_um: float,
    amplitude_ratio: float,
    ground_reflectance: float,
    **_: object,
) -> list[InputError]:
    """What keeps a sample of such a size, and of such optics, from being drawn."""
    problems = above_zero(width_mm=width_mm, pixel_mm=pixel_mm) + zero_or_more(
        margin_mm=margin_mm,
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        ground_reflectance=ground_reflectance,
    )
    side = (width_mm + 2 * margin_mm) / pixel_mm if not problems else 1
    if not 1 <= side <= LARGEST_SIDE:
        problems.append(
            InputError(
                f"the map would have {side:.0f} points a side", where="pixel_mm", expected=f"1 to {LARGEST_SIDE} points"
            )
        )
    return problems


def unordered_periods(periods_um: tuple[float, ...], count: int) -> list[InputError]:
    """What is wrong with ``count`` periods that begin with the longest."""
    words = {2: "two", 3: "three"}
    if len(periods_um) == count and max(periods_um) == periods_um[0] and min(periods_um) > 0:
        return []
    right = f"{words[count]} periods above 0, the longest first"
    return [InputError(f"periods_um is {list(periods_um)}", where="periods_um", expected=right)]
