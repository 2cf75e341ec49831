"""The Stokes parameters of some diffracting pixels, with their noise, and the curve that they lie on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from pipeline.data import PolarizerSequence
from pipeline.optics.curve_search import CurveFit, Points, find_curve
from pipeline.optics.harmonic import harmonic_fit
from pipeline.optics.response_curve import DARK, StokesNoise, harmonic_design
from pipeline.stages.fit._photographs import ground_threshold, nothing_left

Float64Array = NDArray[np.float64]

_SAMPLES = 40_000
_LEAST_PIXELS = 10
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
    values, least = _some_pixels(photos, threshold, count)
    cloud = _cloud(values, least, photos.polarizer_rad, None)
    found = find_curve(cloud.points, dict(known))
    if len(values) == 3:  # the three numbers leave nothing over: the distances from the curve tell the noise
        gain = max(cloud.gain * found.misfit**2, _LEAST_GAIN)
        cloud = _cloud(values, least, photos.polarizer_rad, gain)
        found = find_curve(cloud.points, dict(known))
    return cloud, found


def _some_pixels(photos: PolarizerSequence, threshold: float | None, count: int) -> tuple[Float64Array, float]:
    step = max(1, int(np.sqrt(photos.valid.size / _SAMPLES)))
    valid = photos.valid[::step, ::step]
    values = photos.images[:, ::step, ::step].astype(np.float64)
    level = np.tensordot(harmonic_fit(photos.polarizer_rad).mean, values, 1)
    least = ground_threshold(level, valid) if threshold is None else threshold
    kept = valid & (level >= least) & (level > 0)
    if np.count_nonzero(kept) < _LEAST_PIXELS:
        raise nothing_left(least)
    return values[:, kept][:, :: max(1, np.count_nonzero(kept) // count)], float(least)


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
