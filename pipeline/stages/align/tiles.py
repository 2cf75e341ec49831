"""Where the tiles of a sheet lie."""

from __future__ import annotations

import logging
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.data.flash import FlashPhotographs, Tiles
from pipeline.errors import InputError
from pipeline.limits import refuse
from pipeline.optics.colour import LUMINANCE
from pipeline.optics.tile_alignment import (
    aligned,
    apart,
    corners_of,
    cut,
    likeness,
    of_one_sheet,
    shift_left,
    translation,
)
from pipeline.optics.tile_lattice import LEAST_TILE_PX, edges, lattice, placed
from pipeline.parallel import over_rows

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]

_SLACK = 0.02
_ONE_SHEET_PX = 0.5
"""Distance of tiles from where one homography for the sheet puts them, up to which that is preferred."""
_NO_BETTER = 1.25
"""Times as far as one homography leaves tiles off, up to which translation is preferred."""
_BESIDE_PX, _UNLIKE, _ASTRAY = 1.0, 0.1, 0.25
"""Pixels off and correlation that tell of a copy in a wrong place, and the share of such copies that is warned of."""
_LEAST_TILES = 4
_UNSURE = 0.4
_log = logging.getLogger(__name__)
_tolerance_tiles = {"homographies": 1e-2, "moved_px": 1e-1, "residual_px": 1e-1, "correlation": 1e-2}


def tiles(
    photos: FlashPhotographs,
    *,
    tile_mm: list[float] | None = None,
    corner_mm: list[float] | None = None,
    motion: Literal["auto", "translation", "sheet", "tile"] = "auto",
) -> Tiles:
    """Find the tiles that a rectified sheet repeats, and bring each onto a reference.

    Parameters
    ----------
    photos : FlashPhotographs
        Rectified; the photograph under room light shows the pattern.
    tile_mm : [width, height], optional
        Of the tile that was picked; by default it is found from the autocorrelation of the photograph under room light.
    corner_mm : [x, y], optional
        Top left corner of the tile that was picked, the reference. By default tiles begin in the sheet's top left
        corner, and the reference is the one nearest to the middle.
    motion : {"auto", "translation", "sheet", "tile"}
        ``translation``: tiles lie side by side, as the picked one is wide and high. ``tile``: each is brought onto the
        reference by a homography from its own edges. ``sheet``: by what these have in common, one lattice seen through
        one homography, which noise moves less. ``auto`` takes that where it leaves half a pixel at most, and
        ``translation`` where that does as well or there is no photograph under room light.

    Returns
    -------
    Tiles
        From pixels of the reference to those of the sheet.

    Raises
    ------
    InputError
        The photographs are not rectified, no pattern repeats in them, or the tile does not fit onto the sheet.

    Notes
    -----
    Toisoul, Dhillon and Ghosh 2018, sections 4.2 and 7.2, where tiles are translated.
    """
    _check_tiles(tile_mm=tile_mm, corner_mm=corner_mm)
    if photos.pixel_mm is None:
        raise InputError("the photographs are not rectified", expected="photos: a node with align.rectified")
    feature = None if photos.room is None else edges(np.asarray(photos.room @ np.asarray(LUMINANCE, np.float32)))
    shape, pitch = (photos.valid.shape[1], photos.valid.shape[2]), photos.pixel_mm
    steps, found = _steps(feature, tile_mm, pitch)
    size = (float(steps[0, 0]), abs(float(np.linalg.det(steps))) / float(steps[0, 0]))
    tile_shape = (round(size[1]), round(size[0]))
    numbers, origin, reference = _laid(shape, steps, size, corner_mm, pitch)
    start = np.stack([translation(*(origin + number @ steps)) for number in numbers])
    unknown = np.full(len(numbers), np.nan)
    if feature is None:
        if motion in ("sheet", "tile"):
            raise InputError("there is no photograph under room light", where="motion", expected="translation")
        return Tiles(start, tile_shape, reference, np.zeros(len(numbers)), unknown, unknown, pitch, None, found)
    pattern = np.nan_to_num(cut(feature, start[reference], tile_shape))
    chosen = start
    if motion != "translation":
        chosen, found["sheet_residual_px"] = _aligned(feature, pattern, start, numbers, steps, reference, motion)
    moved = np.array([_farthest(one, other, tile_shape) for one, other in zip(chosen, start, strict=True)])
    correlation, residual = unknown.copy(), unknown.copy()

    def judge(first: int, last: int) -> None:
        for k in range(first, last):
            correlation[k] = likeness(feature, pattern, chosen[k])
            residual[k] = shift_left(feature, pattern, chosen[k])

    over_rows(judge, len(chosen), tile=1)
    astray = float(((residual > _BESIDE_PX) | (correlation < _UNLIKE)).mean())
    found |= {
        "tiles": float(len(numbers)),
        "astray_percent": 100 * astray,
        "residual_px": float(np.nanmedian(residual)),
        "moved_px": float(np.max(moved)),
    }
    tell = _log.info if astray <= _ASTRAY else _log.warning
    tell(
        "%d tiles of %.4g x %.4g mm; %.0f percent lie more than a pixel beside the reference or do not look like it, "
        "half more than %.2g px",
        len(numbers),
        size[0] * pitch,
        size[1] * pitch,
        100 * astray,
        found["residual_px"],
    )
    seen = np.stack([cut(feature, homography, tile_shape) for homography in chosen])
    known = np.isfinite(seen).sum(axis=0)
    mean = np.where(known, np.nansum(seen, axis=0) / np.maximum(known, 1), np.nan).astype(np.float32)
    return Tiles(chosen, tile_shape, reference, moved, residual, correlation, pitch, mean, found)


def _check_tiles(*, tile_mm: list[float] | None, corner_mm: list[float] | None, **_: object) -> None:
    """Refuse impossible tiles before anything runs."""
    problems = []
    if tile_mm is not None and (len(tile_mm) != 2 or not min(tile_mm) > 0 or not np.isfinite(tile_mm).all()):
        problems.append(InputError(f"{tile_mm} is no size", where="tile_mm", expected="[width, height] in mm"))
    if corner_mm is not None and (len(corner_mm) != 2 or not np.isfinite(corner_mm).all()):
        problems.append(InputError(f"{corner_mm} is no place", where="corner_mm", expected="[x, y] in mm"))
    refuse(problems)


def _steps(
    feature: Float32Array | None, tile_mm: list[float] | None, pixel_mm: float
) -> tuple[Float64Array, dict[str, float]]:
    """Steps to the next tiles in pixels, and what is known of them."""
    if tile_mm is not None:
        steps = np.diag(tile_mm) / pixel_mm
        found: dict[str, float] = {}
    elif feature is None:
        raise InputError(
            "without a photograph under room light tiles are not found",
            where="tile_mm",
            expected="[width, height] in mm, or room in capture.yaml",
        )
    else:
        try:
            steps, likeliness = lattice(feature)
        except ValueError as problem:
            raise InputError(
                f"no tile is found: {problem}", where="tile_mm", expected="a pattern that repeats, or tile_mm"
            ) from None
        if likeliness < _UNSURE:
            _log.warning("the pattern repeats with a correlation of %.2g only: tile_mm picks a tile", likeliness)
        found = {"lattice_correlation": likeliness}
    found |= {"tile_width_mm": float(steps[0, 0]) * pixel_mm}
    found |= {"tile_height_mm": abs(float(np.linalg.det(steps))) / float(steps[0, 0]) * pixel_mm}
    if min(found["tile_width_mm"], found["tile_height_mm"]) < LEAST_TILE_PX * pixel_mm:
        raise InputError(
            f"tiles of {found['tile_width_mm']:.3g} x {found['tile_height_mm']:.3g} mm are too few pixels",
            where="tile_mm",
            expected=f"at least {LEAST_TILE_PX} pixels of {pixel_mm:.3g} mm",
        )
    return steps, found


def _laid(
    shape: tuple[int, int],
    steps: Float64Array,
    size: tuple[float, float],
    corner_mm: list[float] | None,
    pixel_mm: float,
) -> tuple[NDArray[np.int_], Float64Array, int]:
    """Numbers of the tiles on the sheet, where the first pixel of tile (0, 0) lies, and which one is the reference.

    The reference lies on whole pixels.
    """
    rows, columns = shape
    # Pixels' centres are whole numbers, so that the first one begins at -0.5.
    begin = np.zeros(2) if corner_mm is None else np.array(corner_mm) * (1, -1) / pixel_mm + (columns / 2, rows / 2)
    origin = begin.copy() if corner_mm is None else np.rint(begin)
    numbers = placed(shape, steps, origin, size, _SLACK)
    if not len(numbers):
        raise InputError("no whole tile lies on the sheet", where="tile_mm", expected="a tile smaller than the sheet")
    if corner_mm is None:
        middle = origin + numbers @ steps + np.array(size) / 2 - (columns / 2, rows / 2)
        reference = int(np.argmin(np.hypot(*middle.T)))
        there = origin + numbers[reference] @ steps
        return numbers, origin + np.rint(there) - there, reference
    chosen = np.flatnonzero(~numbers.any(axis=1))
    if not chosen.size:
        raise InputError("the picked tile does not lie on the sheet", where="corner_mm", expected="its top left corner")
    return numbers, origin, int(chosen[0])


def _aligned(
    feature: Float32Array,
    pattern: Float32Array,
    start: Float64Array,
    numbers: NDArray[np.int_],
    steps: Float64Array,
    reference: int,
    motion: Literal["auto", "translation", "sheet", "tile"],
) -> tuple[Float64Array, float]:
    """Homographies of the tiles, and how far those of single tiles lie off one lattice seen through one homography."""
    own, shape = start.copy(), (pattern.shape[0], pattern.shape[1])

    def align(first: int, last: int) -> None:
        for k in range(first, last):
            own[k] = aligned(feature, pattern, start[k])

    over_rows(align, len(start), tile=1)
    own[reference] = start[reference]
    if len(start) < _LEAST_TILES:
        return own, np.nan
    together, residual = of_one_sheet(own, numbers, steps, shape, reference)
    if motion == "tile" or (motion == "auto" and residual > _ONE_SHEET_PX):
        chosen, how = own, "each tile has a homography of its own"
    elif motion == "auto" and apart(start, own, shape) <= _NO_BETTER * residual:
        chosen, how = start, "translation does as well"
    else:
        chosen, how = together, "one homography brings all tiles to the reference"
    _log.info("%s; tiles lie %.2g px off one lattice seen through one homography", how, residual)
    return chosen, residual


def _farthest(one: Float64Array, other: Float64Array, shape: tuple[int, int]) -> float:
    return float(np.linalg.norm(corners_of(one, shape) - corners_of(other, shape), axis=1).max())
