"""What fits of polariser photographs have in common: what they refuse, which pixels diffract, when all is noise."""

from __future__ import annotations

import logging
import math

import numpy as np

from pipeline.data.arrays import BoolArray, FloatArray
from pipeline.data.photographs import PolarizerSequence
from pipeline.errors import InputError
from pipeline.optics.harmonic import HarmonicFit, harmonic_fit
from pipeline.optics.threshold import two_modes

_log = logging.getLogger(__name__)

_ILL_CONDITIONED = 20.0
_LEAST_BEYOND_NOISE = 0.25
_SAMPLES = 40_000
_UNKNOWNS = 3
_THRESHOLD_PIXELS = 100_000


def checked_fit(photos: PolarizerSequence) -> HarmonicFit:
    """Weights of the cosine for these photographs; says so where their angles determine it badly.

    Raises
    ------
    InputError
        Fewer than three distinct polariser angles.
    """
    degrees = ", ".join(f"{angle:g}" for angle in np.rad2deg(photos.polarizer_rad))
    try:
        fit = harmonic_fit(photos.polarizer_rad)
    except ValueError as error:
        raise InputError(str(error), where=f"polariser angles {degrees} deg") from error
    if fit.condition > _ILL_CONDITIONED:
        _log.warning(
            "The polariser angles %s deg leave the cosine badly determined: noise grows up to %.0f times.",
            degrees,
            fit.condition / np.sqrt(2),
        )
    return fit


def ground_threshold(intensity: FloatArray, valid: BoolArray) -> float:
    """The cut between ground and print, from an even grid of pixels."""
    step = max(1, math.isqrt(np.count_nonzero(valid) // _THRESHOLD_PIXELS))
    modes = two_modes(intensity[::step, ::step][valid[::step, ::step]])
    figures = (
        f"Otsu's cut explains {modes.separability:.2f} of the variance of the log intensity, "
        f"valley {modes.valley:.2f}, bright over dark {modes.ratio:.1f}"
    )
    if not modes.distinct:
        _log.info("No ground told apart, all valid pixels kept: the histogram has no two distinct modes (%s).", figures)
        return -np.inf
    _log.info(
        "Pixels darker than %.4g (%.1f percent) taken for ground: the histogram has two distinct modes (%s).",
        modes.threshold,
        100 * modes.below,
        figures,
    )
    return modes.threshold


def nothing_left(cut: float, expected: str = "pixels that change with the polariser") -> InputError:
    """What to say where no pixel, or hardly any, diffracts."""
    if np.isneginf(cut):
        return InputError("no pixel is valid and modulated", expected=expected)
    return InputError(
        f"no pixel is valid, modulated and brighter than {cut:.3g}",
        expected="a threshold below the brightness of the diffracting pixels",
        hint="set the fit's threshold to 0 to keep every valid pixel",
    )


def warn_of_noise(correlation: FloatArray, mask: BoolArray, count: int) -> None:
    """Warn where the cosine explains hardly more than it would of noise.

    Of Gaussian noise it explains a share that is distributed as Beta(1, (count - 3) / 2).
    """
    step = max(1, int(np.sqrt(correlation.size / _SAMPLES)))
    explained = float(np.median(np.square(correlation[::step, ::step][mask[::step, ::step]], dtype=np.float64)))
    of_noise = 1 - 0.5 ** (2 / (count - _UNKNOWNS))
    if explained < of_noise + _LEAST_BEYOND_NOISE * (1 - of_noise):
        _log.warning(
            "The cosine explains %.0f percent of what varies in most pixels, and %.0f percent of mere noise: the "
            "orientations may mean nothing.",
            100 * explained,
            100 * of_noise,
        )
