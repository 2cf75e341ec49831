"""What small patches around edges say about how photographs moved, whatever the polariser did to their contrast.

In a patch that holds one edge, every photograph is one pattern times a contrast plus a brightness,
``y_k = a_k + b_k E(x - d_k)``, with any sign of the contrast. The pattern is the first principal component over the
photographs; what it leaves unexplained, along the pattern's slopes, says how far each photograph is off.

Photographs are band-passed first, which leaves edges, and hardly anything of fringes that move with the polariser, of
noise, and of what pixels are too coarse for.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.optics.compiled import njit
from pipeline.optics.rigid import centre_of, corner_px
from pipeline.optics.spline import quintic_coefficients, quintic_slope_taps, quintic_taps

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

SIZE = 11
"""Side of a patch in pixels."""

_BAND_PX = (0.8, 1.6)
"""Standard deviations of the two Gaussians whose difference is the band."""

_INDEPENDENT = 30
"""Independent values in a patch of band-passed white noise."""

_NOISE_SLOPE = 1.29
"""Energy of such noise's slopes along one axis over its own, per square pixel: the mean of k_x^2 over the band."""

_CHUNK = 128  # patches handled at once, so that their samples stay in the cache


@dataclass(frozen=True)
class PatchTerms:
    """What each of P patches says about the motions of K photographs.

    The three components of a motion are pixels down, pixels to the right, and pixels by which the turn moves the
    picture's corners.

    Attributes
    ----------
    contrast : ndarray of shape (P, K)
        Of the patch's pattern in each photograph.
    pull : ndarray of shape (P, K, 3)
        Products of what the pattern leaves unexplained with the pattern's slopes along a motion.
    metric : ndarray of shape (P, 3, 3)
        Products of the slopes.
    noise_metric : ndarray of shape (P, 3, 3)
        What noise in the pattern adds to them, on average.
    unexplained : ndarray of shape (P,)
        Energy that no contrast of the pattern explains, over all photographs.
    disturbance : ndarray of shape (P,)
        The same, what is more than noise counted by how much it pulls: corners of several facets, moving fringes.
    second : ndarray of shape (P,)
        Energy of what is neither the pattern nor noise.
    certainty : ndarray of shape (P,)
        From 0, where the pattern may be noise alone, to 1.
    """

    contrast: Float64Array
    pull: Float64Array
    metric: Float64Array
    noise_metric: Float64Array
    unexplained: Float64Array
    disturbance: Float64Array
    second: Float64Array
    certainty: Float64Array


def edge_band(image: Float32Array) -> Float32Array:
    """Difference of two Gaussians of the image."""
    fine, coarse = (cv2.GaussianBlur(image, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE) for sigma in _BAND_PX)
    return np.asarray(fine - coarse)


def edge_coefficients(image: Float32Array) -> Float32Array:
    """Quintic B-spline coefficients of the image's :func:`edge_band`."""
    return quintic_coefficients(edge_band(image))


def edge_patches(coefficients: Float32Array, valid: NDArray[np.bool_], *, margin: int, count: int) -> Float64Array:
    """Centres (row, column) of the patches with the strongest contrast over all photographs, shape (P, 2).

    Parameters
    ----------
    coefficients : ndarray of shape (K, M, N), float32
        From :func:`edge_coefficients`.
    valid : ndarray of shape (M, N), bool
        Patches within ``margin`` of other pixels, or of the border, are not used.
    margin, count : int
        Pixels by which a photograph may move, and the most patches.
    """
    height, width = valid.shape
    rows, columns = (height - 2 * margin) // SIZE, (width - 2 * margin) // SIZE
    if rows < 1 or columns < 1:
        return np.zeros((0, 2))
    inside = (slice(margin, margin + rows * SIZE), slice(margin, margin + columns * SIZE))
    tiles = (rows, SIZE, columns, SIZE)
    reach = 2 * margin + 1
    clear = cv2.erode(valid.astype(np.uint8), np.ones((reach, reach), np.uint8), borderValue=1)
    usable = clear[inside].reshape(tiles).all(axis=(1, 3))
    contrast = np.zeros((rows, columns))
    for image in coefficients:
        contrast += image[inside].reshape(tiles).var(axis=(1, 3), dtype=np.float64)
    contrast[~usable] = -1
    best = np.argsort(contrast, axis=None)[::-1][:count]
    best = best[contrast.ravel()[best] > 0]
    row, column = np.unravel_index(best, contrast.shape)
    corners = margin + SIZE * np.stack([row, column], axis=1)
    return corners.astype(np.float64) + (SIZE - 1) / 2


def patch_terms(
    coefficients: Float32Array, centres: Float64Array, shift_px: Float64Array, turn_rad: Float64Array
) -> PatchTerms:
    """What the patches at ``centres`` of the first photograph say, given motions near the right ones.

    Parameters
    ----------
    coefficients : ndarray of shape (K, M, N), float32
        From :func:`edge_coefficients`.
    centres : ndarray of shape (P, 2), float64
        From :func:`edge_patches`.
    shift_px : ndarray of shape (K, 2), float64
        Shifts at the picture's centre, down and to the right.
    turn_rad : ndarray of shape (K,), float64
        Turns about the picture's centre.
    """
    chunks = [
        _chunk_terms(coefficients, centres[i : i + _CHUNK], shift_px, turn_rad) for i in range(0, len(centres), _CHUNK)
    ]
    return PatchTerms(*(np.concatenate(terms).astype(np.float64) for terms in zip(*chunks, strict=True)))


def _chunk_terms(
    coefficients: Float32Array, centres: Float64Array, shift_px: Float64Array, turn_rad: Float64Array
) -> tuple[NDArray[np.floating], ...]:
    taper = np.sin(np.pi * (np.arange(SIZE) + 0.5) / SIZE)
    window = np.sqrt(np.outer(taper, taper)).ravel()
    share = (window**2 / np.sum(window**2)).astype(np.float32)
    stack = np.empty((len(centres), 3, len(coefficients), SIZE * SIZE), np.float32)
    for k, image in enumerate(coefficients):
        _sample_patches(image, centres, shift_px[k, 0], shift_px[k, 1], turn_rad[k], stack[:, :, k])
    values = stack[:, 0] - (stack[:, 0] @ share)[..., None]
    values *= window.astype(np.float32)
    strength, modes = np.linalg.eigh(values @ values.transpose(0, 2, 1))
    first = modes[:, None, None, :, -1]
    pattern = (first[:, 0] @ values)[:, 0]
    shape = coefficients[0].shape
    from_centre = (centres - centre_of(shape)) / corner_px(shape)
    slopes = _slopes_along_motions((first @ stack[:, 1:])[:, :, 0], from_centre, 1 / corner_px(shape))
    slopes -= (slopes @ share)[..., None]
    slopes *= window.astype(np.float32)
    norm = np.maximum(np.einsum("pi,pi->p", pattern, pattern), 1e-20)
    # Only what a motion does beyond a change of contrast counts.
    slopes -= np.einsum("pdi,pi->pd", slopes, pattern)[..., None] / norm[:, None, None] * pattern[:, None]
    contrast = np.einsum("pki,pi->pk", values, pattern) / norm[:, None]
    residual = values - contrast[..., None] * pattern[:, None]
    along = slopes.transpose(0, 2, 1)
    others = np.maximum(strength[:, :-1], 0)
    # Noise alone has these eigenvalues, its largest far above the mean and their median below it (Marchenko and
    # Pastur, Math. USSR-Sbornik 1, 1967).
    aspect = len(coefficients) / _INDEPENDENT
    noise = np.median(others, axis=1) * (1 + 0.55 * aspect)
    noise_alone = (1 + np.sqrt(aspect)) ** 2 * noise
    second = np.maximum(others - noise_alone[:, None], 0).sum(axis=1)
    # A second pattern pulls with all its energy along one direction; noise spreads its energy over many.
    disturbance = noise * len(others[0]) + _INDEPENDENT * second
    certainty = np.maximum(1 - noise_alone / np.maximum(strength[:, -1], 1e-20), 0) ** 2
    axes = np.tile(np.eye(2, 3), (len(centres), 1, 1))
    axes[:, 0, 2], axes[:, 1, 2] = -from_centre[:, 1], from_centre[:, 0]
    noise_metric = _NOISE_SLOPE * noise[:, None, None] * (axes.transpose(0, 2, 1) @ axes)
    unexplained = others.sum(axis=1)
    return contrast, residual @ along, slopes @ along, noise_metric, unexplained, disturbance, second, certainty


def _slopes_along_motions(slopes: Float32Array, from_centre: Float64Array, pixel: float) -> Float32Array:
    """Slopes down and across, (P, 2, S * S), joined by that along a turn which moves the corners by one pixel."""
    reach = (np.arange(SIZE) - (SIZE - 1) / 2) * pixel
    row = from_centre[:, 0, None, None] + reach[:, None]
    column = from_centre[:, 1, None, None] + reach
    down, across = slopes.reshape(-1, 2, SIZE, SIZE).transpose(1, 0, 2, 3)
    turn = row.astype(np.float32) * across - column.astype(np.float32) * down
    return np.concatenate([slopes, turn.reshape(len(slopes), 1, -1)], axis=1)


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz", "reassoc"})
def _sample_patches(coefficients, centres, down_px, right_px, turn_rad, result):  # type: ignore[no-untyped-def]
    """Value and slopes down and across of every patch of one photograph, into ``result`` of shape (P, 3, S * S).

    A patch is read where its centre has moved to; its own turn, small over so few pixels, is taken along the slopes.
    """
    height, width = coefficients.shape
    middle_row, middle_column = (height - 1) / 2, (width - 1) / 2
    cosine, sine = np.cos(turn_rad), np.sin(turn_rad)
    half = (SIZE - 1) // 2
    value_across = np.empty((SIZE + 5, SIZE), np.float32)
    slope_across = np.empty((SIZE + 5, SIZE), np.float32)
    for p in range(len(centres)):
        y, x = centres[p, 0] - middle_row, centres[p, 1] - middle_column
        row = middle_row + y * cosine - x * sine + down_px - half
        column = middle_column + y * sine + x * cosine + right_px - half
        top, left = int(np.floor(row)), int(np.floor(column))
        a, slope_a = quintic_taps(row - top), quintic_slope_taps(row - top)
        b, slope_b = quintic_taps(column - left), quintic_slope_taps(column - left)
        for i in range(SIZE + 5):
            line = coefficients[min(max(top + i - 2, 0), height - 1)]
            for j in range(SIZE):
                value = slope = np.float32(0)
                for t in range(6):
                    sample = line[min(max(left + j + t - 2, 0), width - 1)]
                    value += b[t] * sample
                    slope += slope_b[t] * sample
                value_across[i, j] = value
                slope_across[i, j] = slope
        for i in range(SIZE):
            for j in range(SIZE):
                value = down = across = np.float32(0)
                for t in range(6):
                    value += a[t] * value_across[i + t, j]
                    down += slope_a[t] * value_across[i + t, j]
                    across += a[t] * slope_across[i + t, j]
                off_row, off_column = i - half, j - half
                value += down * np.float32(off_row * (cosine - 1) - off_column * sine)
                value += across * np.float32(off_row * sine + off_column * (cosine - 1))
                result[p, 0, i * SIZE + j] = value
                result[p, 1, i * SIZE + j] = down
                result[p, 2, i * SIZE + j] = across
