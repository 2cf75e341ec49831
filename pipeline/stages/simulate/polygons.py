"""A tile of polygons that repeats, each of one orientation."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import GratingSample
from pipeline.devices.drawn_sample import blank, drawn_sample, foreseen, undrawable
from pipeline.errors import InputError
from pipeline.limits import above_zero, at_least, refuse, zero_or_more

_LLOYD_STEPS = 4


def polygons(
    *,
    width_mm: float = 28.0,
    pixel_mm: float = 0.1,
    count: int = 14,
    orientations: int = 8,
    first_deg: float = 10.0,
    period_um: float = 1.6666666666666667,
    longest_um: float | None = None,
    depth_um: float = 0.12,
    seam_mm: float = 0.0,
    amplitude_ratio: float = 1.1,
    phase_deg: float = 45.0,
    retardation_deg: float = 3.0,
    film_axis_deg: float = 0.0,
    ground_reflectance: float = 0.03,
    seed: int = 3,
) -> GratingSample:
    """Draw the cells around points that are strewn over a tile; they go on across its edges.

    Parameters
    ----------
    width_mm, pixel_mm : float
        Side of the tile, and pitch of the map.
    count : int
        Polygons in the tile.
    orientations : int
        Different orientations, evenly spread over 180 degrees and dealt out in turn.
    first_deg : float
        The first of them.
    period_um, depth_um : float
        Of all gratings; the depth from peak to valley. By default 600 lines to a millimetre.
    longest_um : float, optional
        Instead of one period, as many as polygons, evenly from ``period_um`` to this one and dealt out.
    seam_mm : float
        Width of the ground between polygons.
    amplitude_ratio, phase_deg, retardation_deg, film_axis_deg, ground_reflectance : float
        Zeroth order, film and ground, as in ``simulate.logo``.
    seed : int
        Of the points, which are evened out by a few of Lloyd's steps.

    Returns
    -------
    GratingSample
        Square map of width / pixel points a side.

    Raises
    ------
    InputError, InputErrors
        Fewer than two polygons or one orientation, no period or width, or a map too large to draw.
    """
    common: dict[str, Any] = {"pixel_mm": pixel_mm, "depth_um": depth_um, "amplitude_ratio": amplitude_ratio}
    common |= {"ground_reflectance": ground_reflectance, "period_um": period_um, "seam_mm": seam_mm}
    common |= {"longest_um": longest_um}
    _check_polygons(width_mm=width_mm, count=count, orientations=orientations, seed=seed, **common)
    drawing = blank(width_mm=width_mm, margin_mm=0.0, pixel_mm=pixel_mm)
    x, y = np.meshgrid(drawing.x_mm, drawing.y_mm)
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-width_mm / 2, width_mm / 2, (count, 2))
    for _ in range(_LLOYD_STEPS):
        cell, _, away = _nearest(centres, x[::4, ::4], y[::4, ::4], width_mm)
        centres += [away[cell == k].mean(axis=0) if (cell == k).any() else (0.0, 0.0) for k in range(count)]
    cell, to_seam, _ = _nearest(centres, x, y, width_mm)
    dealt = rng.permutation(np.arange(count) % orientations)
    periods = np.linspace(period_um, longest_um or period_um, count)
    if longest_um is not None:
        periods = rng.permutation(periods)
    angles = np.deg2rad(first_deg) + np.pi * dealt / orientations
    window = drawing.window(-width_mm, -width_mm, width_mm, width_mm)
    for k in range(count):
        inside = (cell == k) & (to_seam >= seam_mm / 2)
        drawing.paint(window, inside, float(angles[k]), float(periods[k]))
    return drawn_sample(
        drawing,
        "polygons",
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        phase_deg=phase_deg,
        retardation_deg=retardation_deg,
        film_axis_deg=film_axis_deg,
        ground_reflectance=ground_reflectance,
    )


_foresee_polygons = foreseen


def _check_polygons(
    *,
    width_mm: float,
    count: int,
    orientations: int,
    period_um: float,
    longest_um: float | None,
    seam_mm: float,
    seed: int,
    **common: Any,
) -> None:
    """Refuse what cannot be drawn, before anything runs."""
    problems: list[InputError] = []
    if orientations > count:
        problems.append(
            InputError(
                f"{orientations} orientations for {count} polygons",
                where="orientations",
                expected=f"at most one for each polygon, {count}",
            )
        )
    refuse(
        problems if count >= 2 else [],
        at_least(2, "so that there are edges", count=count),
        at_least(1, "or nothing diffracts", orientations=orientations),
        above_zero(period_um=period_um, longest_um=longest_um),
        zero_or_more(seam_mm=seam_mm, seed=seed),
        undrawable(width_mm=width_mm, margin_mm=0.0, **common),
    )


def _nearest(
    centres: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64], width: float
) -> tuple[NDArray[np.intp], NDArray[np.float64], NDArray[np.float64]]:
    """The nearest centre on a torus, the distance from the bisector with the next one, and the way from the centre."""
    ways = np.stack([x[..., None] - centres[:, 0], y[..., None] - centres[:, 1]], axis=-1)
    ways -= width * np.rint(ways / width)
    square = (ways**2).sum(axis=-1)
    first, second = np.moveaxis(np.argsort(square, axis=-1)[..., :2], -1, 0)
    picked = np.take_along_axis(ways, first[..., None, None], axis=-2)[..., 0, :]
    nearest, next_one = (np.take_along_axis(square, k[..., None], axis=-1)[..., 0] for k in (first, second))
    between = np.take_along_axis(ways, second[..., None, None], axis=-2)[..., 0, :] - picked
    gap = np.hypot(between[..., 0], between[..., 1])
    return first, (next_one - nearest) / (2 * np.maximum(gap, 1e-12)), picked
