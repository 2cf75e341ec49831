"""The simplest estimator of orientation that a scene needs, and how many photographs would do."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.data.gratings import OrientationMap
from pipeline.data.photographs import PolarizerSequence
from pipeline.limits import above_zero, at_least, refuse, zero_or_more
from pipeline.optics.angles import axial_difference, axial_median
from pipeline.optics.curve_reading import orientation_gradient
from pipeline.optics.curve_search import CurveFit
from pipeline.optics.harmonic import harmonic_fit
from pipeline.optics.response_curve import StokesNoise, response_curve
from pipeline.stages.fit._cloud import Cloud, curve_of
from pipeline.stages.fit._photographs import checked_fit
from pipeline.stages.fit.cosine import _fitted
from pipeline.stages.fit.jones import POOR_MISFIT, _read_off, _tolerance_jones

_log = logging.getLogger(__name__)

Float64Array = NDArray[np.float64]

PLAIN, NORMALIZED, CURVE = "cosine", "cosine, pre-normalised", "the whole forward model"
_FEWEST = {PLAIN: 4, NORMALIZED: 4, CURVE: 3}
"""Photographs below which an estimator does not know how well it fits."""

_tolerance_auto = _tolerance_jones


def auto(
    photos: PolarizerSequence,
    *,
    accuracy_deg: float = 1.0,
    film_axis_deg: float | None = 0.0,
    threshold: float | None = None,
    points: int = 16000,
    absolute_within_deg: float = 0.5,
) -> OrientationMap:
    """Estimate orientations by the simplest method that is accurate enough for this scene.

    Some pixels' Stokes parameters are fitted by the curve of the whole forward model. Where they lie on it, what a
    cosine would make of the same pixels is compared with what the curve makes of them, one offset removed: its bias,
    with and without pre-normalisation. The noise that the photographs show gives the standard error. The first of
    cosine, pre-normalised cosine and forward model whose bias and noise together stay within ``accuracy_deg`` is taken;
    if none does, the one that comes nearest. Where the pixels lie on no curve, as where the film varies over the
    sample, the cosine is taken after which they lie nearer to a circle. The reason is reported.

    Parameters
    ----------
    photos : PolarizerSequence
        K photographs, K >= 3, aligned; polariser angles distinct modulo 180 degrees.
    accuracy_deg : float
        Mean error that is accurate enough.
    film_axis_deg : float, optional
        Direction of the film's axis; ``null`` searches it.
    threshold : float, optional
        Least mean intensity of a pixel that diffracts; found from the histogram by default.
    points : int
        Pixels that are looked at.
    absolute_within_deg : float
        As of ``fit.jones``, whose map is absolute only where its offset is known to this.

    Returns
    -------
    OrientationMap
        Of the method taken. ``parameters`` hold what each would have: ``cosine_bias_deg``,
        ``prenormalized_bias_deg`` (left out where no curve fits), ``noise_deg``, the mean error that noise alone makes,
        and ``photographs_enough``: how many of the same exposure would do, never fewer than the method needs to know
        how well it fits. Those of ``fit.jones`` come with it where it was taken.

    Raises
    ------
    InputError
        Fewer than three distinct polariser angles, no pixel left, or settings that cannot be.
    """
    _check_auto(accuracy_deg=accuracy_deg, points=points, absolute_within_deg=absolute_within_deg, threshold=threshold)
    checked_fit(photos)
    known = {} if film_axis_deg is None else {"film_axis_rad": float(np.deg2rad(film_axis_deg))}
    cloud, found = curve_of(photos, known, threshold, points)
    choice = _on_a_curve(cloud, found, accuracy_deg) if found.misfit <= POOR_MISFIT else _on_none(cloud, found)
    _log.info("Taken: %s. %s", choice.method, choice.reason)
    enough = _enough(choice, len(cloud.values), accuracy_deg)
    if enough > len(cloud.values):
        _log.warning("%d photographs of this exposure would reach %g deg.", enough, accuracy_deg)
    else:
        _log.info("%d photographs of this exposure would do for %g deg.", enough, accuracy_deg)
    if choice.method == CURVE:
        result = _read_off(cloud, found, float(np.deg2rad(absolute_within_deg)))
    else:
        result = _fitted(cloud.photos, prenormalize=choice.method == NORMALIZED, cut=cloud.least)
    figures = {**result.parameters, **choice.figures, "photographs_enough": float(enough)}
    return dataclasses.replace(result, parameters=figures)


def _check_auto(
    *, accuracy_deg: float, points: int, absolute_within_deg: float, threshold: float | None, **_: object
) -> None:
    """Refuse what cannot be reached before anything runs."""
    refuse(
        above_zero(accuracy_deg=accuracy_deg, absolute_within_deg=absolute_within_deg),
        at_least(100, "fewer do not show a curve", points=points),
        zero_or_more(threshold=threshold),
    )


@dataclass(frozen=True)
class _Choice:
    """A method, why it was taken, its mean errors from bias and from noise, and what is reported of all."""

    method: str
    reason: str
    bias_deg: float
    noise_deg: float
    figures: Mapping[str, float]


def _on_a_curve(cloud: Cloud, found: CurveFit, accuracy_deg: float) -> _Choice:
    curve = response_curve(found.grating)
    nearest = cKDTree(curve.stokes).query(cloud.points.stokes)[1]
    reference = curve.orientation_rad[nearest]
    bias = {
        PLAIN: _bias_deg(_phases(cloud, prenormalize=False), reference),
        NORMALIZED: _bias_deg(_phases(cloud, prenormalize=True), reference),
        CURVE: 0.0,
    }
    noise = StokesNoise(cloud.points.polarizer_rad, cloud.points.photo_weights)
    gradient, covariance = orientation_gradient(curve, noise), noise.covariance(curve.stokes)
    width = np.sqrt((gradient[:, None, :] @ covariance @ gradient[:, :, None])[:, 0, 0])
    noise_deg = float(np.rad2deg(np.median(width[nearest] * cloud.points.scale)) * np.sqrt(2 / np.pi))
    error = {method: float(np.hypot(value, noise_deg)) for method, value in bias.items()}
    method = next((m for m in bias if error[m] <= accuracy_deg), min(error, key=lambda m: error[m]))
    reason = (
        f"Against the curve that the pixels lie on, a cosine is biased by {bias[PLAIN]:.2f} deg, a pre-normalised one "
        f"by {bias[NORMALIZED]:.2f} deg; noise adds {noise_deg:.2f} deg. Asked for are {accuracy_deg:g} deg."
    )
    figures = {
        "cosine_bias_deg": bias[PLAIN],
        "prenormalized_bias_deg": bias[NORMALIZED],
        "noise_deg": noise_deg,
        "curve_misfit": found.misfit,
    }
    return _Choice(method, reason, bias[method], noise_deg, figures)


def _bias_deg(phase_rad: Float64Array, reference_rad: Float64Array) -> float:
    turn = axial_difference(phase_rad, reference_rad)
    return float(np.rad2deg(np.abs(axial_difference(turn, axial_median(turn))).mean()))


def _phases(cloud: Cloud, *, prenormalize: bool) -> Float64Array:
    """What a cosine says of the cloud's pixels."""
    c, s = _cosines(cloud, prenormalize=prenormalize)
    return np.asarray(np.arctan2(s, c) / 2)


def _cosines(cloud: Cloud, *, prenormalize: bool) -> Float64Array:
    """Cosine and sine of each pixel, shape (2, P)."""
    fit = harmonic_fit(cloud.points.polarizer_rad)
    values = cloud.values - cloud.values.mean(axis=1, keepdims=True) if prenormalize else cloud.values
    return np.stack([fit.cosine, fit.sine]) @ values


def _on_none(cloud: Cloud, found: CurveFit) -> _Choice:
    level = cloud.values.mean(axis=0)
    scatter = {}
    for method in (PLAIN, NORMALIZED):
        radius = np.hypot(*_cosines(cloud, prenormalize=method == NORMALIZED)) / level
        middle = np.median(radius)
        scatter[method] = float(1.4826 * np.median(np.abs(radius - middle)) / middle)
    method = min(scatter, key=lambda m: scatter[m])
    reason = (
        f"The pixels lie {found.misfit:.1f} times their noise from the best curve, so no forward model of one film "
        f"holds. The modulation scatters by {100 * scatter[PLAIN]:.0f} percent, after pre-normalisation by "
        f"{100 * scatter[NORMALIZED]:.0f} percent; a cosine alone would leave none."
    )
    noise_deg = float(
        np.rad2deg(np.median(cloud.points.scale) * np.sqrt(2 / len(cloud.values)) / 2 * np.sqrt(2 / np.pi))
    )
    radius = np.hypot(*_cosines(cloud, prenormalize=method == NORMALIZED)) / level
    noise_deg /= float(np.median(radius))
    # A scatter of the radius comes with one of the angle of the same size.
    bias_deg = float(np.rad2deg(scatter[method]) / 2)
    return _Choice(method, reason, bias_deg, noise_deg, {"noise_deg": noise_deg, "curve_misfit": found.misfit})


def _enough(choice: _Choice, count: int, accuracy_deg: float) -> int:
    """Photographs that bring bias and noise together to the accuracy; all there are where bias alone is larger."""
    left = accuracy_deg**2 - choice.bias_deg**2
    needed = int(np.ceil(count * choice.noise_deg**2 / left)) if left > 0 else count
    return max(_FEWEST[choice.method], needed)
