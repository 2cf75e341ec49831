"""A sheet of gratings, tiled and perhaps bumpy, seen by any camera, by the reference or from a table of colours."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from operator import or_
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.devices.sheet_theory import warn_of_theory
from pipeline.devices.virtual_light import Image, Lighting, add_light, warn_of_aliasing, white_level
from pipeline.errors import InputError
from pipeline.optics.colour import encode_srgb
from pipeline.optics.gratings import window_spread
from pipeline.optics.sheet import tabulated
from pipeline.optics.sheet.colour_table import ColourTable, Precision, colour_table
from pipeline.optics.sheet.extent import Extent, extent
from pipeline.optics.sheet.maps import Bumps, Tiled, prepared_gratings, sample_rows, slope_rows
from pipeline.optics.sheet.view import View
from pipeline.parallel import over_rows
from pipeline.progress import advance

Evaluator = Literal["auto", "spectral", "tabulated"]

_WORTH_A_TABLE = 200_000
"""Pixels and lights below which the sum is done before a table would be made and checked."""
_CHECKED = 128
"""Pixels along a side of the picture on which a choice is tried."""
MOST_SAMPLES = 32
"""Along a side of a pixel."""
_MOST_CHOSEN = 16
_LIT = 1e-3
"""Of the brightest, below which a display shows next to nothing."""
_SHORTEST_UM = 0.38

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Sheet:
    """What hangs before the camera.

    Attributes
    ----------
    orientation_rad, period_um : ndarray of shape (M, N)
        Maps of a tile; NaN stays dark.
    pixel_mm : float
        Pitch of the maps.
    tiles : tuple of int
        How often they repeat along x and along y.
    bumps : Bumps or None
        Slopes of a sheet that is not flat.
    """

    orientation_rad: NDArray[np.floating]
    period_um: NDArray[np.floating]
    pixel_mm: float
    tiles: tuple[int, int] = (1, 1)
    bumps: Bumps | None = None

    def laid(self, planes: Image) -> Tiled:
        """Maps of the tile, side by side."""
        return Tiled(planes, self.pixel_mm, self.tiles)

    @cached_property
    def gratings(self) -> Tiled:
        """The tile's maps as look-ups take them, side by side."""
        return self.laid(prepared_gratings(self.orientation_rad, self.period_um))

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height."""
        rows, columns = self.orientation_rad.shape
        return columns * self.tiles[0] * self.pixel_mm, rows * self.tiles[1] * self.pixel_mm


@dataclass(frozen=True)
class Sampling:
    """How a pixel's area is covered.

    Attributes
    ----------
    samples : int
        Points along each side of it.
    pixel_part : float
        Side of the area, in pixels, over which each point's lobes are averaged; 0 where that changes nothing.
    """

    samples: int
    pixel_part: float


POINTS = Sampling(1, 0.0)
"""One point in the middle of each pixel."""


def automatic_sampling(
    sheet: Sheet, view: View, lighting: Lighting, *, samples: int | None, tolerance: float
) -> Sampling:
    """The least points to a pixel of which twice as many change little, and lobes averaged where they change within it.

    Twice as many along a side are compared on some of the pixels, by the root mean square of what a display shows.
    """
    most = most_samples(sheet, view)
    if samples is None and most > 1 and np.isfinite(sheet.period_um).any():
        samples = enough_samples(_averaged(sheet, view, lighting, most, tolerance), most, tolerance)
    samples = samples or 1
    part = _pixel_part(sheet, view, lighting, samples, tolerance)
    if part:
        _log.info("Lobes that change within a pixel are averaged over it.")
    return Sampling(samples, part)


def _pixel_part(sheet: Sheet, view: View, lighting: Lighting, samples: int, tolerance: float) -> float:
    """Side of the area of a sample, or 0 where lobes hardly change over it."""
    occurring = _extents(sheet, view, lighting, 1 / samples)
    narrowest = window_spread(_SHORTEST_UM, lighting.coherence_um) ** 2 + occurring.light_variance[0]
    return 1 / samples if occurring.pixel_variance > tolerance * narrowest else 0.0


def most_samples(sheet: Sheet, view: View) -> int:
    """Points of the maps along a side of a pixel, of which more would show nothing new; not too many."""
    return min(_MOST_CHOSEN, max(1, int(np.ceil(_pixel_mm(sheet, view) / sheet.pixel_mm - 0.01))))


def enough_samples(averaged: Callable[[int], Image], most: int, tolerance: float) -> int:
    """Points along a side of a pixel of which twice as many change little; says so.

    Parameters
    ----------
    averaged : callable
        The picture, shape (..., 3), by so many points along a side.
    most : int
        Of these at most.
    tolerance : float
        Root mean square of what a display shows.
    """
    samples, picture, left = 1, averaged(1), 0.0
    while True:
        finer = averaged(2 * samples)
        lit = finer.max(axis=-1) > _LIT * finer.max()
        if lit.any():
            white = white_level(finer, 99.5)
            change = encode_srgb(finer[lit] / white) - encode_srgb(picture[lit] / white)
            left = float(np.sqrt(np.mean(change**2)))
        if left <= tolerance or samples >= most:
            break
        samples, picture = 2 * samples, finer
    enough = left <= tolerance
    (_log.info if enough else _log.warning)(
        "Each pixel is the mean of %d x %d points; twice as many a side change what is shown by %.2g percent%s.",
        samples,
        samples,
        100 * left,
        "" if enough else f": samples={2 * samples} averages those, and takes four times as long",
    )
    return samples


def _averaged(sheet: Sheet, view: View, lighting: Lighting, most: int, tolerance: float) -> Callable[[int], Image]:
    """Some of the pixels, by points along their sides."""
    few, every = _few(view)
    table = None
    if few.rows * few.columns * len(lighting.lights_mm) * (2 * most) ** 2 >= _WORTH_A_TABLE:
        with suppress(ValueError):
            table = _table(sheet, view, lighting, 1.0, tolerance, "single")

    def painted(seen: View, part: float) -> Paint:
        if table is None:
            return _summed(sheet, seen, lighting, part)
        return _looked_up(sheet, seen, lighting, part, table)

    def mean(samples: int) -> Image:
        rgb = np.zeros((len(lighting.lights_mm), few.rows, few.columns, 3), np.float32)
        part = _pixel_part(sheet, view, lighting, samples, tolerance) / every
        for across, down in offsets(samples):
            paint = painted(few.moved(across / every, down / every), part)
            for picture, light in zip(rgb, lighting.lights_mm, strict=True):
                paint(picture, light)
        return rgb / np.float32(samples**2)

    return mean


def render_sheet(
    sheet: Sheet,
    view: View,
    lighting: Lighting,
    *,
    evaluator: Evaluator = "spectral",
    sampling: Sampling = POINTS,
    tolerance: float = 0.01,
    precision: Precision = "single",
    together: bool = False,
) -> Image:
    """Relative radiance of a sheet under lights, linear sRGB of shape (lights, rows, columns, 3).

    Parameters
    ----------
    sheet, view, lighting : Sheet, View, Lighting
        What is seen, by whom, and in what light.
    evaluator : {"auto", "spectral", "tabulated"}
        The sum over wavelengths in double precision, a look-up, or the second where it pays and is found to be right.
    sampling : Sampling
        How a pixel's area is covered.
    tolerance : float
        Largest error of a look-up, relative to white.
    precision : {"single", "double"}
        Of look-ups.
    together : bool
        Add all lights up to one picture.
    """
    count = len(lighting.lights_mm)
    rgb = np.zeros((1 if together else count, view.rows, view.columns, 3), np.float32)
    if not np.isfinite(sheet.period_um).any():
        return rgb
    warn_of_theory(
        sheet.period_um,
        depth_um=lighting.depth_um,
        orders=lighting.orders,
        illuminant=lighting.illuminant,
        tolerance=tolerance,
    )
    add = _chosen(sheet, view, lighting, evaluator, sampling, tolerance, precision)
    steps = count * sampling.samples**2
    done = 0
    for sample in offsets(sampling.samples):
        paint = add(view.moved(*sample))
        for index, light in enumerate(lighting.lights_mm):
            paint(rgb[0 if together else index], light)
            done += 1
            advance(done, steps)
    rgb /= np.float32(sampling.samples**2)
    return rgb


Paint = Callable[[Image, NDArray[np.float64]], None]


def _chosen(
    sheet: Sheet,
    view: View,
    lighting: Lighting,
    evaluator: Evaluator,
    sampling: Sampling,
    tolerance: float,
    precision: Precision,
) -> Callable[[View], Paint]:
    """What paints a view, by the evaluator that is asked for, or that pays."""
    work = view.rows * view.columns * len(lighting.lights_mm) * sampling.samples**2
    by_sum = evaluator == "spectral" or lighting.band_nm is not None
    if by_sum or (evaluator == "auto" and work < _WORTH_A_TABLE):
        warn_of_aliasing(sheet.period_um, lighting)
        return lambda seen: _summed(sheet, seen, lighting, sampling.pixel_part)
    try:
        table = _table(sheet, view, lighting, sampling.pixel_part, tolerance, precision)
    except ValueError as problem:
        if evaluator == "tabulated":
            raise InputError(str(problem), where="evaluator", expected="spectral, or a larger tolerance") from None
        _log.info("The spectrum is summed: %s.", problem)
        warn_of_aliasing(sheet.period_um, lighting)
        return lambda seen: _summed(sheet, seen, lighting, sampling.pixel_part)
    error = _error(sheet, view, lighting, sampling.pixel_part, table)
    told = f"from its sum on a part of the pixels by up to {100 * error:.2g} percent of white"
    if error <= tolerance:
        _log.info("Colours are looked up in a table of %s; they differ %s.", table, told)
    elif evaluator == "auto":
        _log.info("A table would differ %s, so that the spectrum is summed.", told)
        warn_of_aliasing(sheet.period_um, lighting)
        return lambda seen: _summed(sheet, seen, lighting, sampling.pixel_part)
    else:
        _log.warning("Colours looked up in a table of %s differ %s; evaluator=spectral sums them.", table, told)
    return lambda seen: _looked_up(sheet, seen, lighting, sampling.pixel_part, table)


def _summed(sheet: Sheet, view: View, lighting: Lighting, pixel_part: float) -> Paint:
    planes = sheet.laid(np.stack([sheet.orientation_rad, sheet.period_um]).astype(np.float32))
    (orientation, period), slopes = shown(planes, view), shown_slopes(sheet, view)

    def paint(picture: Image, light_mm: NDArray[np.float64]) -> None:
        add_light(picture, orientation, period, view, light_mm, lighting, slopes=slopes, pixel_part=pixel_part)

    return paint


def _looked_up(sheet: Sheet, view: View, lighting: Lighting, pixel_part: float, table: ColourTable) -> Paint:
    gratings = shown(sheet.gratings, view).astype(table.orders.dtype, copy=False)
    slopes = shown_slopes(sheet, view)

    def paint(picture: Image, light_mm: NDArray[np.float64]) -> None:
        def shade(first: int, last: int) -> None:
            tabulated.shade_rows(
                picture,
                (first, last),
                gratings,
                view=view,
                light_mm=light_mm,
                light_sigma_mm=lighting.light_sigma_mm,
                table=table,
                slopes=slopes,
                pixel_part=pixel_part,
            )

        over_rows(shade, view.rows)

    return paint


def _table(
    sheet: Sheet, view: View, lighting: Lighting, pixel_part: float, tolerance: float, precision: Precision
) -> ColourTable:
    occurring = _extents(sheet, view, lighting, pixel_part)
    return colour_table(
        occurring,
        light=lighting.illuminant,
        coherence_um=lighting.coherence_um,
        depth_um=lighting.depth_um,
        periods_um=(float(np.nanmin(sheet.period_um)), float(np.nanmax(sheet.period_um))),
        orders=lighting.orders,
        tolerance=tolerance,
        normal_reflectance=lighting.normal_reflectance,
        precision=precision,
    )


def _error(sheet: Sheet, view: View, lighting: Lighting, pixel_part: float, table: ColourTable) -> float:
    """Largest difference of both evaluators on some of the pixels, relative to white."""
    few, every = _few(view)
    fine = replace(lighting, wavelength_step_nm=min(lighting.wavelength_step_nm, 2.0))
    pair = (
        _summed(sheet, few, fine, pixel_part / every),
        _looked_up(sheet, few, lighting, pixel_part / every, table),
    )
    worst = 0.0
    for light in lighting.lights_mm:
        exact, found = (np.zeros((few.rows, few.columns, 3), np.float32) for _ in pair)
        pair[0](exact, light)
        pair[1](found, light)
        worst = max(worst, float(np.abs(found - exact).max() / white_level(exact, 99.5)))
    return worst


def _few(view: View) -> tuple[View, int]:
    """Some of the pixels, and every how manieth along rows and columns."""
    every = max(1, -(-max(view.rows, view.columns) // _CHECKED))
    return view.thinned(every), every


def _extents(sheet: Sheet, view: View, lighting: Lighting, pixel_part: float) -> Extent:
    slopes = shown_slopes(sheet, view)
    return reduce(
        or_,
        (
            extent(view, light, lighting.light_sigma_mm, slopes, pixel_part, sheet.size_mm)
            for light in lighting.lights_mm
        ),
    )


def shown(maps: Tiled, view: View) -> Image:
    """What each pixel of a view shows of maps, shape (K, rows, columns); NaN beside the sheet."""
    out = np.empty((len(maps.planes), view.rows, view.columns), np.float32)
    over_rows(lambda first, last: sample_rows(maps, view, out, (first, last)), view.rows)
    return out


def shown_slopes(sheet: Sheet, view: View) -> Image | None:
    """Slopes of the sheet in each pixel of a view, shape (2, rows, columns); None of a flat one."""
    bumps = sheet.bumps
    if bumps is None:
        return None
    out = np.empty((2, view.rows, view.columns), np.float32)
    over_rows(lambda first, last: slope_rows(bumps, view, out, (first, last)), view.rows)
    return out


def _pixel_mm(sheet: Sheet, view: View) -> float:
    """Median side of a pixel on the sheet, the longer one."""
    column, row = np.meshgrid(np.linspace(0, view.columns - 1, 33), np.linspace(0, view.rows - 1, 33))
    place = view.points(column, row)
    seen = np.all(np.abs(place) <= np.array(sheet.size_mm) / 2, axis=-1)
    sides = [np.linalg.norm(view.points(column + dx, row + dy) - place, axis=-1)[seen] for dx, dy in ((1, 0), (0, 1))]
    return float(np.median(np.maximum(*sides))) if seen.any() else 0.0


def offsets(samples: int) -> Iterator[tuple[float, float]]:
    """Places of points within a pixel, to the right and down from its middle, in pixels."""
    places = (np.arange(samples) + 0.5) / samples - 0.5
    for down in places:
        for across in places:
            yield float(across), float(down)
