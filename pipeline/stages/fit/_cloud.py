"""The Stokes parameters of some diffracting pixels, with their noise, and the curve that they lie on."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from pipeline.data.photographs import PolarizerSequence
from pipeline.optics.curve_search import NAMES, CurveFit, Points, find_curve
from pipeline.optics.harmonic import HarmonicFit, harmonic_fit
from pipeline.optics.photo_errors import PhotographErrors, odd_photographs, photograph_errors
from pipeline.optics.response_curve import DARK, StokesNoise, harmonic_design
from pipeline.stages.fit._photographs import ground_threshold, nothing_left

_log = logging.getLogger(__name__)

Float64Array = NDArray[np.float64]

_SAMPLES = 40_000
_LEAST_PIXELS = 10
_ENOUGH_KNOWN = 2_000
_SPARE = 3
"""Times as many pixels are looked at as are wanted, since some lie at edges."""
_REACH = 2
"""Pixels over which a lens blurs an edge, at most."""
_ENOUGH_UNIFORM = 0.1
_UNUSUAL_CHANGE = 4.0
"""Times the median; noise alone, of four numbers, exceeds it once in a hundred times."""
_UNSEEN, _LEAST_SYSTEMATIC, _MISREAD = 0.3, 0.05, 0.1
"""Error that all pixels share, in units of their noise: where the photographs cannot show it, where they show none, and
where a warning is due."""
_LEAST_GAIN = 1e-9
_FIRST_GAIN = 1e-4


@dataclass(frozen=True)
class Cloud:
    """Some diffracting pixels.

    Attributes
    ----------
    photos : PolarizerSequence
        The photographs that they were taken from: all but those whose exposure failed.
    values : ndarray of shape (K, P)
        Their brightness in each.
    points : Points
        Their Stokes parameters.
    gain : float
        Noise variance over brightness, full scale 1: one over the electrons of full scale.
    least : float
        Least brightness of a pixel that diffracts.
    """

    photos: PolarizerSequence
    values: Float64Array
    points: Points
    gain: float
    least: float


def curve_of(
    photos: PolarizerSequence, known: Mapping[str, float], threshold: float | None, count: int
) -> tuple[Cloud, CurveFit]:
    """Find the curve of about ``count`` pixels.

    Raises
    ------
    InputError
        Hardly any pixel diffracts.
    """
    values, least = _some_pixels(photos, threshold, min(count, _ENOUGH_KNOWN) if set(known) == set(NAMES) else count)
    photos, values = _without_odd(photos, values)
    cloud = _cloud(photos, values, least, None)
    found = find_curve(cloud.points, dict(known))
    if len(values) == 3:  # the three numbers leave nothing over: the distances from the curve tell the noise
        gain = max(cloud.gain * found.misfit**2, _LEAST_GAIN)
        cloud = _cloud(photos, values, least, gain)
        found = find_curve(cloud.points, dict(known))
    return cloud, found


def _some_pixels(photos: PolarizerSequence, threshold: float | None, count: int) -> tuple[Float64Array, float]:
    """Photographs (K, P) of about ``count`` pixels, in the midst of their like if there are enough; the least level."""
    step = max(1, int(np.sqrt(photos.valid.size / _SAMPLES)))
    inner = (slice(_REACH, -_REACH, step), slice(_REACH, -_REACH, step))
    values, valid = photos.images[(..., *inner)].astype(np.float64), photos.valid[inner]
    fit = harmonic_fit(photos.polarizer_rad)
    level = np.tensordot(fit.mean, values, 1)
    least = ground_threshold(level, valid) if threshold is None else threshold
    kept = np.argwhere(valid & (level >= least) & (level > 0) & (level < np.inf)).T
    if kept.shape[1] < _LEAST_PIXELS:
        raise nothing_left(
            least, f"at least {_LEAST_PIXELS} of the pixels that lie more than {_REACH} from the picture's border"
        )
    kept = kept[:, :: max(1, kept.shape[1] // (_SPARE * count))]
    chosen = kept
    for reach in range(_REACH, 0, -1):
        uniform = kept[:, _uniform(photos, fit, kept * step + _REACH, least, reach)]
        if uniform.shape[1] >= max(_LEAST_PIXELS, _ENOUGH_UNIFORM * kept.shape[1]):
            chosen = uniform
            break
    row, column = chosen[:, :: max(1, chosen.shape[1] // count)]
    return values[:, row, column], float(least)


def _uniform(
    photos: PolarizerSequence, fit: HarmonicFit, places: NDArray[np.int_], least: float, reach: int
) -> NDArray[np.bool_]:
    """Which pixels have like neighbours to both sides, above and below, at a distance of ``reach``.

    Alike are those that differ no more than is usual in the scene.

    Others may mix the light of two orientations, or of a grating and the ground, and then lie off the curve.
    """

    def stokes(down: int, right: int) -> tuple[Float64Array, NDArray[np.bool_]]:
        at = (places[0] + down, places[1] + right)
        values = photos.images[:, at[0], at[1]].astype(np.float64)
        mean, cosine, sine = np.stack([fit.mean, fit.cosine, fit.sine]) @ values
        there = photos.valid[at] & (mean >= least) & (mean > 0)
        return np.stack([cosine, sine]) / np.where(there, mean, 1.0), there

    change, inside = np.zeros(places.shape[1]), np.ones(places.shape[1], np.bool_)
    for down, right in ((reach, 0), (0, reach)):
        (ahead, there), (behind, here) = stokes(down, right), stokes(-down, -right)
        change += ((ahead - behind) ** 2).sum(axis=0)
        inside &= there & here
    return inside & (change <= _UNUSUAL_CHANGE * np.median(change[inside] if inside.any() else change))


def _without_odd(photos: PolarizerSequence, values: Float64Array) -> tuple[PolarizerSequence, Float64Array]:
    """The photographs, and the pixels taken from them, but those whose exposure must have failed."""
    level = values.mean(axis=1)
    odd = odd_photographs(level, np.asarray(photos.polarizer_rad, np.float64))
    if not odd:
        return photos, values
    kept = np.setdiff1d(np.arange(len(level)), odd)
    design = harmonic_design(photos.polarizer_rad)
    expected = design @ np.linalg.lstsq(design[kept], level[kept], rcond=None)[0]
    for k in odd:
        _log.warning(
            "Photograph %d, at %.1f deg, is %.0f %% as bright as the others lead to expect and is left out: a failed "
            "exposure, or a misread angle.",
            k,
            np.rad2deg(photos.polarizer_rad[k]),
            100 * level[k] / expected[k],
        )
    fewer = dataclasses.replace(photos, images=photos.images[kept], polarizer_rad=photos.polarizer_rad[kept])
    return fewer, values[kept]


def _warn_of_misread_angles(polarizer_rad: NDArray[np.floating], errors: PhotographErrors) -> None:
    worst = int(np.argmax(np.abs(errors.turn_rad)))
    if errors.systematic is not None and errors.systematic > _MISREAD:
        _log.warning(
            "Polariser angles or exposures look wrong, by up to %.1f deg at photograph %d (%.1f deg) and %.1f %% of "
            "the brightness: that turns orientations by %.1f times their noise, and the same way for all pixels.",
            np.rad2deg(abs(errors.turn_rad[worst])),
            worst,
            np.rad2deg(polarizer_rad[worst]),
            100 * np.abs(errors.exposure).max(),
            errors.systematic,
        )


def _cloud(photos: PolarizerSequence, values: Float64Array, least: float, gain: float | None) -> Cloud:
    polarizer_rad = np.asarray(photos.polarizer_rad, np.float64)
    level = values.mean(axis=1)
    weights = 1 / (np.maximum(level, 0) + DARK * level.mean())
    weights /= weights.mean()
    fit = harmonic_fit(polarizer_rad, weights)
    mean, cosine, sine = np.stack([fit.mean, fit.cosine, fit.sine]) @ values
    stokes = np.stack([cosine, sine], axis=1) / mean[:, None]
    if gain is None:
        gain = _FIRST_GAIN
        freedom = len(weights) - 3
        if freedom:
            left = values - harmonic_design(polarizer_rad) @ np.stack([mean, cosine, sine])
            square = (weights[:, None] * left**2).sum(axis=0)
            relative = square / (mean * StokesNoise(polarizer_rad, weights).residual(stokes))
            gain = max(float(np.median(relative)) * freedom / float(chi2.median(freedom)), _LEAST_GAIN)
    errors = photograph_errors(values, polarizer_rad, weights, gain)
    _warn_of_misread_angles(polarizer_rad, errors)
    systematic = _UNSEEN if errors.systematic is None else max(errors.systematic, _LEAST_SYSTEMATIC)
    points = Points(stokes, np.sqrt(gain / mean), polarizer_rad, weights, systematic)
    return Cloud(photos, values, points, gain, least)
