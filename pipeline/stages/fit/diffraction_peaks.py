"""The period of a surface from the angles at which an order of diffraction is brightest."""

from __future__ import annotations

import logging
from typing import Literal

import numpy as np

from pipeline.data.diffraction import DiffractionPeaks
from pipeline.data.height_fields import HeightField, Periodicity
from pipeline.devices.virtual_surface import check_recipe, recipe_of, responses
from pipeline.errors import InputError
from pipeline.limits import above_zero, at_least, refuse, within
from pipeline.optics.colour import FIRST_NM, LAST_NM
from pipeline.optics.diffraction.order_peaks import order_peaks, order_period, plane_of_incidence, strongest_ridge
from pipeline.optics.diffraction.patch import frequency_sigma

_log = logging.getLogger(__name__)

# Sums are float32, and processors add their terms in different orders.
_tolerance_diffraction_peaks = {"response": 1e-5, "peak_rad": 1e-5, "period_um": 1e-4, "metrics": 1e-3}
_FARTHEST_DEG = 89.5
_ALIGNED_DEG = 10.0
"""Angle between the plane of incidence and a period's direction beyond which its orders miss the plane."""


def diffraction_peaks(
    surface: HeightField,
    periods: Periodicity | None = None,
    *,
    evaluator: Literal["chebyshev", "flss", "nmm", "pq", "pq_sinc", "nufft", "direct"] = "chebyshev",
    light_deg: float = 75.0,
    azimuth_deg: float = 0.0,
    order: int = 1,
    near_um: float | None = None,
    search_percent: float = 20.0,
    contrast: float = 4.0,
    line_middle: bool = True,
    wavelength_step: float = 5.0,
    angle_step_deg: float = 0.05,
    coherence_um: float = 65.0,
    tolerance: float = 1e-3,
    terms: int | None = None,
) -> DiffractionPeaks:
    """Light a surface in one plane, and read its period off where an order is brightest at each wavelength.

    The response, without Fresnel reflection and shadowing, is evaluated at wavelengths from 380 to 780 nm and angles of
    view in the plane of incidence. The brightest angle of each wavelength is refined by the parabola through the
    logarithm, and gives the period ``order lambda / (sin view + sin light)``, angles of view being negative beyond the
    normal. A peak counts where it is ``contrast`` times as bright as the median of the range that is searched.

    Parameters
    ----------
    surface : HeightField
        Without gaps.
    periods : Periodicity, optional
        Where to look, and what to compare with; needed by ``nmm``.
    evaluator : str
        As of ``render.brdf_map``.
    light_deg : float
        Angle of incidence from the normal.
    azimuth_deg : float
        Direction of the plane of incidence, in which the light stands, anticlockwise from +x.
    order : int
        Not 0; above 0 on the light's side of the mirror's direction.
    near_um : float, optional
        Period to look around; by default that of ``periods`` nearest to the plane, if one is within 10 degrees of it,
        else that of the strongest ridge over ``u / lambda``.
    search_percent : float
        How far around it to look; at most half way to the next order.
    contrast : float
        Least ratio of a peak to the median of the range, or to ``tolerance^2`` where that is below it.
    line_middle : bool
        Whether to take the middle of the order's line for the period, which is beside the brightest angle because the
        order is not equally bright at all angles. Peaks stay the brightest angles.
    wavelength_step : float
        In nm.
    angle_step_deg : float
        Step of the angles of view.
    coherence_um, tolerance, terms
        As of ``render.brdf_map``.

    Returns
    -------
    DiffractionPeaks
        With the figures ``period_um``, the mean over the wavelengths; ``period_spread_nm``, their standard deviation;
        ``peaks``, how many wavelengths show one; and, where ``periods`` has one in
        the plane, ``spectrum_period_um`` and ``off_spectrum_percent``.

    Raises
    ------
    InputError, InputErrors
        Heights are missing, the evaluator needs what is not there, or a setting is impossible.

    References
    ----------
    Single, Diffraction Shader (2014), section 3.3 and equation 3.2.
    """
    recipe = recipe_of(evaluator, coherence_um, tolerance, terms, periods)
    light_rad, azimuth_rad = float(np.deg2rad(light_deg)), float(np.deg2rad(azimuth_deg))
    count = round(2 * _FARTHEST_DEG / angle_step_deg) + 1
    view_rad = np.deg2rad(np.linspace(-_FARTHEST_DEG, _FARTHEST_DEG, count))
    wavelength_nm = np.arange(FIRST_NM, LAST_NM + wavelength_step / 2, wavelength_step)
    _tell_narrow_lines(angle_step_deg, coherence_um, tolerance)
    directions = plane_of_incidence(light_rad, azimuth_rad, view_rad)
    response = responses(surface, recipe, directions, wavelength_nm, np.eye(len(wavelength_nm))).sums[..., 0]
    share = min(search_percent / 100, 0.5 / (abs(order) + 0.5))
    expected = _in_plane(periods, azimuth_rad)
    near = near_um or expected
    if near is None:
        near = strongest_ridge(
            response,
            view_rad,
            wavelength_nm / 1000,
            order=order,
            light_rad=light_rad,
            share=share,
            least=tolerance**2,
            sigma_per_um=frequency_sigma(coherence_um),
        )
        if np.isnan(near):
            _log.warning("No ridge of order %d leaves the surface at all wavelengths.", order)
        else:
            _log.info("No period is known in the plane of incidence; the strongest ridge is at %.4g um.", near)
    peak_rad, middle_rad = order_peaks(
        response,
        view_rad,
        wavelength_nm / 1000,
        order=order,
        light_rad=light_rad,
        near_um=near,
        share=share,
        contrast=contrast,
        least=tolerance**2,
    )
    period = order_period(middle_rad if line_middle else peak_rad, wavelength_nm / 1000, order, light_rad)
    missing = int(np.isnan(period).sum())
    if missing and np.isfinite(near):
        _log.warning(
            "At %d of %d wavelengths no peak of order %d stands out: none within %.3g percent of %.4g um is %g times "
            "as bright as the median of that range.",
            missing,
            len(period),
            order,
            100 * share,
            near,
            contrast,
        )
    known = period[np.isfinite(period)]
    figures = {"peaks": float(known.size)}
    if known.size:
        figures |= {"period_um": float(known.mean()), "period_spread_nm": float(1000 * known.std())}
    if expected is not None:
        figures["spectrum_period_um"] = expected
        if known.size:
            figures["off_spectrum_percent"] = 100 * (figures["period_um"] / expected - 1)
    return DiffractionPeaks(
        wavelength_nm,
        view_rad,
        response,
        peak_rad,
        period,
        light_rad,
        azimuth_rad,
        order,
        near,
        evaluator,
        surface.caption,
        figures,
    )


def _tell_narrow_lines(angle_step_deg: float, coherence_um: float, tolerance: float) -> None:
    """Warn where the three samples around a peak may lie beyond the window's reach, which ends at ``tolerance``."""
    reach = np.sqrt(2 * np.log(1 / tolerance)) * frequency_sigma(coherence_um) * FIRST_NM / 1000
    widest_deg = float(np.rad2deg(reach)) / 1.5
    if angle_step_deg > widest_deg:
        _log.warning(
            "Lines under a coherence window of %g um are too narrow for steps of %g degrees: peaks are missed or "
            "misplaced. Steps of %.2g degrees would do.",
            coherence_um,
            angle_step_deg,
            0.9 * widest_deg,
        )


def _in_plane(periods: Periodicity | None, azimuth_rad: float) -> float | None:
    """The period whose direction is nearest to the plane of incidence, None if all miss it."""
    if periods is None or not len(periods.period_um):
        return None
    off = np.abs((periods.direction_rad - azimuth_rad + np.pi / 2) % np.pi - np.pi / 2)
    nearest = int(np.argmin(off))
    return float(periods.period_um[nearest]) if off[nearest] <= np.deg2rad(_ALIGNED_DEG) else None


def _check_diffraction_peaks(
    *,
    light_deg: float,
    order: int,
    near_um: float | None,
    search_percent: float,
    contrast: float,
    wavelength_step: float,
    angle_step_deg: float,
    coherence_um: float,
    tolerance: float,
    terms: int | None,
    **_: object,
) -> None:
    """Refuse impossible directions and sizes before anything runs."""
    refuse(
        within(0, 89, light_deg=light_deg),
        [] if order else [InputError("order is 0", where="order", expected="an order that a period sends aside")],
        above_zero(near_um=near_um),
        within(1, 50, search_percent=search_percent),
        at_least(1, "a peak is not below what lies around it", contrast=contrast),
        within(0.5, (LAST_NM - FIRST_NM) / 2, wavelength_step=wavelength_step),
        within(0.005, 1, angle_step_deg=angle_step_deg),
    )
    check_recipe(coherence_um=coherence_um, tolerance=tolerance, terms=terms)
