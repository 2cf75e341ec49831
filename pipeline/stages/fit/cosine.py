"""Grating orientation from the phase of a cosine."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray

from pipeline.data.arrays import BoolArray, FloatArray
from pipeline.data.gratings import OrientationMap
from pipeline.data.photographs import PolarizerSequence
from pipeline.limits import refuse, zero_or_more
from pipeline.optics.harmonic import HarmonicFit, empty_maps, fit_rows, mask_rows, sum_rows
from pipeline.parallel import over_rows
from pipeline.stages.fit._photographs import checked_fit, ground_threshold, nothing_left, warn_of_noise

_log = logging.getLogger(__name__)

_UNKNOWNS = 3
_TILE = 128

# What a step of 14 bits in a simulated photograph does, up to 4e-5 was seen; last bits of sines do less than 1e-6.
_tolerance_cosine = {"orientation_rad": 1e-4, "correlation": 1e-4, "intensity": 1e-4}


def cosine(photos: PolarizerSequence, *, prenormalize: bool = True, threshold: float | None = None) -> OrientationMap:
    """Fit a cosine of period 180 degrees to every pixel; its maximum marks the orientation.

    The orientation is the polariser angle at which the fitted cosine is largest. It differs from the grating's tangent
    by one offset, the same for every pixel, so the map is not ``absolute``. The steps of the polariser need not be
    equal: the fit is linear least squares on ``1, cos 2 psi, sin 2 psi``. Normalising each pixel by its mean and
    standard deviation, as the source does, changes neither phase nor correlation and is left out.

    Pre-normalisation subtracts from every photograph its mean over the diffracting pixels. The fit is linear, so this
    subtracts from each pixel's cosine the cosine of those means: a vector, the same for every pixel, moved away from
    each ``(c, s)`` before the angle is taken. It removes what the film adds to every pixel alike, and is exact where
    all orientations are equally common; where a few dominate, it takes part of their own signal away and bends the map.
    It is on by default since it is part of the published method; turn it off for a print of few orientations, or where
    gratings modulate strongly, as all experiments here do but that of the compact disc, or let ``fit.auto`` decide.

    Parameters
    ----------
    photos : PolarizerSequence
        K photographs, K >= 3, aligned; polariser angles distinct modulo 180 degrees.
    prenormalize : bool
        Subtract each photograph's mean over the diffracting pixels; true assumes that all orientations are equally
        common.
    threshold : float, optional
        Least mean intensity (full scale 1) of a pixel that diffracts. By default it is found from the histogram of the
        logarithm of the mean intensity: used where that has two distinct modes (Otsu's cut explains 85 percent of the
        variance or more, the valley is at most a tenth as high as the lower mode, the bright class is three times as
        bright), half way between the dark mode and the next that stands apart; otherwise all valid pixels are kept.

    Returns
    -------
    OrientationMap
        ``intensity`` is the cosine's mean over a turn of the polariser: the mean of the photographs where the steps are
        equal over half a turn, and free of the orientation where they are not. ``correlation`` is NaN everywhere where
        there are no more than three photographs: a cosine, of three unknowns, goes through them exactly, whatever they
        show.

    Raises
    ------
    InputError
        Fewer than three distinct polariser angles, a threshold below 0, or no pixel left.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018),
    sections 5.3 and 7.3; eq. 9.
    """
    _check_cosine(threshold=threshold)
    return _fitted(photos, prenormalize=prenormalize, cut=threshold)


def _check_cosine(*, threshold: float | None, **_: object) -> None:
    """Refuse what no brightness is, before anything runs."""
    refuse(zero_or_more(threshold=threshold))


def _fitted(photos: PolarizerSequence, *, prenormalize: bool, cut: float | None) -> OrientationMap:
    """What :func:`cosine` gives, its threshold found where ``cut`` is None."""
    fit = checked_fit(photos)
    maps = empty_maps(*photos.valid.shape)
    orientation, correlation, intensity = maps
    over_rows(fit_rows(photos.images, fit, None, maps), len(intensity), tile=_TILE)
    cut = ground_threshold(intensity, photos.valid) if cut is None else cut
    mask = np.empty(photos.valid.shape, np.bool_)
    over_rows(mask_rows(maps, photos.valid, cut, mask), len(mask), tile=_TILE)
    if not mask.any():
        raise nothing_left(cut)
    if prenormalize:
        level = _photo_means(photos.images, mask)
        _report_common(fit, level)
        chosen, mask = mask, np.empty_like(mask)
        refit, leave_out = fit_rows(photos.images, fit, level, maps), mask_rows(maps, chosen, -np.inf, mask)

        def refit_masked(start: int, stop: int) -> None:
            refit(start, stop)
            leave_out(start, stop)

        over_rows(refit_masked, len(mask), tile=_TILE)
    if len(photos.images) == _UNKNOWNS:
        _log.warning(
            "A cosine goes exactly through three photographs, whatever they show: how well it fits is not known. Take "
            "at least four."
        )
        correlation[:] = np.nan
    else:
        warn_of_noise(correlation, mask, len(photos.images))
    return OrientationMap(orientation, correlation, intensity, mask, photos.pixel_mm)


def _photo_means(images: FloatArray, mask: BoolArray) -> NDArray[np.float64]:
    sums = np.zeros((-(-len(mask) // _TILE), len(images)))
    over_rows(sum_rows(images, mask, sums, _TILE), len(mask), tile=_TILE)
    return sums.sum(axis=0) / np.count_nonzero(mask)


def _report_common(fit: HarmonicFit, level: NDArray[np.float64]) -> None:
    """Say how large the cosine is that pre-normalisation takes from every pixel."""
    common = np.hypot(fit.cosine @ level, fit.sine @ level) / (fit.mean @ level)
    _log.info(
        "Pre-normalisation subtracted a cosine of %.2f percent of the mean brightness from every pixel: what the film "
        "adds to all alike, or the signal of orientations that are more common than others.",
        100 * common,
    )
