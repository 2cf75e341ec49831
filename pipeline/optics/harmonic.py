"""Least-squares cosine of period 180 degrees through photographs taken at several polariser angles.

``y_k = mean + c cos 2 psi_k + s sin 2 psi_k`` is linear in its unknowns, so each of them is one weighted sum over the
photographs, with weights that are the same for every pixel: one pass, no solver per pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import float32, njit
from numpy.typing import ArrayLike, NDArray

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
HarmonicMaps = tuple[Float32Array, Float32Array, Float32Array]

_TILE = 512  # pixels of a row whose accumulators and photographs stay in the first-level cache
_PI = np.float32(np.pi)
_HALF_PI = np.float32(np.pi / 2)

# atan x = x P(x^2) on [-1, 1], the polynomial of degree 7 with the smallest largest error (3.8e-8 rad before rounding).
_A0 = np.float32(0.9999993356531187)
_A1 = np.float32(-0.3332986093810508)
_A2 = np.float32(0.19946565190776447)
_A3 = np.float32(-0.1390862094226841)
_A4 = np.float32(0.09642166274688041)
_A5 = np.float32(-0.055911832296386216)
_A6 = np.float32(0.021862587042057253)
_A7 = np.float32(-0.004054460320537809)


@dataclass(frozen=True)
class HarmonicFit:
    """Weights that turn the K photographs of a pixel into its cosine.

    Attributes
    ----------
    mean, cosine, sine : ndarray of shape (K,), float64
        The rows of the pseudo-inverse of ``[1, cos 2 psi, sin 2 psi]``.
    gram : ndarray of shape (3,), float64
        ``sum (c C_k + s S_k)^2 = gram . (c^2, 2 c s, s^2)`` with ``C``, ``S`` the centred cosines and sines: the part
        of a pixel's sum of squares about its mean that the cosine explains.
    condition : float
        Condition number of ``[1, cos 2 psi, sin 2 psi]``; 1.41 for equal steps over half a turn.
    """

    mean: Float64Array
    cosine: Float64Array
    sine: Float64Array
    gram: Float64Array
    condition: float


def harmonic_fit(polarizer_rad: ArrayLike) -> HarmonicFit:
    """Least-squares weights for photographs at ``polarizer_rad``; the steps need not be equal.

    Raises
    ------
    ValueError
        Fewer than three polariser angles are distinct modulo 180 degrees.
    """
    double = 2 * np.asarray(polarizer_rad, np.float64)
    design = np.stack([np.ones_like(double), np.cos(double), np.sin(double)], axis=1)
    condition = float(np.linalg.cond(design))
    if len(double) < 3 or condition > 1e8:
        raise ValueError("a cosine needs photographs at three or more polariser angles distinct modulo 180 degrees")
    mean, cosine, sine = np.linalg.pinv(design)
    centred_cos, centred_sin = (design[:, 1:] - design[:, 1:].mean(axis=0)).T
    gram = np.array([centred_cos @ centred_cos, centred_cos @ centred_sin, centred_sin @ centred_sin])
    return HarmonicFit(mean, cosine, sine, gram, condition)


@njit(float32(float32, float32), inline="always", error_model="numpy")
def _half_atan2(sine, cosine):  # type: ignore[no-untyped-def]
    """Half of ``atan2(sine, cosine)`` in [0, pi), without a branch; NaN where both are 0."""
    across = abs(sine)
    along = abs(cosine)
    steep = across > along
    ratio = (along if steep else across) / (across if steep else along)
    square = ratio * ratio
    tail = _A4 + square * (_A5 + square * (_A6 + square * _A7))
    angle = ratio * (_A0 + square * (_A1 + square * (_A2 + square * (_A3 + square * tail))))
    angle = _HALF_PI - angle if steep else angle
    angle = _PI - angle if cosine < float32(0) else angle
    half = float32(0.5) * angle
    half = _PI - half if sine < float32(0) else half
    return float32(0) if half >= _PI else half


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def _fit_rows(  # type: ignore[no-untyped-def]  # noqa: PLR0917
    images, reference, weights, gram, level, start, stop, orientation, correlation, mean
):
    count, _, columns = images.shape
    zeroth = np.empty(_TILE, np.float32)
    cosine = np.empty(_TILE, np.float32)
    sine = np.empty(_TILE, np.float32)
    total = np.empty(_TILE, np.float32)
    square = np.empty(_TILE, np.float32)
    pivot = np.empty(_TILE, np.float32)
    share = np.float32(1.0 / count)
    for row in range(start, stop):
        for left in range(0, columns, _TILE):
            width = min(_TILE, columns - left)
            first = images[0, row, left : left + width]
            offset = reference[0]
            for j in range(width):
                pivot[j] = np.float32(first[j]) - offset
                zeroth[j] = cosine[j] = sine[j] = total[j] = square[j] = np.float32(0)
            # Differences to the first photograph: the sums stay accurate where the modulation is weak.
            k = 1
            while k + 1 < count:
                one = images[k, row, left : left + width]
                two = images[k + 1, row, left : left + width]
                ref1, ref2 = reference[k], reference[k + 1]
                m1, m2 = weights[0, k], weights[0, k + 1]
                c1, c2 = weights[1, k], weights[1, k + 1]
                s1, s2 = weights[2, k], weights[2, k + 1]
                for j in range(width):
                    y1 = (np.float32(one[j]) - ref1) - pivot[j]
                    y2 = (np.float32(two[j]) - ref2) - pivot[j]
                    zeroth[j] += m1 * y1 + m2 * y2
                    cosine[j] += c1 * y1 + c2 * y2
                    sine[j] += s1 * y1 + s2 * y2
                    total[j] += y1 + y2
                    square[j] += y1 * y1 + y2 * y2
                k += 2
            if k < count:
                one = images[k, row, left : left + width]
                ref1, m1, c1, s1 = reference[k], weights[0, k], weights[1, k], weights[2, k]
                for j in range(width):
                    y1 = (np.float32(one[j]) - ref1) - pivot[j]
                    zeroth[j] += m1 * y1
                    cosine[j] += c1 * y1
                    sine[j] += s1 * y1
                    total[j] += y1
                    square[j] += y1 * y1
            phase_row = orientation[row, left : left + width]
            correlation_row = correlation[row, left : left + width]
            mean_row = mean[row, left : left + width]
            gcc, gcs, gss = gram[0], gram[1], gram[2]
            for j in range(width):
                c = cosine[j]
                s = sine[j]
                phase_row[j] = _half_atan2(s, c)
                explained = gcc * c * c + gcs * c * s + gss * s * s
                ratio = explained / (square[j] - share * total[j] * total[j])
                ratio = np.float32(1) if ratio > np.float32(1) else ratio
                correlation_row[j] = np.sqrt(ratio)
                mean_row[j] = (pivot[j] + zeroth[j]) + level


def fit_second_harmonic(
    images: NDArray[np.generic],
    polarizer_rad: ArrayLike,
    *,
    reference: ArrayLike | None = None,
    rows: tuple[int, int] | None = None,
    out: HarmonicMaps | None = None,
) -> HarmonicMaps:
    """Phase, correlation and mean of the cosine of period 180 degrees through every pixel.

    Parameters
    ----------
    images : ndarray of shape (K, M, N), any real dtype
        Photographs; arithmetic is float32.
    polarizer_rad : array of shape (K,)
        Polariser angles, at least three of them distinct modulo 180 degrees; equal steps are not needed.
    reference : array of shape (K,), optional
        Subtracted from each photograph before the fit (pre-normalisation).
    rows : tuple of int, optional
        Only these rows (start, stop) are read and written, so that threads can share the work. All by default.
    out : tuple of three ndarray of shape (M, N), float32, optional
        Written and returned.

    Returns
    -------
    orientation_rad : ndarray of shape (M, N), float32
        Polariser angle at which the cosine is largest, in [0, pi); NaN where the photographs are all equal.
        The polynomial arc tangent adds at most 2e-7 rad (half of 2.4e-7 and one rounding near pi).
    correlation : ndarray of shape (M, N), float32
        Normalised correlation of the cosine with the photographs, in [0, 1]: the square root of the share of their
        variance that it explains; NaN where the photographs are all equal.
    mean : ndarray of shape (M, N), float32
        The cosine's mean over a turn, with that of ``reference`` added back: the mean of the photographs where the
        steps are equal over half a turn.
    """
    fit = harmonic_fit(polarizer_rad)
    count, height, width = images.shape
    subtract = np.zeros(count, np.float32) if reference is None else np.asarray(reference, np.float32)
    start, stop = rows or (0, height)
    orientation, correlation, mean = out or tuple(np.empty((height, width), np.float32) for _ in range(3))
    photographs = images.view()
    photographs.flags.writeable = False  # one compiled kernel for arrays and read-only memory maps
    weights = np.stack([fit.mean, fit.cosine, fit.sine]).astype(np.float32)
    gram = (fit.gram * [1, 2, 1]).astype(np.float32)
    level = np.float32(fit.mean @ subtract)
    _fit_rows(photographs, subtract, weights, gram, level, start, stop, orientation, correlation, mean)
    return orientation, correlation, mean
