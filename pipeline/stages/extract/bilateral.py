"""Orientation maps made smooth within facets and sharp between them."""

from __future__ import annotations

import dataclasses
import logging

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import OrientationMap
from pipeline.limits import above_zero, above_zero_up_to, refuse, zero_or_more
from pipeline.optics.angles import wrap_axial
from pipeline.optics.bilateral import average_rows, pivot_rows
from pipeline.parallel import over_rows
from pipeline.progress import advance

_log = logging.getLogger(__name__)

Float32Array = NDArray[np.float32]

_NARROWEST_DEG = 1.0
_NOISE_WIDTHS = 4.0

# What a step of 14 bits in a simulated photograph comes to: 1.2e-5 was seen; last bits of float32 do less than 2e-6.
_tolerance_bilateral = {"orientation_rad": 1e-4, "correlation": 1e-4, "intensity": 1e-4}


def bilateral(
    orientation: OrientationMap,
    *,
    sigma_pixel: float = 3.0,
    sigma_theta_deg: float = 20.05,
    iterations: int = 10,
    pivot_radius: int = 2,
    adaptive: bool = True,
) -> OrientationMap:
    """Smooth by an adaptive, iterated bilateral filter on ``(cos 2 theta, sin 2 theta)``.

    Every iteration takes for each pixel a pivot from a small window, then the mean of the samples around it, weighted
    by distance, by closeness to the pivot and by the square of the fit's correlation, where that is known. Pixels
    outside the mask take no part and stay masked.

    The pivot is the sample of the window that most of the others support within the filter's angular width. An ordinary
    median of a window that lies across an edge is the blurred pixel in the middle; this one is on one of the two
    sides, so pixels that mix two facets snap to one. Closeness is counted by Tukey's biweight, which follows a Gaussian
    of ``sigma_theta_deg`` near the pivot and is zero beyond twice that, so far orientations pull nothing, however
    often the filter is iterated.

    Parameters
    ----------
    orientation : OrientationMap
        Of shape (M, N).
    sigma_pixel : float
        Standard deviation of the spatial weight, in pixels.
    sigma_theta_deg : float
        Angular width, in degrees: that of the Gaussian with the biweight's curvature.
    iterations : int
        About ten for pictures under a point light, 50 under environment light.
    pivot_radius : int
        Half width of the window that the pivot is taken from.
    adaptive : bool
        Narrow the angular width to four times the map's own noise (at least 1 degree) where that is less than
        ``sigma_theta_deg``, so that facets of similar orientation are kept apart. The noise is the median absolute
        second difference along the rows, which edges and slopes do not touch; the width used is reported.

    Returns
    -------
    OrientationMap
        With the same mask, correlation and intensity.

    Raises
    ------
    InputError, InputErrors
        A width is not above 0, or a radius or count below it.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018),
    section 6.2.
    """
    _check_bilateral(
        sigma_pixel=sigma_pixel, sigma_theta_deg=sigma_theta_deg, iterations=iterations, pivot_radius=pivot_radius
    )
    theta = np.where(orientation.mask, orientation.orientation_rad, np.float32(np.nan))
    known = np.isfinite(theta)
    doubled = np.where(known, 2 * theta, np.float32(0)).astype(np.float32)
    trust = orientation.correlation if np.isfinite(orientation.correlation[known]).any() else np.ones_like(theta)
    weight = np.where(known, np.nan_to_num(trust) ** 2, 0).astype(np.float32)
    sigma_rad = np.deg2rad(sigma_theta_deg)
    if adaptive:
        sigma_rad = _narrowed(theta, sigma_rad)
    steepness = float(1 / np.sin(min(2 * sigma_rad, np.pi / 2)) ** 2)
    reach = int(np.ceil(2.5 * sigma_pixel))
    offset = np.arange(-reach, reach + 1)
    spatial = np.exp(-(offset[:, None] ** 2 + offset**2) / (2 * sigma_pixel**2)).astype(np.float32)
    pad = max(reach, pivot_radius)
    vector = np.stack([np.cos(doubled), np.sin(doubled)]).astype(np.float32)
    padded_weight = np.pad(weight, pad)
    for i in range(iterations):
        vector = _iterated(vector, padded_weight, spatial, steepness, pivot_radius if i == 0 else min(pivot_radius, 1))
        advance(i + 1, iterations)
    smooth = wrap_axial(np.arctan2(vector[1], vector[0]) / 2).astype(np.float32)
    smooth[smooth >= np.float32(np.pi)] = 0
    return dataclasses.replace(orientation, orientation_rad=np.where(known, smooth, np.float32(np.nan)))


def _check_bilateral(
    *, sigma_pixel: float, sigma_theta_deg: float, iterations: int, pivot_radius: int, **_: object
) -> None:
    """Refuse impossible widths and counts before anything runs."""
    refuse(
        above_zero(sigma_pixel=sigma_pixel),
        above_zero_up_to(90, sigma_theta_deg=sigma_theta_deg),
        zero_or_more(iterations=iterations, pivot_radius=pivot_radius),
    )


def _iterated(
    vector: Float32Array, weight: Float32Array, spatial: Float32Array, steepness: float, pivot_radius: int
) -> Float32Array:
    pad = (weight.shape[0] - vector.shape[1]) // 2
    padded = np.pad(vector, ((0, 0), (pad, pad), (pad, pad)))
    pivot = np.empty_like(vector)
    smooth = np.empty_like(vector)

    def rows(start: int, stop: int) -> None:
        pivot_rows(padded, weight, pivot_radius, steepness, start, stop, pivot)
        average_rows(padded, weight, pivot, spatial, steepness, start, stop, smooth)

    over_rows(rows, vector.shape[1], tile=16)
    return smooth


def _narrowed(theta: Float32Array, sigma_rad: float) -> float:
    """The lesser of ``sigma_rad`` and four standard deviations of the map's noise, the latter from a robust median."""
    left, middle, right = theta[:, :-2], theta[:, 1:-1], theta[:, 2:]
    bend = np.exp(2j * (middle - left)) * np.exp(2j * (middle - right))
    difference = np.angle(bend[np.isfinite(bend)]) / 2
    if not difference.size:
        return sigma_rad
    # Second difference: variance 6 sigma^2 for white noise, and no part of a slope.
    noise = 1.4826 * float(np.median(np.abs(difference))) / np.sqrt(6)
    used = min(sigma_rad, max(_NOISE_WIDTHS * noise, np.deg2rad(_NARROWEST_DEG)))
    _log.info(
        "Noise of the map %.2f deg per pixel; angular width used %.2f deg (at most %.2f).",
        np.rad2deg(noise),
        np.rad2deg(used),
        np.rad2deg(sigma_rad),
    )
    return float(used)
