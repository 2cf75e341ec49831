"""Orientations read off a response curve: one pass over the photographs, one look-up a pixel.

The nearest place on the curve, in units of the noise, is found beforehand for every cell of a grid over the plane of
``(s1, s2)``, with the change of the orientation across the cell. So a pixel costs its three sums and a look-up,
whatever the shape of the curve.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtri

from pipeline.optics.harmonic import TILE, HarmonicFit, accumulate, read_only
from pipeline.optics.response_curve import ResponseCurve, StokesNoise

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
ReadingMaps = tuple[Float32Array, Float32Array, Float32Array, Float32Array]

CELLS = 256
_MARGIN = 0.25
_BRANCHES_APART = np.pi / 12
_ELSEWHERE = 1e30
_UNUSUAL = 1e-3
"""Pixels that fit worse than this share would by chance are no better than they fit."""


@dataclass(frozen=True)
class Reading:
    """What is looked up.

    Attributes
    ----------
    origin : ndarray of shape (2,), cell : float
        Lower corner of the grid in the plane of ``(s1, s2)``, and width of its square cells.
    cells : ndarray of shape (CELLS, CELLS, 4), float32
        By s2, then s1: the plane that the orientation is within the cell, as its value where ``s1 = s2 = 0`` and its
        derivatives, and the number of the nearest sample of the curve.
    rivals : ndarray of shape (CELLS, CELLS, 2), float32
        Of the nearest other branch of the curve: by how much its squared distance is larger, in units of noise for a
        pixel of one electron, and the squared turn to it.
    samples : ndarray of shape (T, 8), float32
        Of the curve: point, direction of the distance in units of noise, variance of the orientation from noise and
        from the unknowns of the curve, what a squared distance of one adds to the residual, and relative brightness.
    residual : float
        Expected weighted sum of squares left over by the three sums, of a pixel of one electron; mean over the curve.
    rivalled : bool
        Whether there is a cell whose second branch is near enough to matter for a bright pixel.
    """

    origin: Float64Array
    cell: float
    cells: Float32Array
    rivals: Float32Array
    samples: Float32Array
    residual: float
    rivalled: bool


def orientation_gradient(curve: ResponseCurve, noise: StokesNoise) -> Float64Array:
    """Change of the most likely orientation with that of a point on the curve, in radians; shape (T, 2)."""
    towards = np.linalg.solve(noise.covariance(curve.stokes), curve.slope[:, :, None])[:, :, 0]
    return np.asarray(towards / (towards * curve.slope).sum(axis=1, keepdims=True))


def reading(
    curve: ResponseCurve, noise: StokesNoise, fit: HarmonicFit, curve_variance: ArrayLike = 0.0, spread: float = 0.0
) -> Reading:
    """Prepare the look-up.

    Parameters
    ----------
    curve : ResponseCurve
        With T samples.
    noise : StokesNoise
        Of the photographs' weights.
    fit : HarmonicFit
        The same weights.
    curve_variance : array_like, broadcast to (T,)
        Variance of the orientation that the curve's own uncertainty brings, in square radians.
    spread : float
        How far points may lie from the curve; the grid reaches as far.
    """
    covariance = noise.covariance(curve.stokes)
    inverse = np.linalg.inv(covariance)
    gradient = orientation_gradient(curve, noise)
    normal = np.stack([-curve.slope[:, 1], curve.slope[:, 0]], axis=1)
    across = (covariance @ normal[:, :, None])[:, :, 0]
    width = np.sqrt(np.maximum((normal * across).sum(axis=1), 1e-30))
    variance = (gradient[:, None, :] @ covariance @ gradient[:, :, None])[:, 0, 0]
    unit = across / width[:, None]
    share = fit.gram[0] * unit[:, 0] ** 2 + 2 * fit.gram[1] * unit[:, 0] * unit[:, 1] + fit.gram[2] * unit[:, 1] ** 2
    own = np.broadcast_to(curve_variance, variance.shape)
    relative = curve.brightness / curve.brightness.mean()
    samples = np.column_stack([curve.stokes, normal / width[:, None], variance, own, share, relative])
    low, high = curve.stokes.min(axis=0), curve.stokes.max(axis=0)
    reach = float((high - low).max()) * (0.5 + _MARGIN) + spread
    origin, cell = (low + high) / 2 - reach, 2 * reach / CELLS
    bend = np.gradient(np.concatenate([curve.slope[-2:], curve.slope, curve.slope[:2]]), np.pi / len(normal), axis=0)
    cells = np.empty((CELLS, CELLS, 4), np.float32)
    rivals = np.empty((CELLS, CELLS, 2), np.float32)
    _fill(origin, cell, curve.orientation_rad, curve.stokes, inverse, curve.slope, bend[2:-2], gradient, cells, rivals)
    rivalled = bool((rivals[..., 0] < 1e-3).any())
    residual = float(noise.residual(curve.stokes).mean())
    return Reading(origin, cell, cells, rivals, samples.astype(np.float32), residual, rivalled)


@njit(cache=True, error_model="numpy")
def _fill(
    origin: Any,
    cell: float,
    orientation: Any,
    points: Any,
    inverse: Any,
    slope: Any,
    bend: Any,
    gradient: Any,
    cells: Any,
    rivals: Any,
) -> None:
    """Nearest sample and nearest sample of another branch, for the middle of every cell."""
    count = len(orientation)
    apart = int(_BRANCHES_APART / np.pi * count)
    square = np.empty(count)
    for row in range(len(cells)):
        s2 = origin[1] + (row + 0.5) * cell
        for column in range(len(cells)):
            s1 = origin[0] + (column + 0.5) * cell
            best = 0
            for t in range(count):
                x, y = s1 - points[t, 0], s2 - points[t, 1]
                square[t] = inverse[t, 0, 0] * x * x + 2 * inverse[t, 0, 1] * x * y + inverse[t, 1, 1] * y * y
                best = t if square[t] < square[best] else best
            other = -1
            for t in range(count):
                between = abs(t - best)
                far = min(between, count - between) >= apart
                if far and square[t] <= square[t - 1] and square[t] <= square[(t + 1) % count]:
                    other = t if other < 0 or square[t] < square[other] else other
            x, y = s1 - points[best, 0], s2 - points[best, 1]
            # Inside of a bend the orientation changes faster than on the curve, outside more slowly.
            i00, i01, i11 = inverse[best, 0, 0], inverse[best, 0, 1], inverse[best, 1, 1]
            dx, dy = slope[best, 0], slope[best, 1]
            length = i00 * dx * dx + 2 * i01 * dx * dy + i11 * dy * dy
            bent = i00 * x * bend[best, 0] + i01 * (x * bend[best, 1] + y * bend[best, 0]) + i11 * y * bend[best, 1]
            faster = 1 / min(max(1 - bent / max(length, 1e-30), 0.3), 3.0)
            g1, g2 = gradient[best, 0] * faster, gradient[best, 1] * faster
            along = g1 * x + g2 * y  # the sample is the nearest of those there are, the curve goes on between them
            limit = np.pi / count
            along = min(max(along, -limit), limit)
            theta = orientation[best] + along
            cells[row, column, 0] = theta - g1 * s1 - g2 * s2
            cells[row, column, 1] = g1
            cells[row, column, 2] = g2
            cells[row, column, 3] = best
            rivals[row, column, 0] = _ELSEWHERE
            rivals[row, column, 1] = 0.0
            if other >= 0:
                turn = abs(orientation[other] - orientation[best])
                turn = min(turn, np.pi - turn)
                rivals[row, column, 0] = square[other] - square[best]
                rivals[row, column, 1] = turn * turn


def read_rows(
    images: NDArray[np.generic],
    valid: NDArray[np.bool_],
    fit: HarmonicFit,
    lookup: Reading,
    *,
    gain: float,
    least: float,
    out: ReadingMaps,
    mask: NDArray[np.bool_],
) -> Callable[[int, int], None]:
    """Prepare threads: the call that reads and writes rows ``start`` to ``stop``.

    Parameters
    ----------
    images : ndarray of shape (K, M, N)
        Photographs.
    valid : ndarray of shape (M, N), bool
        Pixels to choose from.
    fit : HarmonicFit
        Weights of the photographs.
    lookup : Reading
        The curve.
    gain : float
        Noise variance of a pixel over its brightness, full scale 1.
    least : float
        Least brightness of a pixel that is kept.
    out : tuple of ndarray of shape (M, N), float32
        Written with orientation, correlation, brightness as all orientations would have it, and standard error of the
        orientation; NaN outside the mask, but for the brightness.
    mask : ndarray of shape (M, N), bool
        Written with the pixels that are kept.
    """
    weights = np.stack([fit.mean, fit.cosine, fit.sine, fit.photo_weights]).astype(np.float32)
    photographs, choice = read_only(images), read_only(valid)
    freedom = len(fit.mean) - 2
    figures = np.array(
        [
            *fit.centres,
            *(fit.gram * [1, 2, 1]),
            *lookup.origin,
            1 / lookup.cell,
            gain,
            least,
            lookup.residual / (len(fit.mean) - 3) if len(fit.mean) > 3 else 1.0,
            chdtri(freedom, _UNUSUAL) / freedom,
        ],
        np.float32,
    )

    def rows(start: int, stop: int) -> None:
        _read_rows(
            photographs,
            choice,
            weights,
            figures,
            lookup.cells,
            lookup.rivals,
            lookup.samples,
            lookup.rivalled,
            start,
            stop,
            *out,
            mask,
        )

    return rows


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def _read_rows(  # type: ignore[no-untyped-def]
    images,
    valid,
    weights,
    figures,
    cells,
    rivals,
    samples,
    rivalled,
    start,
    stop,
    orientation,
    correlation,
    brightness,
    error,
    mask,
):
    count, _, columns = images.shape
    none = np.zeros(count, np.float32)
    sums = np.empty((5, TILE), np.float32)
    zeroth, cosine, sine, square, pivot = sums[0], sums[1], sums[2], sums[3], sums[4]
    centre_c, centre_s, gcc, gcs, gss = figures[0], figures[1], figures[2], figures[3], figures[4]
    low1, low2, per_cell = figures[5], figures[6], figures[7]
    gain, least, per_freedom, unusual = figures[8], figures[9], figures[10], figures[11]
    number, freedom = np.float32(count), np.float32(count - 2)
    last, nothing, pi = len(cells) - 1, np.float32(np.nan), np.float32(np.pi)
    one, half = np.float32(1), np.float32(0.5)
    for row in range(start, stop):
        for left in range(0, columns, TILE):
            width = min(TILE, columns - left)
            accumulate(images, none, weights, row, left, width, sums)
            for j in range(width):
                column = left + j
                level = pivot[j] + zeroth[j]
                brightness[row, column] = level
                keep = valid[row, column] and level >= least and level > 0
                mask[row, column] = keep
                if not keep:
                    orientation[row, column] = correlation[row, column] = error[row, column] = nothing
                    continue
                c, s = cosine[j], sine[j]
                s1, s2 = c / level, s / level
                u = min(max(int((s1 - low1) * per_cell), 0), last)
                v = min(max(int((s2 - low2) * per_cell), 0), last)
                theta = cells[v, u, 0] + cells[v, u, 1] * s1 + cells[v, u, 2] * s2
                theta -= pi * np.floor(theta / pi)
                orientation[row, column] = np.float32(0) if theta >= pi else theta
                place = samples[int(cells[v, u, 3])]
                brightness[row, column] = level / place[7]
                away = place[2] * (s1 - place[0]) + place[3] * (s2 - place[1])
                noise = gain / level
                average = zeroth[j] + (c * centre_c + s * centre_s)
                total = square[j] - number * average * average
                explained = gcc * c * c + gcs * c * s + gss * s * s
                unexplained = max(total - explained, np.float32(0))
                added = level * level * place[6] * away * away
                correlation[row, column] = np.sqrt(max(one - (unexplained + added) / total, np.float32(0)))
                excess = (unexplained / (gain * level * per_freedom) + away * away / noise) / freedom
                variance = noise * place[4] * (excess if excess > unusual else one) + place[5]
                if rivalled and rivals[v, u, 0] < 20 * noise:
                    odds = np.exp(-half * rivals[v, u, 0] / noise)
                    variance += odds / (one + odds) * rivals[v, u, 1]
                error[row, column] = np.sqrt(variance)
