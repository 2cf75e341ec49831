"""Least-squares cosine of period 180 degrees through photographs taken at several polariser angles.

``y_k = mean + c cos 2 psi_k + s sin 2 psi_k`` is linear in its unknowns, so each of them is one weighted sum over the
photographs, with weights that are the same for every pixel: one pass, no solver per pixel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import float32
from numpy.typing import ArrayLike, NDArray

from pipeline.optics.compiled import njit

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
HarmonicMaps = tuple[Float32Array, Float32Array, Float32Array]

TILE = 1024
"""Pixels of a row whose accumulators and photographs stay in the first-level cache."""
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
        The rows of the (weighted) pseudo-inverse of ``[1, cos 2 psi, sin 2 psi]``.
    photo_weights : ndarray of shape (K,), float64
        Weight of each photograph's square, 1 on average.
    centres : ndarray of shape (2,), float64
        Weighted means of ``cos 2 psi_k`` and ``sin 2 psi_k``; zero for equal weights and steps over half a turn.
    gram : ndarray of shape (3,), float64
        ``sum (c C_k + s S_k)^2 = gram . (c^2, 2 c s, s^2)`` with ``C``, ``S`` the centred cosines and sines: the part
        of a pixel's sum of squares about its mean that the cosine explains.
    condition : float
        Condition number of ``[1, cos 2 psi, sin 2 psi]``; 1.41 for equal steps over half a turn.
    """

    mean: Float64Array
    cosine: Float64Array
    sine: Float64Array
    photo_weights: Float64Array
    centres: Float64Array
    gram: Float64Array
    condition: float


def harmonic_fit(polarizer_rad: ArrayLike, photo_weights: ArrayLike | None = None) -> HarmonicFit:
    """Least-squares weights for photographs at ``polarizer_rad``; the steps need not be equal.

    Parameters
    ----------
    polarizer_rad : array of shape (K,)
        Polariser angles.
    photo_weights : array of shape (K,), optional
        Relative weights of the photographs' squares, such as one over their noise; equal if not given.

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
    weights = np.ones(len(double)) if photo_weights is None else np.asarray(photo_weights, np.float64)
    weights = weights / weights.mean()
    root = np.sqrt(weights)
    mean, cosine, sine = np.linalg.pinv(design * root[:, None]) * root
    centres = np.average(design[:, 1:], axis=0, weights=weights)
    centred = design[:, 1:] - centres
    products = (centred * weights[:, None]).T @ centred
    gram = np.array([products[0, 0], products[0, 1], products[1, 1]])
    return HarmonicFit(mean, cosine, sine, weights, centres, gram, condition)


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
def accumulate(images, reference, weights, row, left, width, sums):  # type: ignore[no-untyped-def]
    """Weighted sums over the photographs of ``width`` pixels of a row, from ``left`` on.

    ``weights`` (4, K) are those of mean, cosine, sine and squares, ``sums`` (5, tile) is written with the sums of all
    four and the pixel of the first photograph. Differences to that are summed, so that the sums stay accurate where the
    modulation is weak.
    """
    count = len(images)
    zeroth, cosine, sine, square, pivot = sums[0], sums[1], sums[2], sums[3], sums[4]
    here = slice(left, left + width)
    first = images[0, row, here]
    for j in range(width):
        pivot[j] = np.float32(first[j]) - reference[0]
        zeroth[j] = cosine[j] = sine[j] = square[j] = np.float32(0)
    k = 1
    while k + 4 <= count:
        one, two, three, four = (
            images[k, row, here],
            images[k + 1, row, here],
            images[k + 2, row, here],
            images[k + 3, row, here],
        )
        r1, r2, r3, r4 = reference[k], reference[k + 1], reference[k + 2], reference[k + 3]
        m1, m2, m3, m4 = weights[0, k], weights[0, k + 1], weights[0, k + 2], weights[0, k + 3]
        c1, c2, c3, c4 = weights[1, k], weights[1, k + 1], weights[1, k + 2], weights[1, k + 3]
        s1, s2, s3, s4 = weights[2, k], weights[2, k + 1], weights[2, k + 2], weights[2, k + 3]
        q1, q2, q3, q4 = weights[3, k], weights[3, k + 1], weights[3, k + 2], weights[3, k + 3]
        for j in range(width):
            y1 = (np.float32(one[j]) - r1) - pivot[j]
            y2 = (np.float32(two[j]) - r2) - pivot[j]
            y3 = (np.float32(three[j]) - r3) - pivot[j]
            y4 = (np.float32(four[j]) - r4) - pivot[j]
            zeroth[j] = m4 * y4 + (m3 * y3 + (m2 * y2 + (m1 * y1 + zeroth[j])))
            cosine[j] = c4 * y4 + (c3 * y3 + (c2 * y2 + (c1 * y1 + cosine[j])))
            sine[j] = s4 * y4 + (s3 * y3 + (s2 * y2 + (s1 * y1 + sine[j])))
            square[j] = q4 * y4 * y4 + (q3 * y3 * y3 + (q2 * y2 * y2 + (q1 * y1 * y1 + square[j])))
        k += 4
    while k < count:
        one = images[k, row, here]
        r1, m1, c1, s1, q1 = reference[k], weights[0, k], weights[1, k], weights[2, k], weights[3, k]
        for j in range(width):
            y1 = (np.float32(one[j]) - r1) - pivot[j]
            zeroth[j] = m1 * y1 + zeroth[j]
            cosine[j] = c1 * y1 + cosine[j]
            sine[j] = s1 * y1 + sine[j]
            square[j] = q1 * y1 * y1 + square[j]
        k += 1


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def _fit_rows(  # type: ignore[no-untyped-def]
    images, reference, weights, centres, gram, level, start, stop, orientation, correlation, mean
):
    count, _, columns = images.shape
    sums = np.empty((5, TILE), np.float32)
    zeroth, cosine, sine, square, pivot = sums[0], sums[1], sums[2], sums[3], sums[4]
    for row in range(start, stop):
        for left in range(0, columns, TILE):
            width = min(TILE, columns - left)
            here = slice(left, left + width)
            accumulate(images, reference, weights, row, left, width, sums)
            orientation_row = orientation[row, here]
            correlation_row = correlation[row, here]
            mean_row = mean[row, here]
            number, centre_c, centre_s = np.float32(count), centres[0], centres[1]
            gcc, gcs, gss = gram[0], gram[1], gram[2]
            for j in range(width):
                c = cosine[j]
                s = sine[j]
                orientation_row[j] = _half_atan2(s, c)
                # The fit's mean over the photographs is theirs, so no sum of theirs is needed.
                average = zeroth[j] + (c * centre_c + s * centre_s)
                explained = gcc * c * c + gcs * c * s + gss * s * s
                share = explained / (square[j] - number * average * average)
                share = np.float32(1) if share > np.float32(1) else share
                correlation_row[j] = np.sqrt(share)
                mean_row[j] = (pivot[j] + zeroth[j]) + level


def fit_rows(
    images: NDArray[np.generic], fit: HarmonicFit, reference: ArrayLike | None, out: HarmonicMaps
) -> Callable[[int, int], None]:
    """Prepare :func:`fit_second_harmonic` for threads: the call that reads and writes rows ``start`` to ``stop``."""
    subtract = np.zeros(len(images), np.float32) if reference is None else np.asarray(reference, np.float32)
    photographs = read_only(images)
    weights = np.stack([fit.mean, fit.cosine, fit.sine, fit.photo_weights]).astype(np.float32)
    centres = fit.centres.astype(np.float32)
    gram = (fit.gram * [1, 2, 1]).astype(np.float32)
    level = np.float32(fit.mean @ subtract)

    def rows(start: int, stop: int) -> None:
        _fit_rows(photographs, subtract, weights, centres, gram, level, start, stop, *out)

    return rows


@njit(nogil=True, cache=True, error_model="numpy")
def _mask_rows(orientation, correlation, mean, valid, least, start, stop, mask):  # type: ignore[no-untyped-def]
    nothing = np.float32(np.nan)
    for row in range(start, stop):
        angle, share, level, usable, kept = orientation[row], correlation[row], mean[row], valid[row], mask[row]
        for j in range(len(angle)):
            keep = usable[j] & np.isfinite(angle[j]) & (level[j] >= least)
            kept[j] = keep
            angle[j] = angle[j] if keep else nothing
            share[j] = share[j] if keep else nothing


@njit(nogil=True, cache=True, error_model="numpy")
def _sum_rows(images, mask, start, stop, sums):  # type: ignore[no-untyped-def]
    count, _, columns = images.shape
    column_sum = np.empty(columns, np.float64)
    for k in range(count):
        column_sum[:] = 0.0
        for row in range(start, stop):
            here, kept = images[k, row], mask[row]
            for j in range(columns):
                y = here[j]  # read whether it counts or not, so that the loop has no branch
                column_sum[j] += np.float64(y if kept[j] else np.float32(0))
        total = 0.0
        for j in range(columns):
            total += column_sum[j]
        sums[k] = total


def mask_rows(
    maps: HarmonicMaps, valid: NDArray[np.bool_], least: float, mask: NDArray[np.bool_]
) -> Callable[[int, int], None]:
    """Prepare threads to keep the pixels that are valid, modulated and bright enough, and to write NaN elsewhere.

    Parameters
    ----------
    maps : tuple of ndarray of shape (M, N), float32
        Orientation, correlation and mean of a fit; the first two are written where a pixel is left out.
    valid : ndarray of shape (M, N), bool
        Pixels to choose from.
    least : float
        Least mean of a pixel that is kept.
    mask : ndarray of shape (M, N), bool
        Written with the pixels that are kept; another array than ``valid``.
    """
    choice, cut = read_only(valid), np.float32(least)
    return lambda start, stop: _mask_rows(*maps, choice, cut, start, stop, mask)


def sum_rows(
    images: NDArray[np.generic], mask: NDArray[np.bool_], sums: NDArray[np.float64], tile: int
) -> Callable[[int, int], None]:
    """Prepare threads to sum the masked-in pixels of each photograph over rows, in float64 and always in one order.

    Parameters
    ----------
    images : ndarray of shape (K, M, N)
        Photographs.
    mask : ndarray of shape (M, N), bool
        Pixels that count.
    sums : ndarray of shape (tiles, K), float64
        Written, a row for every ``tile`` rows of the photographs.
    tile : int
        Rows that a thread is given at a time.
    """
    photographs, kept = read_only(images), read_only(mask)
    return lambda start, stop: _sum_rows(photographs, kept, start, stop, sums[start // tile])


def read_only(values: NDArray[Any]) -> NDArray[Any]:
    """A view for kernels, which then are compiled once for arrays and read-only memory maps."""
    view = np.asarray(values).view()
    view.flags.writeable = False
    return view


def fit_second_harmonic(
    images: NDArray[np.generic], polarizer_rad: ArrayLike, *, reference: ArrayLike | None = None
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

    Returns
    -------
    orientation_rad : ndarray of shape (M, N), float32
        Polariser angle at which the cosine is largest, in [0, pi); NaN where the photographs are all equal.
        The arc tangent, a polynomial, is good to 5e-7 rad.
    correlation : ndarray of shape (M, N), float32
        Normalised correlation of the cosine with the photographs, in [0, 1]: the square root of the share of their
        variance that it explains; NaN where the photographs are all equal.
    mean : ndarray of shape (M, N), float32
        The cosine's mean over a turn, with that of ``reference`` added back: the mean of the photographs where the
        steps are equal over half a turn.
    """
    out = empty_maps(images.shape[1], images.shape[2])
    fit_rows(images, harmonic_fit(polarizer_rad), reference, out)(0, images.shape[1])
    return out


def empty_maps(height: int, width: int) -> HarmonicMaps:
    """Room for the three maps of a fit."""
    shape = (height, width)
    return np.empty(shape, np.float32), np.empty(shape, np.float32), np.empty(shape, np.float32)
