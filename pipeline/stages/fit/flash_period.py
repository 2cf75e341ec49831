"""Period of a tile's gratings from photographs of a sheet under a filtered flash."""

from __future__ import annotations

import logging
from dataclasses import replace
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.data.flash import FlashPhotographs, Tiles
from pipeline.data.flash_maps import Highlights
from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.errors import InputError
from pipeline.limits import above_zero, above_zero_up_to, refuse, zero_or_more
from pipeline.optics.flash.common_fit import DEPTHS_UM, Common, common_fit
from pipeline.optics.flash.constancy import SURE, error_of_common, verdict
from pipeline.optics.flash.lobes import FWHM
from pipeline.optics.flash.periods import Orders
from pipeline.stages.fit._distances import better_distances
from pipeline.stages.fit._period_scan import Scan, alone, along
from pipeline.stages.fit._tile_views import Bench, Views, bench, over_blocks, unordered

_log = logging.getLogger(__name__)

_tolerance_flash_period = {"period_um": 1e-3, "standard_error_um": 1e-2, "metrics": 0.1}

_STEP = 0.015
"""Of the periods tried, relative."""
_LEAST_RATIO = 1.1
"""Of the longest to the shortest: a best one of fewer steps is hardly told from their ends."""
_DOUBTFUL = 0.35
"""Relative standard error beyond which a pixel's period is not known."""
_WELL = 0.05
"""Residual up to which one period tells the light and the depth, lest those follow from orders that were mistaken."""
_UNEXPLAINED, _AT_BOUND = 0.18, 0.99
"""Residual, relative to brightness, and part of the largest depth, beyond which there is a warning.

Turns within pixels leave 0.17.
"""
_UNFILTERED_BANDWIDTH_NM = 100.0
"""About that of a camera's green channel."""

Array = NDArray[np.floating]


def flash_period(
    photos: FlashPhotographs,
    tiles: Tiles,
    highlights: Highlights,
    orientation: OrientationMap,
    *,
    method: Literal["modelled", "naive"] = "modelled",
    kind: Literal["auto", "constant", "varying"] = "auto",
    tolerance_percent: float = 1.0,
    share: float = 0.5,
    keep_off: float = 1.5,
    shortest_um: float = 0.7,
    longest_um: float = 4.0,
    wavelength_nm: float | None = None,
    light_distance_mm: float | None = None,
    camera_distance_mm: float | None = None,
    light_sigma_mm: float | None = None,
    coherence_um: float = 65.0,
) -> PeriodMap:
    """Read periods off where, around the highlight, a tile's repeats send light of one wavelength to the camera.

    The first order of wavelength lambda is seen where the half vector's part u along the tangent is lambda / a.
    ``naive`` is the paper's method: each bright view outside the highlight gives ``a = lambda / |u|``. It is biased,
    since a flash that is not small smears orders, and the highlight's flank lifts what lies on its side of them.
    ``modelled`` fits each pixel's views by the orders up to the second, each as wide as the flash, the coherence
    window, the filter's band and the pixel make it; the flash's extent and the share of the zeroth and the second
    order are fitted to all pixels together.

    Whether one number will do is tested: each pixel is measured twice, from either half of the tiles. What both
    measurements share is real, what they do not is error. Where the shared scatter is less than
    ``tolerance_percent`` or not significant (3 standard errors, by a jackknife over blocks), and lobes of one period
    leave less than a quarter of the brightness unexplained, that one, fitted to all views, is given to all pixels.

    Periods are as right as the distances of flash and camera. Where one number will do, both distances are tried a
    tenth shorter and longer, and there is a warning where that explains orders better; it does not show where tangents
    turn fast, in maps of periods, or below about a tenth.

    Parameters
    ----------
    photos : FlashPhotographs
        Rectified, with a filter.
    tiles, highlights : Tiles, Highlights
        Of the same sheet, and of these photographs.
    orientation : OrientationMap
        Of the tile.
    method : {"modelled", "naive"}
        The fit of lobes, or the paper's equation 3.
    kind : {"auto", "constant", "varying"}
        One period, a map, or what the test says.
    tolerance_percent : float
        Scatter of periods that is not worth a map.
    share : float
        Of the brightest: views that ``naive`` reads.
    keep_off : float
        Standard deviations of the highlight within which no pixel is read.
    shortest_um, longest_um : float
        Between which periods are sought.
    wavelength_nm : float, optional
        Of the light, where the photographs do not say; white light gives wrong periods.
    light_distance_mm, camera_distance_mm : float, optional
        From the sheet, where the photographs do not know them: the flash then stands where the highlight puts it.
    light_sigma_mm : float, optional
        Extent of the flash from which the fit starts.
    coherence_um : float
        Width 4 sigma_s of the coherence window; 65 um for sunlight.

    Returns
    -------
    PeriodMap
        Of the tile, absolute.

    Raises
    ------
    InputError
        The wavelength or a distance is not known, the orientation is of another tile, or nothing is bright.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018),
    sections 4.4 and 7.1, equation 3.
    """
    _check_flash_period(
        tolerance_percent=tolerance_percent,
        share=share,
        keep_off=keep_off,
        shortest_um=shortest_um,
        longest_um=longest_um,
        wavelength_nm=wavelength_nm,
        light_distance_mm=light_distance_mm,
        camera_distance_mm=camera_distance_mm,
        light_sigma_mm=light_sigma_mm,
        coherence_um=coherence_um,
    )
    if orientation.orientation_rad.shape != tuple(tiles.shape):
        raise InputError(
            f"an orientation map of {orientation.orientation_rad.shape} is not of a tile of {tuple(tiles.shape)}",
            expected="the map of the same tile",
        )
    orders = _orders(photos, wavelength_nm)
    placed = bench(
        photos,
        highlights,
        light_distance_mm=light_distance_mm,
        camera_distance_mm=camera_distance_mm,
        light_sigma_mm=light_sigma_mm,
        coherence_um=coherence_um,
        keep_off=keep_off,
    )
    if method == "naive":
        return _naive(photos, tiles, placed, orientation, orders, share=share, longest_um=longest_um)
    scan = Scan(photos, tiles, placed, orientation, np.exp(np.arange(np.log(shortest_um), np.log(longest_um), _STEP)))
    one, each = scan.common(_sure_ones(*scan.of(orders, placed)[0]), orders)
    common = one if one.residual < _WELL else min(one, each, key=lambda fit: fit.residual)
    found = scan.of(common.orders, replace(placed, light_sigma_mm=common.light_sigma_mm))
    settled = alone(orientation.orientation_rad)
    judged = verdict(np.where(settled, found, np.nan), one.residual, tolerance_percent)
    tell = _log.info if np.isfinite(judged.percent) else _log.warning
    tell("%s", judged.words)
    constant = judged.constant if kind == "auto" else kind == "constant"
    period, error = found[0].astype(np.float32)
    known = error < _DOUBTFUL * period
    sure = known & settled & (error < SURE * period)
    metrics = {"period_variation_percent": judged.percent, "period_constant": float(constant)}
    metrics |= {
        "one_period_residual_percent": 100 * one.residual,
        **_scatter(period[sure if sure.any() else np.isfinite(period)]),
    }
    mask = orientation.mask if constant else orientation.mask & known
    if constant:
        common = one
        _judge_distances(scan, one, orders)
        metrics["period_um"] = one.period_um or np.nan
        error = np.full_like(error, error_of_common(np.where(sure, period, np.nan)))
        period = np.full_like(period, metrics["period_um"])
    deepest = (common.orders.depth_um or 0.0) > _AT_BOUND * DEPTHS_UM[1]
    if common.residual > _UNEXPLAINED or deepest:
        _log.warning(
            "lobes leave %.0f percent of the brightness unexplained: periods are doubtful, and half of what they are "
            "where the second order outshines the first",
            100 * common.residual,
        )
    metrics |= {
        "light_sigma_mm": common.light_sigma_mm,
        "depth_um": common.orders.depth_um or 0.0,
        "lobe_residual_percent": 100 * common.residual,
    }
    return PeriodMap(
        period_um=np.where(mask, period, np.float32(np.nan)),
        mask=mask,
        pixel_mm=tiles.pixel_mm,
        relative=False,
        standard_error_um=np.where(mask, error, np.float32(np.nan)),
        metrics=metrics,
    )


def _judge_distances(scan: Scan, one: Common, orders: Orders) -> None:
    """Warn where orders fit better to a flash and a camera that are both nearer or farther than stated."""

    @cache
    def rescaled(factor: float) -> float:
        heights = np.array([1.0, 1.0, factor])
        placed = replace(scan.placed, light_mm=scan.placed.light_mm * heights, eye_mm=scan.placed.eye_mm * heights)
        start = {"period_um": factor * (one.period_um or np.nan), "light_sigma_mm": one.light_sigma_mm}
        return common_fit(replace(scan, placed=placed).sample(None), orders, **start).residual

    better = better_distances(one.residual, rescaled)
    if better is not None:
        _log.warning(
            "flash and camera %.2g times as far as stated leave %.2g instead of %.2g percent of the brightness "
            "unexplained: the period may be as wrong",
            *(better[0], 100 * better[1], 100 * one.residual),
        )


def _sure_ones(period_um: Array, error_um: Array) -> Array:
    """Periods of which no other fits nearly as well; all where there are none."""
    sure = np.where(error_um < SURE * period_um, period_um, np.nan)
    return sure if np.isfinite(sure).any() else period_um


def _orders(photos: FlashPhotographs, wavelength_nm: float | None) -> Orders:
    wavelength = wavelength_nm or photos.wavelength_nm
    if wavelength is None:
        raise InputError(
            "the photographs were taken without a filter",
            where="wavelength_nm",
            expected="photographs with one, and its wavelength_nm in capture.yaml: each wavelength is diffracted "
            "elsewhere",
        )
    if photos.wavelength_nm is None:
        _log.warning("without a filter all wavelengths are seen at once: periods are wrong")
    bandwidth = photos.bandwidth_nm or (_UNFILTERED_BANDWIDTH_NM if photos.wavelength_nm is None else 0.0)
    return Orders(wavelength / 1000, bandwidth / FWHM / 1000)


def _naive(
    photos: FlashPhotographs,
    tiles: Tiles,
    placed: Bench,
    orientation: OrientationMap,
    orders: Orders,
    *,
    share: float,
    longest_um: float,
) -> PeriodMap:
    """Each bright view's ``lambda / |u|``; a pixel takes their mean by brightness."""
    shape = tiles.shape
    peak = np.zeros(shape)
    least = orders.wavelength_um / longest_um

    def brightest(views: Views, rows: slice) -> None:
        outside = np.where(views.half.length > least, views.brightness, 0)
        peak[rows] = np.nan_to_num(outside).max(axis=0)

    over_blocks(photos, tiles, placed, brightest)
    if not orientation.mask.any():
        raise InputError("no orientation of the tile is known", expected="orientations of some pixels")
    level = share * float(np.percentile(peak[orientation.mask], 99.5))
    period = np.full(shape, np.nan, np.float32)
    every: list[NDArray[np.float64]] = []

    def read(views: Views, rows: slice) -> None:
        u, _, _ = along(views, orientation.orientation_rad[rows])
        with np.errstate(divide="ignore", invalid="ignore"):
            value = orders.wavelength_um / np.abs(u)
        bright = (views.brightness > level) & (value < longest_um)
        weight = np.where(bright, views.brightness, 0).astype(np.float64)
        total = weight.sum(axis=0)
        mean = np.where(bright, weight * value, 0).sum(axis=0) / np.where(total > 0, total, np.nan)
        period[rows] = mean
        every.append(value[bright])

    over_blocks(photos, tiles, placed, read)
    chosen = np.concatenate(every)
    if not chosen.size:
        raise InputError("no view outside the highlights is bright", where="share", expected="a lower one")
    mask = orientation.mask & np.isfinite(period)
    return PeriodMap(
        np.where(mask, period, np.float32(np.nan)), mask, tiles.pixel_mm, relative=False, metrics=_scatter(chosen)
    )


def _scatter(periods: Array) -> dict[str, float]:
    return {
        "period_mean_um": float(np.mean(periods, dtype=np.float64)),
        "period_std_um": float(np.std(periods, dtype=np.float64)),
        "period_min_um": float(np.min(periods)),
        "period_max_um": float(np.max(periods)),
    }


def _check_flash_period(
    *,
    tolerance_percent: float,
    share: float,
    keep_off: float,
    shortest_um: float,
    longest_um: float,
    wavelength_nm: float | None,
    light_distance_mm: float | None,
    camera_distance_mm: float | None,
    light_sigma_mm: float | None,
    coherence_um: float,
    **_: object,
) -> None:
    """Refuse impossible settings before anything runs."""
    refuse(
        zero_or_more(tolerance_percent=tolerance_percent, keep_off=keep_off),
        above_zero_up_to(1, share=share),
        above_zero(
            shortest_um=shortest_um,
            longest_um=longest_um,
            wavelength_nm=wavelength_nm,
            light_distance_mm=light_distance_mm,
            camera_distance_mm=camera_distance_mm,
            light_sigma_mm=light_sigma_mm,
            coherence_um=coherence_um,
        ),
    )
    refuse(unordered(shortest_um, longest_um, least_ratio=_LEAST_RATIO))
