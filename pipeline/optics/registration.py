"""Shifts between photographs whose contrasts change while their edges stay.

Turning a polariser brightens one facet and darkens its neighbour, so the photographs of a sequence differ by more than
noise and a shift, and may be each other's negatives. In a patch that holds one edge, though, every photograph is one
pattern times a contrast plus a brightness, ``y_k = a_k + b_k E(x - d_k)``, with any sign of the contrast. The pattern
of each patch is the first principal component over the photographs; the shift of each photograph is what all patches
agree on. A patch that does not follow this model (corners of three facets, moving fringes) betrays itself by its
residual and loses weight.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft

from pipeline.optics.translation import quintic_slopes, quintic_weights

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

_SIZE = 11
_CHUNK = 128  # patches handled at once, so that their samples stay in the cache
_ENOUGH_PATCHES = 12
_STILL_PX = 5e-4
# Each photograph is part of the pattern it is compared with, so plain steps fall short by up to a third.
_OVER_RELAXATION = 1.25


@dataclass(frozen=True)
class Shifts:
    """Where each photograph's content lies, relative to the first.

    Attributes
    ----------
    shift_px : ndarray of shape (K, 2), float64
        Rows downwards and columns to the right; the first is (0, 0).
    deviation_px : ndarray of shape (K,), float64
        Standard deviation of the larger error axis of each, from the scatter between patches; infinite where the
        photographs do not tell.
    """

    shift_px: Float64Array
    deviation_px: Float64Array


def edge_image(image: Float32Array) -> Float32Array:
    """Soft edge magnitude in [0, 1): gradient relative to the brightness around it, whatever its sign."""
    smooth = cv2.GaussianBlur(image, (0, 0), 1.0)
    across = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=3)
    down = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, ksize=3)
    magnitude = cv2.magnitude(across, down)
    level = np.float32(2 * np.mean(magnitude) + np.finfo(np.float32).tiny)
    return np.asarray(magnitude / (magnitude + level), np.float32)


def coarse_shift(reference: Float32Array, moved: Float32Array, largest_px: float) -> Float64Array:
    """Shift of ``moved`` against ``reference``, both edge images, in whole rows and columns, by phase correlation.

    Zero where moving by it does not make the edges agree better. Shifts beyond ``largest_px`` are not looked for.

    References
    ----------
    Kuglin and Hines, The phase correlation image alignment method, Proc. IEEE Cybernetics and Society (1975).
    """
    height, width = reference.shape
    taper = np.outer(np.hanning(height), np.hanning(width)).astype(np.float32)
    spectrum = np.conj(fft.rfft2((reference - reference.mean()) * taper)) * fft.rfft2((moved - moved.mean()) * taper)
    magnitude = np.abs(spectrum)
    # Frequencies that carry next to nothing would vote with the phase of their noise.
    peak = fft.irfft2(spectrum / (magnitude + 0.1 * magnitude.mean()), s=reference.shape)
    rows, columns = fft.fftfreq(height, 1 / height), fft.fftfreq(width, 1 / width)
    far = (np.abs(rows)[:, None] > min(largest_px, 0.4 * height)) | (np.abs(columns) > min(largest_px, 0.4 * width))
    peak[far] = -np.inf
    row, column = np.unravel_index(np.argmax(peak), peak.shape)
    whole = np.rint([rows[row], columns[column]]).astype(int)
    if not whole.any():
        return np.zeros(2)
    here, there = _overlap(height, width, whole)
    still = np.corrcoef(reference[here].ravel(), moved[here].ravel())[0, 1]
    follows = np.corrcoef(reference[here].ravel(), moved[there].ravel())[0, 1]
    return whole.astype(np.float64) if follows > still else np.zeros(2)


def edge_shifts(
    coefficients: Float32Array,
    start_px: Float64Array,
    valid: NDArray[np.bool_],
    *,
    patches: int = 1500,
    iterations: int = 12,
) -> Shifts:
    """Refine shifts by the model of one pattern per patch and one contrast per patch and photograph.

    Parameters
    ----------
    coefficients : ndarray of shape (K, M, N), float32
        Quintic B-spline coefficients of the photographs.
    start_px : ndarray of shape (K, 2), float64
        Shifts to start from, right to about one pixel.
    valid : ndarray of shape (M, N), bool
        Patches that touch other pixels are not used.
    patches : int
        The patches of the strongest contrast are used, at most this many.
    iterations : int
        Gauss-Newton steps at most; the loop ends when no shift changes by half a thousandth of a pixel.
    """
    shift = start_px - start_px[0]
    corners = _corners(coefficients, valid, int(np.ceil(np.max(np.abs(shift)))) + 4, patches)
    count = len(coefficients)
    if len(corners) < _ENOUGH_PATCHES:
        return Shifts(np.zeros((count, 2)), np.full(count, np.inf))
    deviation = np.full(count, np.inf)
    for _ in range(iterations):
        step, deviation = _step(coefficients, corners, shift)
        step -= step[0]
        length = np.hypot(*step.T)
        shift = shift + _OVER_RELAXATION * step * np.minimum(1, 1 / np.maximum(length, 1e-12))[:, None]
        if length.max() < _STILL_PX:
            break
    # A shift is that between two photographs, the first of which is no better known than the other.
    return Shifts(shift, np.hypot(deviation, deviation[0]))


def _overlap(height: int, width: int, whole: NDArray[np.int_]) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    spans = [(max(0, -int(d)), n - max(0, int(d))) for d, n in zip(whole, (height, width), strict=True)]
    here = tuple(slice(a, b) for a, b in spans)
    there = tuple(slice(a + int(d), b + int(d)) for (a, b), d in zip(spans, whole, strict=True))
    return (here[0], here[1]), (there[0], there[1])


def _corners(coefficients: Float32Array, valid: NDArray[np.bool_], margin: int, patches: int) -> NDArray[np.int_]:
    """Upper left corners of the patches with the strongest contrast over all photographs, shape (P, 2)."""
    height, width = valid.shape
    rows, columns = (height - 2 * margin) // _SIZE, (width - 2 * margin) // _SIZE
    if rows < 1 or columns < 1:
        return np.zeros((0, 2), int)
    inside = (slice(margin, margin + rows * _SIZE), slice(margin, margin + columns * _SIZE))
    tiles = (rows, _SIZE, columns, _SIZE)
    reach = 2 * margin + 1
    clear = cv2.erode(valid.astype(np.uint8), np.ones((reach, reach), np.uint8), borderValue=1)
    usable = clear[inside].reshape(tiles).all(axis=(1, 3))
    contrast = np.zeros((rows, columns))
    for image in coefficients:
        tile = image[inside].reshape(tiles)
        contrast += tile.var(axis=(1, 3), dtype=np.float64) / np.maximum(tile.mean(axis=(1, 3), dtype=np.float64), 1e-6)
    contrast[~usable] = -1
    best = np.argsort(contrast, axis=None)[::-1][:patches]
    best = best[contrast.ravel()[best] > 0]
    row, column = np.unravel_index(best, contrast.shape)
    return np.stack([margin + row * _SIZE, margin + column * _SIZE], axis=1)


def _sampled(coefficients: Float32Array, corners: NDArray[np.int_], shift: Float64Array) -> Float64Array:
    """Value and slopes down and across of every patch of one photograph, moved by its shift: shape (3, P, S, S)."""
    whole = np.floor(shift).astype(int)
    reach = np.arange(-2, _SIZE + 3)
    rows = corners[:, 0, None] + whole[0] + reach
    columns = corners[:, 1, None] + whole[1] + reach
    support = coefficients[rows[:, :, None], columns[:, None, :]]
    down, across = (_banded(quintic_weights(f)) for f in shift - whole)
    slope_down, slope_across = (_banded(quintic_slopes(f)) for f in shift - whole)
    by_column = support @ across.T
    return np.stack([down @ by_column, slope_down @ by_column, down @ (support @ slope_across.T)])


def _banded(taps: Float64Array) -> Float32Array:
    matrix = np.zeros((_SIZE, _SIZE + 5), np.float32)
    for i in range(_SIZE):
        matrix[i, i : i + 6] = taps
    return matrix


def _step(
    coefficients: Float32Array, corners: NDArray[np.int_], shift: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """One Gauss-Newton step (K, 2) for all photographs and the deviation (K,) of each."""
    chunks = [_patch_terms(coefficients, corners[i : i + _CHUNK], shift) for i in range(0, len(corners), _CHUNK)]
    contrast, residual_pull, metric, unexplained = (np.concatenate(terms) for terms in zip(*chunks, strict=True))
    weight = 1 / (unexplained + 1e-3 * np.median(unexplained) + 1e-20)
    pull = -residual_pull * (contrast * weight[:, None])[..., None]
    normal = np.einsum("p,pk,pde->kde", weight, contrast**2, metric)
    scatter = np.einsum("pkd,pke->kde", pull, pull)
    count = len(coefficients)
    step, deviation = np.zeros((count, 2)), np.full(count, np.inf)
    for k in range(count):
        if np.linalg.cond(normal[k]) < 1e8:
            inverse = np.linalg.inv(normal[k])
            step[k] = inverse @ pull[:, k].sum(axis=0)
            deviation[k] = np.sqrt(np.linalg.eigvalsh(inverse @ scatter[k] @ inverse).max())
    return step, deviation


def _patch_terms(
    coefficients: Float32Array, corners: NDArray[np.int_], shift: Float64Array
) -> tuple[Float64Array, Float64Array, Float64Array, Float64Array]:
    """What each patch says about the shifts, for Q patches and K photographs.

    Returns
    -------
    contrast : ndarray of shape (Q, K)
        Of the patch's pattern in each photograph.
    residual_pull : ndarray of shape (Q, K, 2)
        Products of what the pattern leaves unexplained with the slopes of the pattern, down and across.
    metric : ndarray of shape (Q, 2, 2)
        Products of the slopes.
    unexplained : ndarray of shape (Q,)
        Energy that no contrast of the pattern explains, over all photographs.
    """
    taper = np.sin(np.pi * (np.arange(_SIZE) + 0.5) / _SIZE)
    window = np.sqrt(np.outer(taper, taper)).ravel()
    share = (window**2 / np.sum(window**2)).astype(np.float32)
    stack = np.empty((3, len(corners), len(coefficients), _SIZE * _SIZE), np.float32)
    for k, image in enumerate(coefficients):
        stack[:, :, k] = _sampled(image, corners, shift[k]).reshape(3, len(corners), -1)
    stack -= (stack @ share)[..., None]
    stack *= window.astype(np.float32)
    values, slopes = stack[0], stack[1:]
    strength, modes = np.linalg.eigh(values @ values.transpose(0, 2, 1))
    first = modes[:, None, :, -1]
    pattern = (first @ values)[:, 0]
    norm = np.maximum(np.einsum("pi,pi->p", pattern, pattern), 1e-20)
    slope = (first @ slopes)[:, :, 0]
    # Only what a shift does beyond a change of contrast counts.
    slope -= np.einsum("dpi,pi->dp", slope, pattern)[..., None] / norm[:, None] * pattern
    contrast = np.einsum("pki,pi->pk", values, pattern) / norm[:, None]
    residual = values - contrast[..., None] * pattern[:, None]
    pull = residual @ slope.transpose(1, 2, 0)
    metric = np.einsum("dpi,epi->pde", slope, slope)
    unexplained = strength[:, :-1].sum(axis=1)
    return contrast.astype(float), pull.astype(float), metric.astype(float), unexplained.astype(float)
