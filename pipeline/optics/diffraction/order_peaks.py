"""Where an order is brightest over the angle of view, and the period that its place gives by the grating equation.

Light and viewer stand in one plane, at signed angles from the normal, so ``sin(view) + sin(light) = m lambda / d``: the
mirror's direction is minus the light's angle, and order 1 lies on the light's side of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from pipeline.optics.diffraction.directions import Directions, unit_vector

Float64Array = NDArray[np.float64]

_RIDGE_STEPS = 600
_MIRROR_WIDTHS = 8.0
"""Standard deviations of the coherence window's transform around the mirror's direction that hold no ridge."""


def plane_of_incidence(light_rad: float, azimuth_rad: float, view_rad: Float64Array) -> Directions:
    """Views in the plane of incidence, shape (A, 1), at negative angles beyond the normal as seen from the light."""
    return Directions(unit_vector(light_rad, azimuth_rad)[None, None], unit_vector(view_rad, azimuth_rad)[:, None, :])


def order_angle(period_um: float, wavelength_um: ArrayLike, order: int, light_rad: float) -> Float64Array:
    """Angle of view of an order in radians, NaN where it does not leave the surface."""
    sine = order * np.asarray(wavelength_um, np.float64) / period_um - np.sin(light_rad)
    return np.arcsin(np.where(np.abs(sine) <= 1, sine, np.nan))


def order_period(view_rad: ArrayLike, wavelength_um: ArrayLike, order: int, light_rad: float) -> Float64Array:
    """Period in um that sends an order to an angle of view."""
    return np.asarray(order * np.asarray(wavelength_um) / (np.sin(view_rad) + np.sin(light_rad)), np.float64)


def strongest_ridge(
    response: NDArray[np.floating],
    view_rad: Float64Array,
    wavelength_um: Float64Array,
    *,
    order: int,
    light_rad: float,
    share: float,
    least: float,
    sigma_per_um: float,
) -> float:
    """Period in um of the ridge over ``u / lambda`` that stands out most from what lies around it, NaN without any.

    The mean of the response's logarithm over the wavelengths, at frequencies that all of them reach, is compared with
    its median within ``share`` of each frequency. A response below ``least`` counts as that. ``sigma_per_um`` is the
    window's standard deviation, which the mirror's light has too.
    """
    shift = np.sin(view_rad) + np.sin(light_rad)
    farthest = float((np.sign(order) * shift).max()) / wavelength_um.max()
    nearest = _MIRROR_WIDTHS * sigma_per_um
    if farthest <= nearest:
        return np.nan
    frequency = np.geomspace(nearest, farthest, _RIDGE_STEPS)
    rows = [
        np.interp(np.sign(order) * frequency, shift / length, np.log(np.maximum(row, least)))
        for row, length in zip(response, wavelength_um, strict=True)
    ]
    mean = np.mean(rows, axis=0)
    around = 2 * int(np.log1p(share) / np.log(frequency[1] / frequency[0])) + 1
    above = mean - ndimage.median_filter(mean, around, mode="nearest")
    inside = np.flatnonzero((mean[1:-1] > mean[:-2]) & (mean[1:-1] >= mean[2:])) + 1
    if not len(inside):
        return np.nan
    return float(abs(order) / frequency[inside[np.argmax(above[inside])]])


def order_peaks(
    response: NDArray[np.floating],
    view_rad: Float64Array,
    wavelength_um: Float64Array,
    *,
    order: int,
    light_rad: float,
    near_um: float,
    share: float,
    contrast: float,
    least: float,
) -> tuple[Float64Array, Float64Array]:
    """The angle at which an order is brightest at each wavelength, and the middle of its line.

    A line is a Gaussian over ``sin(view)``, so the top is that of the parabola through the logarithms of the three
    samples around the brightest one. It lies beside the line's middle, because the order's own brightness ``B`` depends
    on ``q = w / lambda`` and so on the angle: by ``B' / B`` over the parabola's curvature. ``B'`` is read off the
    response itself, from the neighbouring wavelengths at the same ``u / lambda``.

    Parameters
    ----------
    response : ndarray of shape (L, A)
        At wavelengths and angles of view.
    view_rad : ndarray of shape (A,)
        Rising angles of view in the plane of incidence.
    wavelength_um : ndarray of shape (L,)
        Rising wavelengths.
    order, light_rad : int, float
        Which order, and where the light stands.
    near_um, share : float
        The period is looked for within ``near_um (1 - share)`` and ``near_um (1 + share)``.
    contrast : float
        Least ratio of a peak to the median of the response within the same range.
    least : float
        Response that is told from none; a median below it counts as that.

    Returns
    -------
    peak_rad : ndarray of shape (L,)
        NaN where no peak stands out: the brightest sample is at an end of the range, or below the contrast.
    middle_rad : ndarray of shape (L,)
        Angle of the line's middle, which the grating equation holds for.
    """
    shift = np.sin(view_rad) + np.sin(light_rad)
    logs = np.log(np.maximum(np.asarray(response, np.float64), np.finfo(np.float32).tiny))
    peak, middle = np.full(len(logs), np.nan), np.full(len(logs), np.nan)
    for i, length in enumerate(wavelength_um):
        with np.errstate(divide="ignore"):
            around = np.flatnonzero(np.abs(order * length / shift / near_um - 1) < share)
        if len(around) < 3:
            continue
        k = int(around[np.argmax(logs[i, around])])
        if k in (around[0], around[-1]) or logs[i, k] < np.log(contrast * max(np.median(response[i, around]), least)):
            continue
        top, bend = _vertex(shift[k - 1 : k + 2], logs[i, k - 1 : k + 2])
        peak[i] = top
        middle[i] = top + _slope(logs, shift, wavelength_um, i, top, light_rad) / bend
    return np.arcsin(peak - np.sin(light_rad)), np.arcsin(middle - np.sin(light_rad))


def _vertex(x: Float64Array, y: Float64Array) -> tuple[float, float]:
    """Where the parabola through three points is highest, and its second derivative."""
    bend, rise, _ = np.polyfit(x - x[1], y, 2)
    return float(x[1] - rise / (2 * bend)), float(2 * bend)


def _slope(
    logs: Float64Array, shift: Float64Array, wavelength_um: Float64Array, i: int, top: float, light_rad: float
) -> float:
    """Slope over ``sin(view)`` that an order's brightness gives the logarithm of the response."""
    at, brightness = [], []
    for j in range(len(logs))[max(0, min(i - 1, len(logs) - 3)) :][:3]:
        there = top * wavelength_um[j] / wavelength_um[i]
        if shift[1] <= there <= shift[-2] and abs(there - np.sin(light_rad)) < 1:
            k = int(np.clip(np.searchsorted(shift, there), 2, len(shift) - 2))
            part = slice(k - 2, k + 2)
            at.append(-(np.cos(light_rad) + np.sqrt(1 - (there - np.sin(light_rad)) ** 2)) / wavelength_um[j])
            brightness.append(float(np.polyval(np.polyfit(shift[part] - there, logs[j, part], 3), 0.0)))
    if len(at) < 2:
        return 0.0
    sine = top - np.sin(light_rad)
    here = -(np.cos(light_rad) + np.sqrt(1 - sine**2)) / wavelength_um[i]
    over_q = np.polyfit(np.array(at) - here, brightness, len(at) - 1)[-2]
    return float(over_q * sine / np.sqrt(1 - sine**2) / wavelength_um[i])
