"""Where rows of an intensity map over polariser angle and orientation are brightest, and the line that they follow.

Behind a polariser a fully polarised field gives ``(S0 + S1 cos 2 psi + S2 sin 2 psi) / 2``, so a row is a cosine of
period 180 degrees whatever lies on the sample, and its maximum is known exactly from samples of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.optics.angles import axial_difference, axial_median, wrap_axial
from pipeline.optics.harmonic import harmonic_fit

Float64Array = NDArray[np.float64]

ROUNDING = 1e-12
"""Amplitude, of the largest intensity, below which a row is flat but for rounding."""


@dataclass(frozen=True)
class RowMaxima:
    """The cosine through each row.

    Attributes
    ----------
    polarizer_rad : ndarray of shape (T,), float64
        Where the row is brightest, in [0, pi); NaN where it is flat.
    amplitude : ndarray of shape (T,), float64
        Of the cosine.
    residual : ndarray of shape (T,), float64
        Root mean square of what the cosine leaves, in units of its amplitude; NaN where the row is flat.
    """

    polarizer_rad: Float64Array
    amplitude: Float64Array
    residual: Float64Array


def row_maxima(intensity: ArrayLike, polarizer_rad: ArrayLike, *, least_amplitude: float | None = None) -> RowMaxima:
    """Fit a cosine to every row of a map of shape (T, P).

    Parameters
    ----------
    intensity : array_like of shape (T, P)
        A row an orientation, a column an angle of the polariser.
    polarizer_rad : array_like of shape (P,)
        Angles of the polariser.
    least_amplitude : float, optional
        Rows whose cosine is no larger are flat; by default 1e-12 of the largest intensity.

    Raises
    ------
    ValueError
        Fewer than three polariser angles are distinct modulo 180 degrees.
    """
    rows = np.asarray(intensity, np.float64)
    double = 2 * np.asarray(polarizer_rad, np.float64)
    fit = harmonic_fit(polarizer_rad)
    mean, cosine, sine = rows @ fit.mean, rows @ fit.cosine, rows @ fit.sine
    amplitude = np.hypot(cosine, sine)
    flat = amplitude <= (ROUNDING * np.abs(rows).max() if least_amplitude is None else least_amplitude)
    left = rows - (mean[:, None] + np.outer(cosine, np.cos(double)) + np.outer(sine, np.sin(double)))
    residual = np.sqrt(np.mean(left**2, axis=1)) / np.where(flat, np.nan, amplitude)
    return RowMaxima(np.where(flat, np.nan, wrap_axial(np.arctan2(sine, cosine) / 2)), amplitude, residual)


def normalized_rows(intensity: ArrayLike) -> Float64Array:
    """``I_norm``: each row less its mean, by its scaled standard deviation (equation 10), so that cosines reach 1.

    The polariser's angles divide half a turn into equal steps. A row without any variation is 0.
    """
    rows = np.asarray(intensity, np.float64)
    varying = rows - rows.mean(axis=1, keepdims=True)
    scale = np.sqrt(2 * np.mean(varying**2, axis=1, keepdims=True))
    return varying / np.where(scale > 0, scale, 1)


def deviation_from_line(polarizer_rad: ArrayLike, orientation_rad: ArrayLike) -> tuple[Float64Array, float]:
    """Signed distance of row maxima from ``psi = theta + offset``, in [-pi/2, pi/2), and the offset in [0, pi).

    The offset is the axial median of ``psi - theta``: that of the line with the smallest mean distance.
    """
    turn = axial_difference(polarizer_rad, orientation_rad)
    offset = axial_median(turn)
    return axial_difference(turn, offset), offset


def deviation_from_branches(polarizer_rad: ArrayLike, orientation_rad: ArrayLike) -> Float64Array:
    """Signed distance of row maxima from the nearer of two lines a right angle apart, in [-pi/4, pi/4).

    Where maximum and minimum change places from one row to the next, the maxima leap from one of them to the other.
    """
    double = 2 * axial_difference(polarizer_rad, orientation_rad)
    return axial_difference(double, axial_median(double)) / 2


def winding(polarizer_rad: ArrayLike) -> float:
    """Half turns that the row maxima make while the grating makes one.

    Rows follow each other at equal steps over half a turn. On the line it is 1; where the film outweighs the grating
    0, and orientations that differ share a maximum. NaN where a row is flat, or where from one row to the next a
    maximum leaps by 45 degrees or more, so that its direction is open.
    """
    angle = np.asarray(polarizer_rad, np.float64)
    step = axial_difference(np.roll(angle, -1), angle)
    if not np.all(np.abs(step) < np.pi / 4):
        return float("nan")
    return float(np.round(np.sum(step) / np.pi)) + 0.0
