"""Edge-keeping smoothing of axial angles, as unit vectors ``(cos 2 theta, sin 2 theta)``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.compiled import njit

Float32Array = NDArray[np.float32]

_TILE = 256  # pixels of a row whose accumulators stay in the first-level cache


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def pivot_rows(vector, weight, reach, steepness, start, stop, pivot):  # type: ignore[no-untyped-def]
    """For each pixel, the sample of its window that has the most like-minded weight around it.

    Parameters
    ----------
    vector : ndarray of shape (2, M + 2 P, N + 2 P), float32
        Cosine and sine of twice the angle, padded; P >= ``reach``.
    weight : ndarray of the same shape without the first axis, float32
        0 where a pixel is to be left out.
    reach : int
        Half width of the window.
    steepness : float
        Two samples ``delta`` apart support each other by ``max(0, 1 - steepness sin^2 delta)^2``.
    pivot : ndarray of shape (2, M, N), float32
        Written; 0 where the whole window is left out.
    """
    rows, columns = pivot.shape[1:]
    pad = (vector.shape[1] - rows) // 2
    side = 2 * reach + 1
    best = np.empty(_TILE, np.float32)
    support = np.empty(_TILE, np.float32)
    half = np.float32(0.5) * np.float32(steepness)
    one, zero = np.float32(1), np.float32(0)
    for row in range(start, stop):
        for left in range(0, columns, _TILE):
            width = min(_TILE, columns - left)
            out_c = pivot[0, row, left : left + width]
            out_s = pivot[1, row, left : left + width]
            for j in range(width):
                best[j] = out_c[j] = out_s[j] = zero
            for candidate in range(side * side):
                y = row + pad + candidate // side - reach
                x = left + pad + candidate % side - reach
                c = vector[0, y, x : x + width]
                s = vector[1, y, x : x + width]
                w = weight[y, x : x + width]
                for j in range(width):
                    support[j] = zero
                for other in range(side * side):
                    v = row + pad + other // side - reach
                    u = left + pad + other % side - reach
                    c2 = vector[0, v, u : u + width]
                    s2 = vector[1, v, u : u + width]
                    w2 = weight[v, u : u + width]
                    for j in range(width):
                        # 1 - cos 2 delta = 2 sin^2 delta
                        kept = one - half * (one - (c[j] * c2[j] + s[j] * s2[j]))
                        kept = kept if kept > zero else zero
                        support[j] += w2[j] * kept * kept
                for j in range(width):
                    better = support[j] > best[j] and w[j] > zero
                    best[j] = support[j] if better else best[j]
                    out_c[j] = c[j] if better else out_c[j]
                    out_s[j] = s[j] if better else out_s[j]


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def average_rows(vector, weight, pivot, spatial, steepness, start, stop, smooth):  # type: ignore[no-untyped-def]
    """Weighted mean of the samples around each pixel that are close to its pivot, as a unit vector.

    Parameters
    ----------
    vector, weight, pivot
        As in :func:`pivot_rows`.
    spatial : ndarray of shape (S, S), float32
        Weight by place, S odd, at most 2 P + 1.
    steepness : float
        A sample ``delta`` from the pivot counts ``max(0, 1 - steepness sin^2 delta)^2``.
    smooth : ndarray of shape (2, M, N), float32
        Written.
    """
    rows, columns = smooth.shape[1:]
    pad = (vector.shape[1] - rows) // 2
    side = spatial.shape[0]
    reach = side // 2
    sum_c = np.empty(_TILE, np.float32)
    sum_s = np.empty(_TILE, np.float32)
    half = np.float32(0.5) * np.float32(steepness)
    one, zero = np.float32(1), np.float32(0)
    for row in range(start, stop):
        for left in range(0, columns, _TILE):
            width = min(_TILE, columns - left)
            pc = pivot[0, row, left : left + width]
            ps = pivot[1, row, left : left + width]
            for j in range(width):
                sum_c[j] = sum_s[j] = zero
            for dy in range(side):
                y = row + pad + dy - reach
                for dx in range(side):
                    x = left + pad + dx - reach
                    place = spatial[dy, dx]
                    c = vector[0, y, x : x + width]
                    s = vector[1, y, x : x + width]
                    w = weight[y, x : x + width]
                    for j in range(width):
                        kept = one - half * (one - (pc[j] * c[j] + ps[j] * s[j]))
                        kept = kept if kept > zero else zero
                        share = place * w[j] * kept * kept
                        sum_c[j] += share * c[j]
                        sum_s[j] += share * s[j]
            out_c = smooth[0, row, left : left + width]
            out_s = smooth[1, row, left : left + width]
            for j in range(width):
                length = np.sqrt(sum_c[j] * sum_c[j] + sum_s[j] * sum_s[j])
                found = length > zero
                out_c[j] = sum_c[j] / length if found else pc[j]
                out_s[j] = sum_s[j] / length if found else ps[j]
