"""A sheet of small shapes whose gratings are drawn at random from a joint distribution."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.data.flash_maps import GratingDistribution
from pipeline.data.gratings import GratingSample
from pipeline.devices.drawn_sample import drawn_sample, foreseen, undrawable
from pipeline.limits import above_zero, above_zero_up_to, refuse, zero_or_more
from pipeline.optics.drawing import Drawing

Float64Array = NDArray[np.float64]


def stochastic_texture(
    distribution: GratingDistribution,
    *,
    width_mm: float = 280.0,
    height_mm: float = 196.0,
    pixel_mm: float = 0.2,
    shape: Literal["squares", "discs"] = "squares",
    size_mm: float = 0.6,
    cover: float = 1.0,
    depth_um: float = 0.12,
    amplitude_ratio: float = 1.1,
    phase_deg: float = 45.0,
    retardation_deg: float = 3.0,
    film_axis_deg: float = 0.0,
    ground_reflectance: float = 0.03,
    seed: int = 0,
) -> GratingSample:
    """Draw squares side by side, or discs strewn over each other, each with a grating of its own.

    Each shape's orientation and period are drawn together from the distribution, evenly within a bin.

    Parameters
    ----------
    distribution : GratingDistribution
        How common each pair is, as drawn or as measured.
    width_mm, height_mm, pixel_mm : float
        Size of the sheet, and pitch of the map.
    shape : {"squares", "discs"}
        Squares of a lattice, or discs at random places.
    size_mm : float
        Side, or diameter.
    cover : float
        Share of the squares that carry a grating; area of all discs over that of the sheet, what lies under others
        included.
    depth_um, amplitude_ratio, phase_deg, retardation_deg, film_axis_deg, ground_reflectance : float
        Profile, zeroth order, film and ground, as in ``simulate.logo``.
    seed : int
        Of what is drawn.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018),
    section 4.5.
    """
    common = {"pixel_mm": pixel_mm, "depth_um": depth_um, "amplitude_ratio": amplitude_ratio}
    common |= {"ground_reflectance": ground_reflectance}
    _check_stochastic_texture(
        width_mm=width_mm, height_mm=height_mm, size_mm=size_mm, cover=cover, seed=seed, shape=shape, **common
    )
    drawing = Drawing(round(width_mm / pixel_mm), pixel_mm, rows=round(height_mm / pixel_mm))
    rng = np.random.default_rng(seed)
    if shape == "squares":
        _squares(drawing, distribution, size_mm, cover, rng)
    else:
        _discs(drawing, distribution, size_mm, cover, rng, (width_mm, height_mm))
    return drawn_sample(
        drawing,
        "stochastic paper",
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        phase_deg=phase_deg,
        retardation_deg=retardation_deg,
        film_axis_deg=film_axis_deg,
        ground_reflectance=ground_reflectance,
    )


def drawn_gratings(
    distribution: GratingDistribution, count: int, rng: np.random.Generator
) -> tuple[Float64Array, Float64Array]:
    """Orientations and periods of so many gratings, shape (count,) each."""
    share = distribution.share.ravel() / distribution.share.sum()
    row, column = np.divmod(rng.choice(share.size, count, p=share), distribution.share.shape[1])
    step = np.pi / len(distribution.orientation_rad)
    pitch = float(distribution.period_um[1] - distribution.period_um[0])
    orientation = distribution.orientation_rad[row] + (rng.random(count) - 0.5) * step
    return np.mod(orientation, np.pi), distribution.period_um[column] + (rng.random(count) - 0.5) * pitch


def _squares(
    drawing: Drawing, distribution: GratingDistribution, size_mm: float, cover: float, rng: np.random.Generator
) -> None:
    row, column = (
        np.floor((centres - centres.min()) / size_mm + 1e-6).astype(int) for centres in (drawing.y_mm, drawing.x_mm)
    )
    shape = row.max() + 1, column.max() + 1
    orientation, period = drawn_gratings(distribution, shape[0] * shape[1], rng)
    period[rng.random(period.size) >= cover] = np.nan
    orientation[np.isnan(period)] = np.nan
    drawing.orientation_rad[:] = _below_pi(orientation).reshape(shape)[np.ix_(row, column)]
    drawing.period_um[:] = period.reshape(shape)[np.ix_(row, column)]


def _discs(
    drawing: Drawing,
    distribution: GratingDistribution,
    size_mm: float,
    cover: float,
    rng: np.random.Generator,
    extent_mm: tuple[float, float],
) -> None:
    width, height = extent_mm
    count = round(cover * width * height / (np.pi * size_mm**2 / 4))
    orientation, period = drawn_gratings(distribution, count, rng)
    x, y = rng.uniform(-width / 2, width / 2, count), rng.uniform(-height / 2, height / 2, count)
    for one in zip(x.tolist(), y.tolist(), _below_pi(orientation).tolist(), period.tolist(), strict=True):
        drawing.annulus(one[:2], (0.0, size_mm / 2), one[2], one[3])


def _below_pi(orientation: Float64Array) -> NDArray[np.float32]:
    """In single precision, in which what is just below pi would be rounded up to more than it."""
    single = orientation.astype(np.float32)
    return np.where(single >= np.pi, np.float32(0), single)


_foresee_stochastic_texture = foreseen


def _check_stochastic_texture(
    *, width_mm: float, height_mm: float, size_mm: float, cover: float, seed: int, shape: str, **common: Any
) -> None:
    """Refuse what cannot be drawn, before anything runs."""
    refuse(
        above_zero(height_mm=height_mm, size_mm=size_mm),
        above_zero_up_to(1 if shape == "squares" else 20, cover=cover),
        zero_or_more(seed=seed),
        undrawable(width_mm=width_mm, margin_mm=0.0, **common),
        undrawable(width_mm=height_mm, margin_mm=0.0, **common) if height_mm > width_mm > 0 else [],
    )
