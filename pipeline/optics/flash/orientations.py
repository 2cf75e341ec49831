"""Which way the tangent points at each pixel of a tile, from how brightly its repeats diffract.

A pixel that is seen at many places of the sheet is lit where the half vector lies along its tangent. All arrays of
observations have shape (O, M, N), float32: O views of a tile of M by N pixels, NaN where there is none.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.compiled import njit

Float32Array = NDArray[np.float32]

TANGENT, ERROR, BRIGHTNESS, AGREEMENT = range(4)
"""Rows of what is found: radians in [0, pi), standard error, brightest view, and how far the views agree, 0 to 1."""

FEW = 8
"""Views of a pixel, below which they do not tell by themselves how bright it is where it is dark."""

_REACH = 2.0
_STEPS = 61
_FAR = 16.0
"""Exponent beyond which a lobe is dark."""
_MODEL_ERROR = 0.05
"""Of a lobe's brightness in a view: what its shape may be wrong by, however well few views are met."""
_GROUND = 0.03
"""Of a pixel's brightest view: what is seen beside lobes."""


@njit(nogil=True, cache=True, error_model="numpy")
def _apart(left: float, right: float) -> float:
    """Signed axial difference in [-pi/2, pi/2)."""
    turn = (left - right + 0.5 * np.pi) % np.pi
    return turn - 0.5 * np.pi


@njit(nogil=True, cache=True, error_model="numpy")
def by_threshold(
    brightness: Any, azimuth: Any, width: Any, peak: float, usual: float, floor: float, ratio: float, found: Any
) -> None:
    """Fill ``found`` (4, M, N) from the views above the first level that any view of the pixel passes.

    Levels go down from ``peak`` by ``ratio`` a step. The tangent is the axial mean of the directions of those views,
    weighted by brightness; where they disagree by more than lobes are wide, that of the brighter ones. A pixel none of
    whose views rises ``floor`` above their median, or ``usual`` where they are fewer than ``FEW``, is not known.

    Parameters
    ----------
    brightness, azimuth, width : ndarray of shape (O, M, N), float32
        Of each view: radiance, direction of the half vector, and standard deviation of the lobe in that direction.
    """
    views, rows, columns = brightness.shape
    values = np.empty(views, np.float32)
    chosen = np.empty(views, np.int64)
    for row in range(rows):
        for column in range(columns):
            found[:, row, column] = np.nan
            count = 0
            most = np.float32(0)
            for i in range(views):
                b = brightness[i, row, column]
                if np.isfinite(b):
                    values[count] = b
                    count += 1
                    most = max(most, b)
            found[BRIGHTNESS, row, column] = most if count else np.nan
            ground = np.median(values[:count]) if count >= FEW else np.float32(usual)
            if not count or most - ground < floor:
                continue
            level = min(peak * ratio ** np.ceil(np.log(most / peak) / np.log(ratio)), most)
            above = 0
            for i in range(views):
                if brightness[i, row, column] >= level:
                    chosen[above] = i
                    above += 1
            best, total, centre = 0.0, 0.0, 0
            for a in range(above):
                i = chosen[a]
                near = 0.0
                for b in range(above):
                    j = chosen[b]
                    turn = _apart(azimuth[j, row, column], azimuth[i, row, column])
                    if abs(turn) < _REACH * width[i, row, column]:
                        near += brightness[j, row, column]
                total += brightness[i, row, column]
                if near > best:
                    best, centre = near, i
            middle = azimuth[centre, row, column]
            turned = weights = squares = 0.0
            for a in range(above):
                i = chosen[a]
                turn = _apart(azimuth[i, row, column], middle)
                if abs(turn) < _REACH * width[centre, row, column]:
                    b = brightness[i, row, column]
                    turned += b * turn
                    weights += b
                    squares += (b * width[i, row, column]) ** 2
            found[TANGENT, row, column] = (middle + turned / weights) % np.pi
            # Few views may all lie on flanks, as far off as they are dimmer than what lobes reach.
            off = np.sqrt(max(1.0, 2 * np.log(peak / most))) if count < FEW else 1.0
            found[ERROR, row, column] = off * np.sqrt(squares) / weights
            found[AGREEMENT, row, column] = best / total


@njit(nogil=True, cache=True, error_model="numpy")
def add_profile(
    brightness: Any, azimuth: Any, width: Any, length: Any, gain: Any, found: Any, step: float, sums: Any
) -> None:
    """Add to ``sums`` (2, K) what gives the least-squares brightness along the tangent in bins of the half vector."""
    views, rows, columns = brightness.shape
    for i in range(views):
        for row in range(rows):
            for column in range(columns):
                b, tangent = brightness[i, row, column], found[TANGENT, row, column]
                if not (np.isfinite(b) and np.isfinite(tangent)):
                    continue
                turn = np.sin(azimuth[i, row, column] - tangent) / width[i, row, column]
                bin_ = int(length[i, row, column] / step)
                if abs(turn) < _REACH and bin_ < sums.shape[1]:
                    lobe = gain[i, row, column] * np.exp(-0.5 * turn * turn)
                    sums[0, bin_] += b * lobe
                    sums[1, bin_] += lobe * lobe


@njit(nogil=True, cache=True, error_model="numpy")
def _along(length: float, profile: Any, step: float) -> float:
    """Brightness along the tangent, between the middles of bins."""
    place = length / step - 0.5
    cell = int(place)
    return profile[cell] + (place - cell) * (profile[cell + 1] - profile[cell])


@njit(nogil=True, cache=True, error_model="numpy")
def _lobe(
    i: int,
    row: int,
    column: int,
    tangent: float,
    azimuth: Any,
    width: Any,
    length: Any,
    gain: Any,
    profile: Any,
    step: float,
) -> tuple[float, float]:
    """Brightness of a lobe in one view, and its change with the tangent."""
    along = _along(length[i, row, column], profile, step)
    turn, wide = azimuth[i, row, column] - tangent, width[i, row, column]
    sine = np.sin(turn) / wide
    lobe = gain[i, row, column] * along * np.exp(-0.5 * sine * sine)
    return lobe, lobe * sine * np.cos(turn) / wide


@njit(nogil=True, cache=True, error_model="numpy")
def _spread(misfits: Any, best: int, free: int) -> float:
    """Standard deviation, in steps around the best, of tangents that explain the views about as well.

    Where views are few, none may lie on one side of the tangent, and a lobe that leaves them goes unnoticed.
    ``misfits`` are sums of squares in standard deviations; where the least exceeds the degrees of freedom, these are
    taken to be as much larger.
    """
    least = misfits.min()
    scale = 2 * max(1.0, least / max(free, 1))
    total = square = 0.0
    for k in range(misfits.size):
        likely = np.exp((least - misfits[k]) / scale)
        total += likely
        square += likely * (k - best) ** 2
    return float(np.sqrt(square / total))


@njit(nogil=True, cache=True, error_model="numpy")
def by_lobe(
    brightness: Any, azimuth: Any, width: Any, length: Any, gain: Any, profile: Any, step: float, found: Any
) -> None:
    """Improve ``found`` by the tangent whose lobe, Gaussian across and ``profile`` along it, fits all views best.

    Views that stay dark count as much as bright ones. The height of the lobe is free; the standard error is that of
    least squares with errors of any size (the sandwich estimator), and ``AGREEMENT`` the normalised correlation.
    """
    views, rows, columns = brightness.shape
    use = np.empty(views, np.int64)
    scores, crosses, norms = np.empty(_STEPS), np.empty(_STEPS), np.empty(_STEPS)
    misfits, sure_crosses, sure_norms = np.empty(_STEPS), np.empty(_STEPS), np.empty(_STEPS)
    for row in range(rows):
        for column in range(columns):
            start = found[TANGENT, row, column]
            if not np.isfinite(start):
                continue
            wide = most = square = 0.0
            count = 0
            for i in range(views):
                b = brightness[i, row, column]
                place = length[i, row, column] / step - 0.5
                if not np.isfinite(b) or place < 0 or place >= profile.size - 1 or profile[int(place)] <= 0:
                    continue
                turn = abs(_apart(azimuth[i, row, column], start))
                if turn < 7 * width[i, row, column]:
                    use[count] = i
                    count += 1
                    square += b * b
                    most = max(most, b)
                    if turn < 2 * width[i, row, column]:
                        wide = max(wide, width[i, row, column])
            if count < 2 or wide == 0.0:
                continue
            spacing = 6 * wide / (_STEPS - 1)
            first = start - _STEPS // 2 * spacing
            turn_cosine, turn_sine = np.cos(spacing), np.sin(spacing)
            crosses[:] = 0
            norms[:] = 0
            sure_crosses[:] = 0
            sure_norms[:] = 0
            sure_square = 0.0
            for n in range(count):
                i = use[n]
                b, wide_here = brightness[i, row, column], width[i, row, column]
                sure = 1 / max((_GROUND * most) ** 2 + (_MODEL_ERROR * b) ** 2, 1e-30)
                sure_square += sure * b * b
                height = gain[i, row, column] * _along(length[i, row, column], profile, step)
                turn = azimuth[i, row, column] - first
                sine, cosine = np.sin(turn) / wide_here, np.cos(turn) / wide_here
                for k in range(_STEPS):
                    away = 0.5 * sine * sine
                    if away < _FAR:
                        lobe = height * np.exp(-away)
                        crosses[k] += b * lobe
                        norms[k] += lobe * lobe
                        sure_crosses[k] += sure * b * lobe
                        sure_norms[k] += sure * lobe * lobe
                    sine, cosine = sine * turn_cosine - cosine * turn_sine, cosine * turn_cosine + sine * turn_sine
            best = 0
            for k in range(_STEPS):
                scores[k] = crosses[k] * crosses[k] / max(norms[k] * square, 1e-30)
                if scores[k] > scores[best]:
                    best = k
                misfits[k] = sure_square - sure_crosses[k] * sure_crosses[k] / max(sure_norms[k], 1e-30)
            found[AGREEMENT, row, column] = np.sqrt(scores[best])
            doubt = _spread(misfits, best, count - 2) * spacing
            if best in (0, _STEPS - 1):
                found[ERROR, row, column] = max(found[ERROR, row, column], doubt)
                continue
            left, middle, right = scores[best - 1], scores[best], scores[best + 1]
            bend = 2 * middle - left - right
            if bend <= 0:
                continue
            tangent = start + (best - _STEPS // 2 + 0.5 * (right - left) / bend) * spacing
            found[TANGENT, row, column] = tangent % np.pi
            # First the height and the slope's part along the lobe, then the sandwich estimator with what is left.
            cross = norm = mixed = 0.0
            for n in range(count):
                i = use[n]
                lobe, slope = _lobe(i, row, column, tangent, azimuth, width, length, gain, profile, step)
                cross += brightness[i, row, column] * lobe
                norm += lobe * lobe
                mixed += lobe * slope
            height = cross / norm
            bread = meat = 0.0
            for n in range(count):
                i = use[n]
                lobe, slope = _lobe(i, row, column, tangent, azimuth, width, length, gain, profile, step)
                slope = height * (slope - lobe * mixed / norm)
                left_over = brightness[i, row, column] - height * lobe
                bread += slope * slope
                meat += slope * slope * (left_over * left_over + (_MODEL_ERROR * height * lobe) ** 2)
            if bread > 0:
                error = min(np.sqrt(meat * count / max(count - 2, 1)) / bread, 2 * wide)
                found[ERROR, row, column] = max(error, doubt)
