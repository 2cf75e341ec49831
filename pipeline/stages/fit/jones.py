"""Grating orientation from the whole forward model: film, grating and polariser."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.data.gratings import OrientationMap
from pipeline.data.photographs import PolarizerSequence
from pipeline.errors import InputError
from pipeline.limits import above_zero, at_least, refuse, within, zero_or_more
from pipeline.optics.curve_reading import Reading, orientation_gradient, read_rows, reading
from pipeline.optics.curve_search import CurveFit, Points, rival_turn, turn_by_unknowns
from pipeline.optics.harmonic import HarmonicFit, harmonic_fit
from pipeline.optics.response_curve import StokesNoise, response_curve
from pipeline.parallel import over_rows
from pipeline.stages.fit._cloud import Cloud, curve_of
from pipeline.stages.fit._photographs import checked_fit
from pipeline.stages.fit._uncertainty import measured

_log = logging.getLogger(__name__)

Float64Array = NDArray[np.float64]

_TILE = 128
_SHOWN = 4000
_SURE = 2.0
POOR_MISFIT = 3.0
"""Distance from the curve, in units of their noise, beyond which the pixels are not its."""

# Processors round differently in the last bits, and the search ends where a step no longer helps.
_tolerance_jones = {
    "orientation_rad": 1e-3,
    "correlation": 1e-5,
    "intensity": 1e-4,
    "standard_error_rad": 1e-3,
    "parameters": 0.1,
    "stokes": 1e-4,
}


def jones(
    photos: PolarizerSequence,
    *,
    amplitude_ratio: float | None = None,
    phase_deg: float | None = None,
    retardation_deg: float | None = None,
    film_axis_deg: float | None = 0.0,
    threshold: float | None = None,
    points: int = 16000,
    absolute_within_deg: float = 0.5,
) -> OrientationMap:
    """Find the curve on which the sample's polarisation lies, and read every pixel's orientation off it.

    Behind an ideal polariser the photographs hold three numbers a pixel: brightness and two Stokes parameters relative
    to it. Those two lie on a closed curve that the orientation traces, and whose shape is the whole sample's: ``R = r
    exp(i zeta)`` of its gratings, and the film's retardation. The curve is fitted robustly to some of the pixels, from
    many starts since there are false minima, each weighed by the likelihood of the points; then every pixel takes the
    orientation of the nearest place on it, in units of its photon noise. What is given is not searched for.

    With a film the map is absolute: its axis is the reference. Without one the curve is a circle around the origin, and
    the offset is not known to any method that looks through a polariser only. Whether it is comes out of the fit's
    covariance and of other minima that fit as well; the report says so and ``absolute`` tells. Gratings of ``zeta``
    and ``-zeta`` with the reciprocal ratio differ by 90 degrees and cannot be told apart; ``zeta`` is taken between 0
    and 180 degrees. For the same reason the handedness of the panel's light is taken for known, ``(1, -i)`` along x and
    y: under light of the other one a map that is absolute is turned by 90 degrees, with nothing to show it.

    Parameters
    ----------
    photos : PolarizerSequence
        K photographs, K >= 3, aligned; polariser angles distinct modulo 180 degrees.
    amplitude_ratio, phase_deg : float, optional
        ``r`` and ``zeta`` of the zeroth order, where known.
    retardation_deg : float, optional
        Of one pass through the film, where known; negative where the film delays what vibrates along its axis.
    film_axis_deg : float, optional
        Direction of the film's axis, anticlockwise from +x; ``null`` searches it. Where another axis than the one given
        fits decidedly better, a warning says so and the map stays relative.
    threshold : float, optional
        Least mean intensity of a pixel that diffracts; found from the histogram by default, as by ``fit.cosine``.
    points : int
        Pixels that the curve is fitted to.
    absolute_within_deg : float
        The map counts as absolute where its offset is known to this: two standard deviations are no more.

    Returns
    -------
    OrientationMap
        ``standard_error_rad`` comes from the photon noise that the photographs show, from the uncertainty of the curve
        (its offset left out where the map is relative), from another branch of the curve nearby, and from how much
        worse than its noise a pixel fits, as one does that mixes two facets. ``intensity`` is the brightness over a
        turn of the polariser, its dependence on the orientation removed. ``parameters`` are those of the curve,
        ``stokes`` some of the points on it.

    Raises
    ------
    InputError
        Fewer than three distinct polariser angles, no pixel left, or settings that cannot be.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018),
    section 5.2 (the forward model); the estimator is this project's own.
    """
    _check_jones(
        amplitude_ratio=amplitude_ratio,
        phase_deg=phase_deg,
        retardation_deg=retardation_deg,
        points=points,
        absolute_within_deg=absolute_within_deg,
        threshold=threshold,
    )
    given = {"amplitude_ratio": amplitude_ratio} | {
        name.replace("_deg", "_rad"): None if value is None else float(np.deg2rad(value))
        for name, value in {
            "phase_deg": phase_deg,
            "retardation_deg": retardation_deg,
            "film_axis_deg": film_axis_deg,
        }.items()
    }
    checked_fit(photos)
    cloud, found = curve_of(photos, {n: v for n, v in given.items() if v is not None}, threshold, points)
    return _read_off(cloud, found, float(np.deg2rad(absolute_within_deg)))


def _read_off(cloud: Cloud, found: CurveFit, limit_rad: float) -> OrientationMap:
    """Orientations of all pixels by the curve that was found, absolute where its offset is known to ``limit_rad``."""
    photos = cloud.photos
    fit = harmonic_fit(photos.polarizer_rad, cloud.points.photo_weights)
    lookup, offset_rad, absolute = _prepared(found, fit, cloud.points, limit_rad)
    _report(found, offset_rad, absolute)
    orientation, correlation, brightness, error = (np.empty(photos.valid.shape, np.float32) for _ in range(4))
    mask = np.empty(photos.valid.shape, np.bool_)
    rows = read_rows(
        photos.images,
        photos.valid,
        fit,
        lookup,
        gain=cloud.gain,
        least=cloud.least,
        out=(orientation, correlation, brightness, error),
        mask=mask,
    )
    over_rows(rows, len(mask), tile=_TILE)
    return OrientationMap(
        orientation,
        correlation,
        brightness,
        mask,
        photos.pixel_mm,
        absolute,
        standard_error_rad=error,
        parameters=_parameters(found, offset_rad, cloud.gain),
        stokes=cloud.points.take(_SHOWN).stokes.astype(np.float32),
    )


def _check_jones(
    *,
    amplitude_ratio: float | None,
    phase_deg: float | None,
    retardation_deg: float | None,
    points: int,
    absolute_within_deg: float,
    threshold: float | None,
    **_: object,
) -> None:
    """Refuse what no grating has, before anything runs."""
    problems: list[InputError] = []
    if amplitude_ratio is not None:
        problems += within(0.5, 2, amplitude_ratio=amplitude_ratio)
    if phase_deg is not None:
        problems += within(0, 180, phase_deg=phase_deg)
    if retardation_deg is not None:
        problems += within(-90, 90, retardation_deg=retardation_deg)
    refuse(
        problems,
        at_least(100, "fewer do not show a curve", points=points),
        above_zero(absolute_within_deg=absolute_within_deg),
        zero_or_more(threshold=threshold),
    )


def _prepared(found: CurveFit, fit: HarmonicFit, cloud: Points, limit_rad: float) -> tuple[Reading, float, bool]:
    """The look-up, the standard deviation of the map's offset, and whether the map counts as absolute.

    The deviation is infinite where another curve fits as well.
    """
    curve = response_curve(found.grating)
    noise = StokesNoise(cloud.polarizer_rad, cloud.photo_weights)
    turn = turn_by_unknowns(found, curve, orientation_gradient(curve, noise))
    nearest = cKDTree(curve.stokes).query(cloud.stokes)[1]
    common = np.median(turn[nearest], axis=0)
    offset = float(np.sqrt(common @ found.covariance @ common))
    elsewhere = any(np.median(np.abs(rival_turn(found, rival, cloud.stokes))) > limit_rad for rival in found.rivals)
    if elsewhere or found.other_axis_rad is not None:
        offset = np.inf
    absolute = _SURE * offset <= limit_rad
    own = turn if absolute else turn - common
    variance = np.einsum("tu,uv,tv->t", own, found.covariance, own)
    for rival in found.rivals:
        turned = rival_turn(found, rival, curve.stokes)
        usual = 0.0 if absolute else np.median(turned[nearest])
        variance = np.maximum(variance, (turned - usual) ** 2)
    spread = 6 * float(np.median(cloud.scale)) * np.sqrt(float(noise.covariance(curve.stokes).trace(0, 1, 2).max()))
    return reading(curve, noise, fit, variance, spread), offset, absolute


def _report(found: CurveFit, offset_rad: float, absolute: bool) -> None:
    grating, deviation = found.grating, found.deviation
    degrees = [
        f"{name} {measured(np.rad2deg(getattr(grating, field)), np.rad2deg(getattr(deviation, field)))} deg"
        for name, field in (("phase", "phase_rad"), ("retardation", "retardation_rad"), ("film axis", "film_axis_rad"))
    ]
    _log.info(
        "Curve found: amplitude ratio %s, %s; the pixels lie %.2f times their noise from it.",
        measured(grating.amplitude_ratio, deviation.amplitude_ratio),
        ", ".join(degrees),
        found.misfit,
    )
    if absolute:
        _log.info("The map is absolute: its offset has a standard deviation of %.2g deg.", np.rad2deg(offset_rad))
    elif np.isfinite(offset_rad):
        _log.warning(
            "The map stays relative: its offset has a standard deviation of %.1f deg; without birefringence nothing "
            "tells it.",
            min(np.rad2deg(offset_rad), 90.0),
        )
    else:
        _log.warning("The map stays relative: curves with other offsets fit the photographs as well.")
    if found.other_axis_rad is not None:
        _log.warning(
            "The film's axis was given as %.1f deg, and one at %.1f deg fits better: film_axis_deg=%.1f, or null to "
            "search it.",
            np.rad2deg(grating.film_axis_rad),
            *(2 * [np.rad2deg(found.other_axis_rad) % 180]),
        )
    if found.misfit > POOR_MISFIT:
        _log.warning(
            "The pixels lie %.1f times their noise from the best curve: the photographs are not those of one kind of "
            "grating under one film, or are badly aligned.",
            found.misfit,
        )


def _parameters(found: CurveFit, offset_rad: float, gain: float) -> dict[str, float]:
    figures = {
        "amplitude_ratio": found.grating.amplitude_ratio,
        "phase_deg": np.rad2deg(found.grating.phase_rad),
        "retardation_deg": np.rad2deg(found.grating.retardation_rad),
        "film_axis_deg": np.rad2deg(found.grating.film_axis_rad) % 180,
        "offset_std_deg": min(np.rad2deg(offset_rad), 90.0),
        "curve_misfit": found.misfit,
        "electrons_full_scale": 1 / gain,
    }
    return {name: float(value) for name, value in figures.items()}
