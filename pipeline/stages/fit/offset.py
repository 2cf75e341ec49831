"""The one offset that a polarisation map lacks, from photographs under a small light."""

from __future__ import annotations

import dataclasses
import logging

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.data.pictures import PictureSeries
from pipeline.errors import InputError
from pipeline.limits import above_zero, above_zero_up_to, at_least, refuse, within, zero_or_more
from pipeline.optics.angles import axial_difference, wrap_axial
from pipeline.optics.colour import LUMINANCE
from pipeline.optics.glint import glint, half_vectors
from pipeline.optics.gratings import window_spread
from pipeline.progress import advance

_log = logging.getLogger(__name__)

Float64Array = NDArray[np.float64]

_PEAKS_APART_DEG = 10.0
_LEAST_SAMPLES = 10

# What a step of 14 bits in a simulated photograph comes to: 1.2e-5 was seen; last bits of float32 do less than 2e-6.
_tolerance_offset = {"orientation_rad": 1e-4, "correlation": 1e-4, "intensity": 1e-4}


def offset(
    orientation: OrientationMap,
    period: PeriodMap,
    photos: PictureSeries | None = None,
    *,
    known_deg: float | None = None,
    light_sigma_mm: float = 12.0,
    coherence_um: float = 65.0,
    step_deg: float = 1.0,
    samples: int = 12000,
    least_score: float = 0.3,
    least_margin: float = 0.05,
) -> OrientationMap:
    """Turn an orientation map by the offset with which it would shine where the photographs show it shine.

    A facet lights up when its tangent lies along the half vector between light and camera. For each offset in
    [0, 180) degrees the luminance that the turned map would have is predicted (a Gaussian across the tangent as wide as
    light and coherence window make it; along it, the eye's response to the wavelength that each order sends to the
    camera) and its square root correlated with that of the photographs. The best offset of a coarse grid is refined.
    Points near the mirror direction, which shine whatever their orientation, take no part. An offset that is known
    already, as from a grating of known orientation under the same polariser, is simply added.

    Parameters
    ----------
    orientation, period : OrientationMap, PeriodMap
        Of shape (M, N); a map that is absolute already is given back as it is, unless ``known_deg`` is given.
    photos : PictureSeries, optional
        Of shape (L, M, N, 3), from the same place as the maps' photographs, with light and camera known. Without any
        and without ``known_deg`` the map is given back as it is.
    known_deg : float, optional
        What to add to every orientation, anticlockwise; the photographs are then not asked.
    light_sigma_mm : float
        Standard deviation of the light's extent.
    coherence_um : float
        Width 4 sigma_s of the coherence window.
    step_deg : float
        Step of the coarse grid.
    samples : int
        At most about as many pixels are compared, spread evenly over the mask.
    least_score, least_margin : float
        The offset counts as found where its correlation is at least ``least_score`` and exceeds that of every other
        peak, ten degrees or more away, by ``least_margin``.

    Returns
    -------
    OrientationMap
        Turned by the best offset; ``absolute`` where that is unambiguous, otherwise there is a warning.

    Raises
    ------
    InputError
        The shapes differ, the pixel pitch is unknown, or no pixel can be compared.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018),
    sections 4.3 and 5.3.
    """
    _check_offset(
        light_sigma_mm=light_sigma_mm,
        coherence_um=coherence_um,
        step_deg=step_deg,
        samples=samples,
        least_score=least_score,
        least_margin=least_margin,
    )
    if known_deg is not None:
        _log.info("Orientation made absolute: %.2f deg added to every orientation, as given.", known_deg)
        return dataclasses.replace(
            orientation, orientation_rad=_turned(orientation, np.deg2rad(known_deg)), absolute=True
        )
    if orientation.absolute:
        _log.info("The map is absolute already: nothing is added.")
        return orientation
    if photos is not None and photos.together:
        raise InputError("all lights are on in one photograph", expected="a photograph for each light")
    if photos is None:
        _log.info("No photographs under a small light: the offset stays unknown.")
        return orientation
    half, spread, theta, pitch_um, observed = _compared(
        orientation, period, photos, light_sigma_mm, coherence_um, samples
    )
    target = np.sqrt(np.maximum(observed, 0))
    usable = np.hypot(half[..., 0], half[..., 1]) > 4 * spread
    if usable.sum() < _LEAST_SAMPLES or np.ptp(target[usable]) == 0:
        raise InputError(
            "the photographs show nothing that depends on the orientation",
            expected="a light away from the mirror direction, and pixels that differ in brightness",
        )

    def score(turn_rad: float) -> float:
        predicted = np.sqrt(glint(half, theta + turn_rad, pitch_um, spread))[usable]
        if np.ptp(predicted) < 1e-12:
            return 0.0
        return float(np.corrcoef(predicted, target[usable])[0, 1])

    grid = np.deg2rad(np.arange(0.0, 180.0, step_deg))
    scores = np.empty(len(grid))
    for i, turn in enumerate(grid):
        scores[i] = score(float(turn))
        advance(i + 1, len(grid))
    start, step = float(grid[np.argmax(scores)]), np.deg2rad(step_deg)
    refined = minimize_scalar(
        lambda turn: -score(turn), bounds=(start - step, start + step), method="bounded", options={"xatol": 1e-4}
    )
    found, best = float(refined.x), -float(refined.fun)
    second = _second_peak(grid, scores, found)
    clear = best >= least_score and best - second >= least_margin
    report = (
        f"{np.rad2deg(wrap_axial(found)):.2f} deg added to every orientation, correlation {best:.3f}, "
        f"next peak {second:.3f}, {len(photos.rgb)} photographs"
    )
    if clear:
        _log.info("Orientation made absolute: %s.", report)
    else:
        _log.warning("The offset is ambiguous and the map stays relative: %s.", report)
    return dataclasses.replace(orientation, orientation_rad=_turned(orientation, found), absolute=bool(clear))


def _check_offset(
    *,
    light_sigma_mm: float,
    coherence_um: float,
    step_deg: float,
    samples: int,
    least_score: float,
    least_margin: float,
    **_: object,
) -> None:
    """Refuse impossible sizes and correlations before anything runs."""
    refuse(
        zero_or_more(light_sigma_mm=light_sigma_mm),
        above_zero(coherence_um=coherence_um),
        above_zero_up_to(_PEAKS_APART_DEG, step_deg=step_deg),
        at_least(_LEAST_SAMPLES, "fewer give no correlation", samples=samples),
        within(0, 1, least_score=least_score, least_margin=least_margin),
    )


def _turned(orientation: OrientationMap, by_rad: float) -> NDArray[np.float32]:
    turned = wrap_axial(orientation.orientation_rad + by_rad).astype(np.float32)
    turned[turned >= np.float32(np.pi)] = 0
    return turned


def _compared(
    orientation: OrientationMap,
    period: PeriodMap,
    photos: PictureSeries,
    light_sigma_mm: float,
    coherence_um: float,
    samples: int,
) -> tuple[Float64Array, Float64Array, Float64Array, Float64Array, Float64Array]:
    """Half vectors (L, P, 2), spreads (L, P), orientation and period (P,), luminance (L, P) of the pixels compared."""
    shape = orientation.orientation_rad.shape
    if period.period_um.shape != shape or photos.rgb.shape[1:3] != shape:
        raise InputError(
            f"maps of {shape} and {period.period_um.shape} and photographs of {photos.rgb.shape[1:3]} differ in shape",
            expected="maps and photographs from one place",
        )
    pixel_mm = photos.pixel_mm or orientation.pixel_mm or period.pixel_mm
    if pixel_mm is None:
        raise InputError("the pixel pitch is not known", expected="pixel_mm of the maps or of the photographs")
    known = np.isfinite(orientation.orientation_rad) & np.isfinite(period.period_um) & (period.period_um > 0)
    known &= np.isfinite(photos.rgb).all(axis=(0, 3))
    places = np.flatnonzero(known)
    places = places[:: max(1, len(places) // samples)]
    row, column = np.unravel_index(places, shape)
    position = np.stack([column - (shape[1] - 1) / 2, (shape[0] - 1) / 2 - row], axis=1) * pixel_mm
    half = np.stack([half_vectors(position, light, photos.camera_mm) for light in photos.light_mm])
    distance = np.linalg.norm(
        photos.light_mm[:, None, :] - np.concatenate([position, np.zeros((len(position), 1))], axis=1), axis=2
    )
    spread = np.hypot(light_sigma_mm / distance, window_spread(0.559, coherence_um))
    luminance = photos.rgb.reshape(len(photos.rgb), -1, 3)[:, places].astype(np.float64) @ LUMINANCE
    theta = orientation.orientation_rad.ravel()[places].astype(np.float64)
    return half, spread, theta, period.period_um.ravel()[places].astype(np.float64), luminance


def _second_peak(grid: Float64Array, scores: Float64Array, best_rad: float) -> float:
    """Highest local maximum of a periodic curve away from its best place."""
    peak = (scores >= np.roll(scores, 1)) & (scores >= np.roll(scores, -1))
    away = np.abs(axial_difference(grid, best_rad)) >= np.deg2rad(_PEAKS_APART_DEG)
    return float(scores[peak & away].max(initial=0.0))
