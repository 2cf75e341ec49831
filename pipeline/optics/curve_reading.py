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
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtri

from pipeline.optics.compiled import njit
from pipeline.optics.harmonic import HarmonicFit, accumulate, read_only
from pipeline.optics.response_curve import ResponseCurve, StokesNoise

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
ReadingMaps = tuple[Float32Array, Float32Array, Float32Array, Float32Array]

CELLS = 256
_TILE = 512
_MARGIN = 0.25
_BRANCHES_APART = np.pi / 12
_ELSEWHERE = 1e30
_FAR = np.float32(40)
_COARSE = 8
_KEPT, _RIVAL, _TURN = 12, 10, 11
"""Numbers of a cell: the plane that the orientation is within it, as its value where ``s1 = s2 = 0`` and its two
derivatives; the plane of the distance from the curve, in units of the noise of a pixel of one electron; the variance of
the orientation from such noise, and that from the unknowns of the curve; what a squared distance of one adds to the
residual; the reciprocal of the relative brightness; and of the nearest other branch by how much its squared distance is
larger, and the squared turn to it."""
_UNUSUAL = 1e-3
"""Pixels that fit worse than this share would by chance are no better than they fit."""


@dataclass(frozen=True)
class Reading:
    """What is looked up.

    Attributes
    ----------
    origin : ndarray of shape (2,), cell : float
        Lower corner of the grid in the plane of ``(s1, s2)``, and width of its square cells.
    cells : ndarray of shape (CELLS, CELLS, 12), float32
        By s2, then s1: what ``_KEPT`` names, of the curve's nearest place.
    residual : float
        Expected weighted sum of squares left over by the three sums, of a pixel of one electron; mean over the curve.
    rivalled : bool
        Whether there is a cell whose second branch is near enough to matter for a bright pixel.
    """

    origin: Float64Array
    cell: float
    cells: Float32Array
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
    towards = normal / width[:, None]
    zero = -(towards * curve.stokes).sum(axis=1)
    samples = np.column_stack([zero, towards, variance, own, share, 1 / relative])
    low, high = curve.stokes.min(axis=0), curve.stokes.max(axis=0)
    reach = float((high - low).max()) * (0.5 + _MARGIN) + spread
    origin, cell = (low + high) / 2 - reach, 2 * reach / CELLS
    bend = np.gradient(np.concatenate([curve.slope[-2:], curve.slope, curve.slope[:2]]), np.pi / len(normal), axis=0)
    cells = np.empty((CELLS, CELLS, _KEPT), np.float32)
    _fill(origin, cell, curve.orientation_rad, curve.stokes, inverse, curve.slope, bend[2:-2], gradient, samples, cells)
    rivalled = bool((cells[..., _RIVAL] < 1e-3).any())
    residual = float(noise.residual(curve.stokes).mean())
    return Reading(origin, cell, cells, residual, rivalled)


@njit(cache=True, error_model="numpy")
def _distance(s1: float, s2: float, points: Any, inverse: Any, t: int) -> Any:
    x, y = s1 - points[t, 0], s2 - points[t, 1]
    return inverse[t, 0, 0] * x * x + 2 * inverse[t, 0, 1] * x * y + inverse[t, 1, 1] * y * y


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc"})
def _fill(
    origin: Any,
    cell: float,
    orientation: Any,
    points: Any,
    inverse: Any,
    slope: Any,
    bend: Any,
    gradient: Any,
    samples: Any,
    cells: Any,
) -> None:
    """Nearest sample and nearest sample of another branch, for the middle of every cell.

    Every ``_COARSE``-th sample shows the valleys of the distance, and only there the others are looked at.
    """
    count = len(orientation)
    apart = int(_BRANCHES_APART / np.pi * count)
    middle1, middle2 = points[::_COARSE, 0].copy(), points[::_COARSE, 1].copy()
    i00, i11 = inverse[::_COARSE, 0, 0].copy(), inverse[::_COARSE, 1, 1].copy()
    i01 = 2 * inverse[::_COARSE, 0, 1]
    steps = len(middle1)
    square = np.empty(steps + 2)  # the last before the first, the first after the last
    valleys = np.empty(steps, np.int64)
    for row in range(len(cells)):
        s2 = origin[1] + (row + 0.5) * cell
        for column in range(len(cells)):
            s1 = origin[0] + (column + 0.5) * cell
            for k in range(steps):
                x, y = s1 - middle1[k], s2 - middle2[k]
                square[k + 1] = i00[k] * x * x + i01[k] * x * y + i11[k] * y * y
            square[0], square[steps + 1] = square[steps], square[1]
            found = 0
            for k in range(steps):
                if square[k + 1] <= square[k] and square[k + 1] <= square[k + 2]:
                    valleys[found] = k * _COARSE
                    found += 1
            best, other = -1, -1
            nearest, second = np.inf, np.inf
            for v in range(found):
                for t in range(valleys[v] - _COARSE + 1, valleys[v] + _COARSE):
                    away = _distance(s1, s2, points, inverse, t % count)
                    if away < nearest:
                        best, nearest = t % count, away
            for v in range(found):
                for t in range(valleys[v] - _COARSE + 1, valleys[v] + _COARSE):
                    between = abs(t % count - best)
                    if min(between, count - between) >= apart:
                        away = _distance(s1, s2, points, inverse, t % count)
                        if away < second:
                            other, second = t % count, away
            x, y = s1 - points[best, 0], s2 - points[best, 1]
            # Inside of a bend the orientation changes faster than on the curve, outside more slowly.
            a, b, c = inverse[best, 0, 0], inverse[best, 0, 1], inverse[best, 1, 1]
            dx, dy = slope[best, 0], slope[best, 1]
            length = a * dx * dx + 2 * b * dx * dy + c * dy * dy
            bent = a * x * bend[best, 0] + b * (x * bend[best, 1] + y * bend[best, 0]) + c * y * bend[best, 1]
            faster = 1 / min(max(1 - bent / max(length, 1e-30), 0.3), 3.0)
            g1, g2 = gradient[best, 0] * faster, gradient[best, 1] * faster
            along = g1 * x + g2 * y  # the sample is the nearest of those there are, the curve goes on between them
            limit = np.pi / count
            along = min(max(along, -limit), limit)
            theta = orientation[best] + along
            cells[row, column, 0] = theta - g1 * s1 - g2 * s2
            cells[row, column, 1] = g1
            cells[row, column, 2] = g2
            cells[row, column, 3:_RIVAL] = samples[best]
            cells[row, column, _RIVAL] = _ELSEWHERE
            cells[row, column, _TURN] = 0.0
            if other >= 0:
                turn = abs(orientation[other] - orientation[best])
                turn = min(turn, np.pi - turn)
                cells[row, column, _RIVAL] = second - nearest
                cells[row, column, _TURN] = turn * turn


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
            lookup.cells.reshape(-1, _KEPT),
            lookup.rivalled,
            start,
            stop,
            *out,
            mask,
        )

    return rows


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def _read_rows(  # type: ignore[no-untyped-def]
    images, valid, weights, figures, cells, rivalled, start, stop, orientation, correlation, brightness, error, mask
):
    count, _, columns = images.shape
    none = np.zeros(count, np.float32)
    sums = np.empty((5, _TILE), np.float32)
    first, second, places = np.empty(_TILE, np.float32), np.empty(_TILE, np.float32), np.empty(_TILE, np.int32)
    found = np.empty((_KEPT, _TILE), np.float32)
    for row in range(start, stop):
        for left in range(0, columns, _TILE):
            width = min(_TILE, columns - left)
            here = slice(left, left + width)
            accumulate(images, none, weights, row, left, width, sums)
            _place(sums, figures, width, first, second, places)
            for j in range(width):
                cell = cells[places[j]]
                for i in range(_KEPT):
                    found[i, j] = cell[i]
            out = (orientation[row, here], correlation[row, here], brightness[row, here], error[row, here])
            _describe(sums, first, second, found, figures, count, valid[row, here], *out, mask[row, here])
            if rivalled:
                _doubt(found, out[2], figures[8], out[3])


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def _place(sums, figures, width, first, second, places):  # type: ignore[no-untyped-def]
    """Relative Stokes parameters of some pixels, and the cell that each lies in."""
    zeroth, cosine, sine, pivot = sums[0], sums[1], sums[2], sums[4]
    low1, low2, per_cell, last = figures[5], figures[6], figures[7], np.float32(CELLS - 1)
    for j in range(width):
        level = pivot[j] + zeroth[j]
        per_level = np.float32(1) / level
        s1, s2 = cosine[j] * per_level, sine[j] * per_level
        first[j], second[j] = s1, s2
        u, v = (s1 - low1) * per_cell, (s2 - low2) * per_cell
        u = last if u > last else u
        v = last if v > last else v
        u = u if u > np.float32(0) else np.float32(0)  # what is no number too
        v = v if v > np.float32(0) else np.float32(0)
        places[j] = np.int32(v) * np.int32(CELLS) + np.int32(u)


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def _describe(  # type: ignore[no-untyped-def]
    sums, first, second, found, figures, count, valid, orientation, correlation, brightness, error, mask
):
    zeroth, cosine, sine, square, pivot = sums[0], sums[1], sums[2], sums[3], sums[4]
    centre_c, centre_s, gcc, gcs, gss = figures[0], figures[1], figures[2], figures[3], figures[4]
    gain, least, per_freedom, unusual = figures[8], figures[9], figures[10], figures[11]
    number, per_number = np.float32(count), np.float32(1) / np.float32(count - 2)
    nothing, pi, per_pi = np.float32(np.nan), np.float32(np.pi), np.float32(1 / np.pi)
    zero, one = np.float32(0), np.float32(1)
    for j in range(len(valid)):
        level, c, s = pivot[j] + zeroth[j], cosine[j], sine[j]
        keep = valid[j] & (level >= least) & (level > zero)
        mask[j] = keep
        theta = found[0, j] + found[1, j] * first[j] + found[2, j] * second[j]
        theta -= pi * np.floor(theta * per_pi)
        theta = theta if (theta >= zero) & (theta < pi) else zero
        away = found[3, j] + found[4, j] * first[j] + found[5, j] * second[j]
        average = zeroth[j] + (c * centre_c + s * centre_s)
        total = square[j] - number * average * average
        unexplained = total - (gcc * c * c + gcs * c * s + gss * s * s)
        unexplained = unexplained if unexplained > zero else zero
        squared = away * away
        share = one - (unexplained + level * level * found[8, j] * squared) / total
        signal = one / (gain * level)
        excess = (unexplained * signal * per_freedom + squared * level / gain) * per_number
        excess = excess if excess > unusual else one
        variance = gain / level * found[6, j] * excess + found[7, j]
        orientation[j] = theta if keep else nothing
        correlation[j] = np.sqrt(share if share > zero else zero) if keep else nothing
        brightness[j] = level * found[9, j] if keep else level
        error[j] = np.sqrt(variance) if keep else nothing


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz"})
def _doubt(found, brightness, gain, error):  # type: ignore[no-untyped-def]
    """Add the turn to another branch of the curve, as likely as it is that the pixel lies on that one."""
    half, one, part = np.float32(0.5), np.float32(1), np.float32(1 / 256)
    for j in range(len(error)):
        x = half * found[_RIVAL, j] * brightness[j] / (found[9, j] * gain)
        x = part * (x if x < _FAR else _FAR)
        e = one + x + half * x * x  # e^x = (e^(x / 256))^256, in a form that runs side by side
        e *= e
        e *= e
        e *= e
        e *= e
        e *= e
        e *= e
        e *= e
        e *= e
        error[j] = np.sqrt(error[j] * error[j] + found[_TURN, j] / (one + e))
