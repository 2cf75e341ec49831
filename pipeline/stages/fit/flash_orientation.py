"""Orientation of a tile's gratings from photographs of a sheet of tiles under a flash."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.data.flash import FlashPhotographs, Tiles
from pipeline.data.flash_maps import Highlights
from pipeline.data.gratings import OrientationMap
from pipeline.errors import InputError
from pipeline.limits import above_zero, at_least, refuse, within, zero_or_more
from pipeline.optics.flash.lobes import half_vectors
from pipeline.optics.flash.next_light import BINS, directions_seen
from pipeline.optics.flash.orientations import (
    AGREEMENT,
    BRIGHTNESS,
    ERROR,
    FEW,
    TANGENT,
    add_profile,
    by_lobe,
    by_threshold,
)
from pipeline.stages.fit._tile_views import Bench, Views, bench, over_blocks, spread_at_highlight

Float64Array = NDArray[np.float64]

_log = logging.getLogger(__name__)

_tolerance_flash_orientation = {
    "orientation_rad": 1e-2,
    "correlation": 1e-2,
    "intensity": 1e-5,
    "standard_error_rad": 1e-2,
    "metrics": 0.1,
}

_RANGE = 100.0
"""Of brightness through which the threshold is lowered, unless noise ends it before."""
_NOISE = 6.0
"""Standard deviations of what is dark that a pixel's brightest view has to rise above the rest."""
_PROFILE_STEP, _PROFILE_BINS = 0.01, 160
_DARK, _LIT = 0.02, 0.2
"""Of the brightest half vectors: below which lobes are not fitted, and above which a flash is said to show them."""
_EVERY = 8
"""Columns of which one tells how bright views usually are."""
_ROUNDS = 2
_TRIED = 400
"""Unknown pixels for which the next light is chosen."""
_CANDIDATES = 17
_COVERED_PERCENT = 0.5
_ROUGH_DEG = 3.0


def flash_orientation(
    photos: FlashPhotographs,
    tiles: Tiles,
    highlights: Highlights,
    *,
    method: Literal["lobe", "threshold"] = "lobe",
    photographs: int | None = None,
    steps: int = 24,
    floor: float | None = None,
    keep_off: float = 4.0,
    light_distance_mm: float | None = None,
    camera_distance_mm: float | None = None,
    light_sigma_mm: float | None = None,
    coherence_um: float = 65.0,
) -> OrientationMap:
    """Read each pixel's tangent off the places on the sheet at which its repeats diffract.

    A pixel outside the highlight that is bright has its tangent along the half vector there, which points at the
    highlight; brightness says how surely. So a threshold is lowered step by step, and a pixel takes the axial mean of
    the directions of those of its repeats that pass first, weighted by brightness. Where they disagree by more than
    orders are wide, the brighter side is taken. ``lobe`` goes on from there: the brightness along the tangent is
    learned from all pixels, and each pixel's tangent is that whose lobe fits its bright and its dark views best.
    Pixels that no photograph lit stay unknown, NaN; the log says where the next flash would show most of them.

    Parameters
    ----------
    photos : FlashPhotographs
        Rectified, of L places of the flash; white light covers more than filtered light.
    tiles : Tiles
        Where the sheet repeats the tile; a single one for a sheet that repeats nothing.
    highlights : Highlights
        Of these photographs.
    method : {"lobe", "threshold"}
        The paper's threshold, or the fit of lobes that starts from it.
    photographs : int, optional
        How many of the photographs are read, the first ones; all by default, and where there are fewer.
    steps : int
        In which the threshold is lowered through two decades.
    floor : float, optional
        Brightness, relative to the brightest pixels, that a view has to rise above the other views of its pixel; by
        default six times the scatter of what is dark, at least a hundredth. Of fewer than eight views, the other
        pixels tell what is dark.
    keep_off : float
        Standard deviations of the highlight within which no pixel is read.
    light_distance_mm, camera_distance_mm : float, optional
        From the sheet, where the photographs do not know them: the flash then stands where the highlight puts it.
    light_sigma_mm : float, optional
        Extent of the flash; by default as the photographs state it, or as large as the highlights say.
    coherence_um : float
        Width 4 sigma_s of the coherence window; 65 um for sunlight.

    Returns
    -------
    OrientationMap
        Of the tile, absolute. ``standard_error_rad`` is that of the lobe, and of how far the tangent turns within a
        pixel and where tiles lie beside each other. ``intensity`` is the brightest view relative to the brightest
        pixels, ``correlation`` that of the lobe with the views, or the share of the views' brightness that agrees.

    Raises
    ------
    InputError
        Distances are missing, or nothing rises above the dark.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018),
    section 4.3.
    """
    _check_flash_orientation(
        photographs=photographs,
        steps=steps,
        floor=floor,
        keep_off=keep_off,
        light_distance_mm=light_distance_mm,
        camera_distance_mm=camera_distance_mm,
        light_sigma_mm=light_sigma_mm,
        coherence_um=coherence_um,
    )
    if photographs is not None:
        if photographs > len(photos.radiance):
            _log.info("there are %d photographs, not %d: all are read", len(photos.radiance), photographs)
        photos = replace(
            photos,
            radiance=photos.radiance[:photographs],
            valid=photos.valid[:photographs],
            light_mm=photos.light_mm[:photographs],
        )
        highlights = replace(
            highlights,
            place_mm=highlights.place_mm[:photographs],
            stated_mm=highlights.stated_mm[:photographs],
        )
    placed = bench(
        photos,
        highlights,
        light_distance_mm=light_distance_mm,
        camera_distance_mm=camera_distance_mm,
        light_sigma_mm=light_sigma_mm,
        coherence_um=coherence_um,
        keep_off=keep_off,
    )
    peak, usual, dark = _levels(photos, tiles, placed)
    least = floor * peak if floor is not None else max(_NOISE * dark, peak / _RANGE)
    found = np.full((4, *tiles.shape), np.nan, np.float32)
    ratio = _RANGE ** (-1 / steps)

    parts: dict[int, Float64Array] = {}

    def threshold(views: Views, rows: slice) -> None:
        by_threshold(views.brightness, views.azimuth, views.width, peak, usual, least, ratio, found[:, rows])
        parts[rows.start] = _along_tangents(views, found[:, rows])

    over_blocks(photos, tiles, placed, threshold)
    mask = np.isfinite(found[TANGENT])
    if not mask.any():
        raise InputError(
            "no pixel outside the highlights rises above the dark",
            expected="photographs that show orders of diffraction around the highlight",
        )
    if method == "lobe":
        _fit_lobes(photos, tiles, placed, parts, found)
    found[ERROR] = np.hypot(found[ERROR], _turn_within(found[TANGENT], tiles))
    metrics = _figures(mask, found)
    if metrics["stated_error_median_deg"] > _ROUGH_DEG:
        _log.warning("half of the tile is known to within %.1f degrees at best", metrics["stated_error_median_deg"])
    if 100 - metrics["lit_percent"] > _COVERED_PERCENT:
        proposal = _next_light(photos, tiles, placed, mask, _profile(parts))
        if proposal is not None:
            (x, y, z), share = proposal
            metrics |= {
                "next_light_x_mm": x,
                "next_light_y_mm": y,
                "next_light_z_mm": z,
                "next_light_shows_percent": share,
            }
            _log.warning(
                "%.1f percent of the tile are not lit in %s. A flash at (%.0f, %.0f, %.0f) mm would show %.0f percent "
                "of the directions that they may have.",
                *(100 - metrics["lit_percent"], _counted(len(photos.radiance)), x, y, z, share),
            )
    return OrientationMap(
        orientation_rad=found[TANGENT],
        correlation=found[AGREEMENT],
        intensity=found[BRIGHTNESS] / np.float32(peak),
        mask=mask,
        pixel_mm=tiles.pixel_mm,
        absolute=True,
        standard_error_rad=found[ERROR],
        metrics=metrics,
    )


def _counted(photographs: int) -> str:
    return "the first photograph" if photographs == 1 else f"{photographs} photographs"


def _levels(photos: FlashPhotographs, tiles: Tiles, placed: Bench) -> tuple[float, float, float]:
    """Brightness of the brightest pixels outside highlights, of views as most are, and the scatter of what is dark."""
    brightest = np.zeros(tiles.shape, np.float32)
    darkest = np.zeros(tiles.shape, np.float32)
    some: dict[int, NDArray[np.float32]] = {}

    def read(views: Views, rows: slice) -> None:
        known = np.nan_to_num(views.brightness, nan=-1.0)
        brightest[rows] = known.max(axis=0)
        lower = np.sort(np.where(known < 0, np.inf, known), axis=0)[: max(len(known) // 4, 1)]
        darkest[rows] = np.where(np.isfinite(lower), lower, 0).std(axis=0)
        some[rows.start] = known[..., ::_EVERY].ravel()

    over_blocks(photos, tiles, placed, read)
    seen = np.concatenate(list(some.values()))
    seen = seen[seen >= 0]
    usual = float(np.median(seen)) if seen.size else 0.0
    few = len(photos.radiance) * len(tiles.homographies) < FEW
    dark = 1.4826 * np.median(np.abs(seen - usual)) if few and seen.size else np.median(darkest)
    return float(np.percentile(brightest, 99.5)), usual, float(dark)


def _fit_lobes(
    photos: FlashPhotographs, tiles: Tiles, placed: Bench, parts: dict[int, Float64Array], found: NDArray[np.float32]
) -> None:
    """Learn the brightness along the tangent and improve the tangents, in turn; both in one pass over the views."""
    for _ in range(_ROUNDS):
        profile = _profile(parts)
        profile[profile < _DARK * profile.max()] = 0

        def improve(views: Views, rows: slice, profile: Float64Array = profile) -> None:
            by_lobe(*_lobe_views(views), profile, _PROFILE_STEP, found[:, rows])
            parts[rows.start] = _along_tangents(views, found[:, rows])

        over_blocks(photos, tiles, placed, improve)


def _along_tangents(views: Views, found: NDArray[np.float32]) -> Float64Array:
    """What some rows add to the brightness of lobes along their tangent, shape (2, K)."""
    part = np.zeros((2, _PROFILE_BINS))
    add_profile(*_lobe_views(views), found, _PROFILE_STEP, part)
    return part


def _profile(parts: dict[int, Float64Array]) -> Float64Array:
    """Brightness of lobes along their tangent, in bins of the half vector's length."""
    bright, weight = np.sum([parts[first] for first in sorted(parts)], axis=0)
    return np.asarray(bright / np.maximum(weight, 1e-30))


def _lobe_views(views: Views) -> tuple[NDArray[np.float32], ...]:
    """Brightness, direction, width, half vector and gain of each view."""
    return views.brightness, views.azimuth, views.width, views.length, views.gain


def _turn_within(tangent: NDArray[np.float32], tiles: Tiles) -> NDArray[np.float32]:
    """By how much the tangent turns over a pixel's size, and over what tiles lie beside each other."""
    beside = float(np.nanmedian(tiles.residual_px)) if np.isfinite(tiles.residual_px).any() else 0.0
    double = np.exp(2j * np.nan_to_num(tangent))
    known = np.isfinite(tangent)
    square = np.zeros(tangent.shape)
    for axis in (0, 1):
        for step in (1, -1):
            turn = np.angle(np.roll(double, step, axis) * double.conj()) / 2
            square += np.where(known & np.roll(known, step, axis), turn, 0) ** 2 / 2
    return np.sqrt(square * (beside**2 + 1 / 12)).astype(np.float32)


def _figures(mask: NDArray[np.bool_], found: NDArray[np.float32]) -> dict[str, float]:
    return {
        "lit_percent": 100 * float(mask.mean()),
        "stated_error_median_deg": float(np.rad2deg(np.nanmedian(found[ERROR]))),
        "agreement_mean": float(np.nanmean(found[AGREEMENT], dtype=np.float64)),
    }


def _next_light(
    photos: FlashPhotographs, tiles: Tiles, placed: Bench, mask: NDArray[np.bool_], profile: Float64Array
) -> tuple[tuple[float, float, float], float] | None:
    """Where a light shows most of the directions that the unknown pixels may have, and how many percent of them."""
    row, column = np.nonzero(~mask)
    few = np.linspace(0, len(row) - 1, min(len(row), _TRIED)).astype(int)
    place = np.stack([column[few], row[few], np.ones(len(few))])
    on_sheet = np.einsum("tij,jp->tip", tiles.homographies, place)
    rows, columns = photos.valid.shape[1:]
    x = (on_sheet[:, 0] / on_sheet[:, 2] - (columns - 1) / 2) * tiles.pixel_mm
    y = ((rows - 1) / 2 - on_sheet[:, 1] / on_sheet[:, 2]) * tiles.pixel_mm
    bright = np.flatnonzero(profile > _LIT * profile.max())
    lit = float(bright[0]) * _PROFILE_STEP, float(bright[-1] + 1) * _PROFILE_STEP
    width = 2 * spread_at_highlight(placed, tiles.pixel_mm) / float(np.mean(lit))

    def seen(light: NDArray[np.float64]) -> NDArray[np.bool_]:
        half = half_vectors(x, y, light, placed.eye_mm)
        return directions_seen(half.azimuth_rad, half.length, width, lit)

    known = np.zeros((len(few), BINS), bool)
    for light in placed.light_mm:
        known |= seen(light)
    if known.all():
        return None
    height = float(np.median(placed.light_mm[:, 2]))
    across, up = columns * tiles.pixel_mm / 2, rows * tiles.pixel_mm / 2
    candidates = [
        (float(a), float(b), height)
        for a in np.linspace(-across, across, _CANDIDATES)
        for b in np.linspace(-up, up, _CANDIDATES)
    ]
    gains = [int((seen(np.array(one)) & ~known).sum()) for one in candidates]
    best = int(np.argmax(gains))
    return candidates[best], 100 * gains[best] / int((~known).sum())


def _check_flash_orientation(
    *,
    photographs: int | None,
    steps: int,
    floor: float | None,
    keep_off: float,
    light_distance_mm: float | None,
    camera_distance_mm: float | None,
    light_sigma_mm: float | None,
    coherence_um: float,
    **_: object,
) -> None:
    """Refuse impossible settings before anything runs."""
    refuse(
        at_least(1, "or nothing is read", photographs=photographs, steps=steps),
        within(0, 1, floor=floor),
        zero_or_more(keep_off=keep_off),
        above_zero(
            light_distance_mm=light_distance_mm,
            camera_distance_mm=camera_distance_mm,
            light_sigma_mm=light_sigma_mm,
            coherence_um=coherence_um,
        ),
    )
