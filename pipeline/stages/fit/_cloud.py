"""The Stokes parameters of some diffracting pixels, with their noise, and the curve that they lie on."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from pipeline.data import PolarizerSequence
from pipeline.optics.curve_search import NAMES, CurveFit, Points, find_curve
from pipeline.optics.harmonic import HarmonicFit, harmonic_fit
from pipeline.optics.response_curve import DARK, StokesNoise, harmonic_design
from pipeline.stages.fit._photographs import ground_threshold, nothing_left

_log = logging.getLogger(__name__)

Float64Array = NDArray[np.float64]

_SAMPLES = 40_000
_LEAST_PIXELS = 10
_ENOUGH_TO_JUDGE = 5
_ODD, _ODD_BESIDE = 0.2, 5.0
"""Odd is a photograph whose brightness is off by this share of the mean, and by so many times what others are."""
_ENOUGH_KNOWN = 2_000
_SPARE = 3
"""Times as many pixels are looked at as are wanted, since some lie at edges."""
_REACH = 2
"""Pixels over which a lens blurs an edge, at most."""
_ENOUGH_UNIFORM = 0.1
_UNUSUAL_CHANGE = 4.0
"""Times the median; noise alone, of four numbers, exceeds it once in a hundred times."""
_LEAST_GAIN = 1e-9
_FIRST_GAIN = 1e-4


@dataclass(frozen=True)
class Cloud:
    """Some diffracting pixels.

    Attributes
    ----------
    values : ndarray of shape (K, P)
        Their photographs.
    points : Points
        Their Stokes parameters.
    gain : float
        Noise variance over brightness, full scale 1: one over the electrons of full scale.
    least : float
        Least brightness of a pixel that diffracts.
    """

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
    _warn_of_odd_photographs(values, photos.polarizer_rad)
    cloud = _cloud(values, least, photos.polarizer_rad, None)
    found = find_curve(cloud.points, dict(known))
    if len(values) == 3:  # the three numbers leave nothing over: the distances from the curve tell the noise
        gain = max(cloud.gain * found.misfit**2, _LEAST_GAIN)
        cloud = _cloud(values, least, photos.polarizer_rad, gain)
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


def _warn_of_odd_photographs(values: Float64Array, polarizer_rad: NDArray[np.floating]) -> None:
    """Tell of photographs whose mean brightness the others make unlikely: it too follows a cosine over the angles."""
    level = values.mean(axis=1)
    if len(level) < _ENOUGH_TO_JUDGE:
        return
    design = harmonic_design(polarizer_rad)
    for k in range(len(level)):
        others = np.arange(len(level)) != k
        found, _, rank, _ = np.linalg.lstsq(design[others], level[others], rcond=None)
        left = np.abs(design[others] @ found - level[others]).max()
        away = abs(design[k] @ found - level[k])
        if rank == 3 and away > _ODD * level.mean() and away > _ODD_BESIDE * left:
            _log.warning(
                "Photograph %d, at %.1f deg, is %.0f %% as bright as the others lead to expect: a failed exposure, or "
                "a misread angle.",
                k,
                np.rad2deg(polarizer_rad[k]),
                100 * level[k] / (design[k] @ found),
            )


def _cloud(values: Float64Array, least: float, polarizer_rad: NDArray[np.floating], gain: float | None) -> Cloud:
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
    points = Points(stokes, np.sqrt(gain / mean), np.asarray(polarizer_rad, np.float64), weights)
    return Cloud(values, points, gain, least)
