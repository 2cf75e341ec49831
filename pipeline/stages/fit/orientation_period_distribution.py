"""Which gratings a stochastic sheet holds, from one photograph under a filtered flash."""

from __future__ import annotations

import logging
from typing import Literal

import numpy as np

from pipeline.data.flash import FlashPhotographs
from pipeline.data.flash_maps import GratingDistribution, Highlights
from pipeline.errors import InputError
from pipeline.limits import above_zero, at_least, refuse, within, zero_or_more
from pipeline.optics.flash.distribution import Bins, sharpened
from pipeline.optics.flash.lobes import half_vectors, light_variance, point_variance
from pipeline.stages.fit._tile_views import bench, unordered

_log = logging.getLogger(__name__)

_tolerance_orientation_period_distribution = {"share": 1e-3, "metrics": 1e-2}

_STEPS = 25
_FEW_PIXELS = 3
_PAPER_PERCENTILE = 20.0
"""Of the brightness of bins, most of which no grating lights: what the paper scatters."""


def orientation_period_distribution(
    photos: FlashPhotographs,
    highlights: Highlights,
    *,
    method: Literal["modelled", "naive"] = "modelled",
    photograph: int = 0,
    orientations: int = 60,
    periods: int = 40,
    shortest_um: float = 0.8,
    longest_um: float = 3.0,
    share: float = 0.1,
    keep_off: float = 4.0,
    wavelength_nm: float | None = None,
    light_distance_mm: float | None = None,
    camera_distance_mm: float | None = None,
    light_sigma_mm: float | None = None,
    coherence_um: float = 65.0,
) -> GratingDistribution:
    """Measure how common each pair of orientation and period is among gratings that are strewn at random.

    Where a pixel is bright outside the highlight, a grating lies whose tangent points along the half vector and whose
    period is ``lambda / |u|``. ``naive`` counts such pixels, weighted by brightness, as the paper does: long periods,
    whose ring is small, are counted too rarely, and lobes are taken for spread. ``modelled`` takes the brightness of
    the half vectors' plane for the density of gratings in it, and its lobes back by Richardson and Lucy's iteration.

    A filter is needed: of white light, gratings of many periods are bright at one place, each in its colour. With
    ``wavelength_nm`` the estimate is made all the same, and is wrong; there is a warning.

    Parameters
    ----------
    photos : FlashPhotographs
        Rectified.
    highlights : Highlights
        Of these photographs.
    method : {"modelled", "naive"}
        Density by the model, or counts.
    photograph : int
        Which of them is read.
    orientations, periods : int
        Bins.
    shortest_um, longest_um : float
        Between which periods are counted; beyond twice the shortest, second orders may be taken for first ones.
    share : float
        Of the brightest pixels: brightness above which ``naive`` counts.
    keep_off : float
        Standard deviations of the highlight within which nothing is read.
    wavelength_nm : float, optional
        Of the light, where the photographs do not say.
    light_distance_mm, camera_distance_mm : float, optional
        From the sheet, where the photographs do not know them: the flash then stands where the highlight puts it.
    light_sigma_mm : float, optional
        Extent of the flash; by default as stated, or as large as the highlights say.
    coherence_um : float
        Width 4 sigma_s of the coherence window; 65 um for sunlight.

    Raises
    ------
    InputError
        No such photograph, no wavelength or distance, or nothing is bright.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018),
    section 4.5; Richardson 1972; Lucy 1974.
    """
    _check_orientation_period_distribution(
        photograph=photograph,
        orientations=orientations,
        periods=periods,
        shortest_um=shortest_um,
        longest_um=longest_um,
        share=share,
        keep_off=keep_off,
        wavelength_nm=wavelength_nm,
        light_distance_mm=light_distance_mm,
        camera_distance_mm=camera_distance_mm,
        light_sigma_mm=light_sigma_mm,
        coherence_um=coherence_um,
    )
    if photograph >= len(photos.radiance):
        raise InputError(
            f"there is no photograph {photograph}", where="photograph", expected=f"0 to {len(photos.radiance) - 1}"
        )
    wavelength = wavelength_nm or photos.wavelength_nm
    if wavelength is None:
        raise InputError(
            "the photographs were taken without a filter",
            where="wavelength_nm",
            expected="photographs with one, and its wavelength_nm in capture.yaml: of "
            "white light, many periods are bright at one place",
        )
    if photos.wavelength_nm is None:
        _log.warning("without a filter many periods are bright at one place: the distribution is redundant and wrong")
    placed = bench(
        photos,
        highlights,
        light_distance_mm=light_distance_mm,
        camera_distance_mm=camera_distance_mm,
        light_sigma_mm=light_sigma_mm,
        coherence_um=coherence_um,
        keep_off=keep_off,
    )
    pixel = photos.pixel_mm or np.nan
    rows, columns = photos.valid.shape[1:]
    x, y = np.meshgrid((np.arange(columns) - (columns - 1) / 2) * pixel, ((rows - 1) / 2 - np.arange(rows)) * pixel)
    half = half_vectors(x, y, placed.light_mm[photograph], placed.eye_mm)
    away = np.hypot(x - placed.highlight_mm[photograph, 0], y - placed.highlight_mm[photograph, 1])
    usable = photos.valid[photograph] & (away > placed.keep_off_mm[photograph])
    brightness = np.where(usable, photos.radiance[photograph].mean(axis=-1, dtype=np.float64), np.nan)
    bins = Bins(orientations, periods, shortest_um, longest_um)
    with np.errstate(divide="ignore"):
        period = wavelength / 1000 / half.length
    second = 0.0
    if method == "naive":
        bright = brightness > share * np.percentile(brightness[usable], 99.5) if usable.any() else usable
        mean, count = bins.means(half.azimuth_rad, period, np.where(bright, brightness, np.nan))
        found = mean * count / max(float((mean * count).sum()), 1e-300)
        seen = bins.means(half.azimuth_rad, period, np.where(usable, 1.0, np.nan))[1] > 0
    else:
        plane, count = bins.means(half.azimuth_rad, period, brightness / half.gain)
        seen = count >= _FEW_PIXELS
        plane = np.maximum(plane - np.percentile(plane[seen], _PAPER_PERCENTILE), 0) if seen.any() else plane
        window = {"coherence_um": coherence_um, "wavelength_um": wavelength / 1000}
        variance = light_variance(half, placed.light_sigma_mm) + point_variance(half, **window, pixel_mm=pixel)
        width, _ = bins.means(half.azimuth_rad, period, np.where(usable, variance, np.nan))
        found = np.zeros(plane.shape)
        if plane.any():
            found, second = sharpened(plane, seen, width, wavelength / 1000, bins, _STEPS)
    if not found.any():
        raise InputError(
            "nothing outside the highlight is bright", expected="a photograph that shows orders of diffraction"
        )
    entropy = -float(np.sum(found[found > 0] * np.log(found[found > 0])))
    return GratingDistribution(
        share=found,
        orientation_rad=bins.orientation_rad,
        period_um=bins.period_um,
        seen=seen,
        metrics={
            "bins_seen_percent": 100 * float(seen.mean()),
            "second_order_percent": 100 * second,
            "bins_filled": float(np.exp(entropy)),
            "period_mean_um": float((found * bins.period_um).sum()),
        },
    )


def _check_orientation_period_distribution(
    *,
    photograph: int,
    orientations: int,
    periods: int,
    shortest_um: float,
    longest_um: float,
    share: float,
    keep_off: float,
    wavelength_nm: float | None,
    light_distance_mm: float | None,
    camera_distance_mm: float | None,
    light_sigma_mm: float | None,
    coherence_um: float,
    **_: object,
) -> None:
    """Refuse impossible settings before anything runs."""
    refuse(
        zero_or_more(photograph=photograph, keep_off=keep_off),
        at_least(2, "to tell gratings apart", orientations=orientations, periods=periods),
        within(0, 1, share=share),
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
    refuse(unordered(shortest_um, longest_um))
