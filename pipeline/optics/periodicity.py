"""Periods and directions of a surface, from the peaks of its own spectrum.

Frequencies are in cycles per sample, x to the right and y up; the spectrum is that of the map under a Hann window (of a
tile that repeats: without one, for then it consists of lines). A peak is told from the rest of the spectrum along two
ways at once, around the origin and away from it: rough surfaces have rings, scan lines have streaks, and neither is a
period in a direction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.optics.levelling import taper

Float64Array = NDArray[np.float64]

CONTRAST = 10.0
"""Least ratio of a peak of the smoothed spectrum to what lies around it, which noise and streaks do not reach."""
LEAST_SHARE = 0.01
"""Least part of the variance that a period has to have."""
FEWEST_CYCLES = 3.0
"""Cycles that a map has to hold before they count as a period."""
_RING = np.log(1.15)
"""Width of the rings in which the level around a peak is taken, as logarithm of a ratio of frequencies."""
_MOST_CANDIDATES = 24
_STEPS, _CONVERGED = 8, 1e-9
_SMOOTHING, _WIDEST = 1.5, 4.0
"""Standard deviation, in bins, of the smoothing in which lines are looked for, and most of that for wider peaks."""
_SIDE = 333
"""Samples a side for each bin of the smoothing of wider peaks."""
_REACH = 4
"""Half width, in bins, of what a line takes up in a Hann window's spectrum, smoothed."""
_HIGHEST_MULTIPLE, _HIGHEST_SUM = 12, 4
_COINCIDE = 0.03
"""Part of its frequency, or three bins if that is more, by which a peak may miss a sum of others that explains it."""
_FLANK = 0.2
"""Part of its height over what lies around that still belongs to a wide peak."""
_WIDE = 3.0
"""Widths of a peak found within which others are parts of it."""
_LINE_CONTRAST = 1.0
"""Least contrast of what is looked at as a line, which its shape then decides."""
_LINE_LEFT = 0.1
"""Part of a line's power that may be left where it was, after it is taken away; a wave fitted to noise leaves more."""
_OF_TILE = 0.05
"""Part of the variance from which on a single wave of a tile that repeats is a period, whatever lies around it."""
_HANN_CELLS = (1 + 2 * (2 / 3) ** 2 + 2 * (1 / 6) ** 2) ** 2
"""How many neighbouring bins of a Hann window's spectrum count as one: powers of bins apart correlate so."""


@dataclass(frozen=True)
class Spectrum:
    """Power of a map over frequency.

    Attributes
    ----------
    power : ndarray of shape (M, N)
        Share of the variance in um^2, row 0 at the highest y frequency, column 0 at the lowest x; sums to the variance.
    x, y : ndarray of shape (N,), (M,)
        Cycles per sample.
    windowed : ndarray of shape (M, N)
        The map less its mean under the window.
    window : tuple of ndarray
        Of rows and of columns.
    """

    power: Float64Array
    x: Float64Array
    y: Float64Array
    windowed: Float64Array
    window: tuple[Float64Array, Float64Array]

    @property
    def bins(self) -> tuple[float, float]:
        """Width of a bin along x and y."""
        return 1 / len(self.x), 1 / len(self.y)


@dataclass(frozen=True)
class Peak:
    """A period and its direction.

    Attributes
    ----------
    x, y : float
        Frequency in cycles per sample, in the half plane of y > 0 or y = 0, x > 0.
    covariance : ndarray of shape (2, 2)
        Of x and y.
    variance : float
        Of the heights, in um^2, that belongs to it.
    contrast : float
        Over the median around it.
    width : float
        Root mean square distance of its parts from it; 0 of a line, which is as sharp as the window lets it be, so that
        the whole map swings in step.
    """

    x: float
    y: float
    covariance: Float64Array
    variance: float
    contrast: float
    width: float = 0.0

    @property
    def frequency(self) -> float:
        """Cycles per sample along the direction."""
        return float(np.hypot(self.x, self.y))

    @property
    def direction_rad(self) -> float:
        """In [0, pi), anticlockwise from +x with y up."""
        return float(np.arctan2(self.y, self.x) % np.pi)

    @property
    def frequency_error(self) -> float:
        """Standard error along the direction."""
        along = np.array([self.x, self.y]) / self.frequency
        return float(np.sqrt(along @ self.covariance @ along))

    @property
    def direction_error_rad(self) -> float:
        """Standard error of the direction."""
        across = np.array([-self.y, self.x]) / self.frequency
        return float(np.sqrt(across @ self.covariance @ across)) / self.frequency


def spectrum_of(height: NDArray[np.floating], *, periodic: bool) -> Spectrum:
    """The spectrum of a map that is known everywhere."""
    rows, columns = height.shape
    window = (np.ones(rows), np.ones(columns)) if periodic else (taper(rows), taper(columns))
    weight = window[0][:, None] * window[1]
    level = np.asarray(height, np.float64) - np.average(height, weights=weight)
    windowed = level * weight
    power = np.abs(np.fft.fft2(windowed)) ** 2 / (np.sum(weight**2) * height.size)
    power = np.fft.fftshift(power)
    x, y = np.fft.fftshift(np.fft.fftfreq(columns)), -np.fft.fftshift(np.fft.fftfreq(rows))
    return Spectrum(power, x, y, windowed, window)


def peaks(spectrum: Spectrum, *, count: int, contrast: float = CONTRAST) -> list[Peak]:
    """At most ``count`` peaks, that of most variance first, none of them a sum of multiples of those before it."""
    smooth = ndimage.gaussian_filter(spectrum.power, _SMOOTHING, mode="wrap")
    rest = spectrum.power.copy()
    lines = _of_tile(spectrum, rest, _OF_TILE * rest.sum()) if spectrum.window[0].min() == 1 else []
    least = LEAST_SHARE * float(spectrum.power.sum())
    for row, column, level in _candidates(spectrum, smooth, _LINE_CONTRAST):
        with np.errstate(divide="ignore"):  # a tile that repeats may have nothing beside its lines
            contrast_here = smooth[row, column] / level
        line = _as_line(spectrum, row, column, contrast_here, rest, least)
        lines += [line] if line else []
    _forget_multiples(spectrum, rest, lines)
    wide = float(np.clip(min(smooth.shape) / _SIDE, _SMOOTHING, _WIDEST))
    bands: list[Peak | None] = []
    for sigma in sorted({_SMOOTHING, wide}):
        smooth = ndimage.gaussian_filter(rest, sigma, mode="wrap")
        bands += [_as_band(spectrum, rest, smooth, *place) for place in _candidates(spectrum, smooth, contrast)]
    measured = [peak for peak in (*lines, *bands) if peak is not None and peak.variance > least]
    found: list[Peak] = []
    for peak in sorted(measured, key=lambda one: -one.variance):
        if len(found) == count:
            break
        if not _explained(peak, found, spectrum.bins):
            found.append(peak)
    return found


def _candidates(spectrum: Spectrum, smooth: Float64Array, contrast: float) -> list[tuple[int, int, float]]:
    """Row and column of every local maximum that stands out both ways, and the level around it."""
    x, y = spectrum.x[None, :], spectrum.y[:, None]
    half = _upper_half(spectrum)
    cycles = np.hypot(x / spectrum.bins[0], y / spectrum.bins[1])
    level = _around_origin(smooth, np.hypot(x, y))
    top = smooth == ndimage.maximum_filter(smooth, 2 * _REACH - 1, mode="wrap")
    chosen = np.argwhere(top & half & (cycles >= FEWEST_CYCLES) & (smooth > contrast * level))
    found = []
    for row, column in sorted(chosen.tolist(), key=lambda place: -smooth[tuple(place)])[:_MOST_CANDIDATES]:
        around = max(float(level[row, column]), _along_ray(spectrum, smooth, row, column))
        if smooth[row, column] > contrast * around:
            found.append((row, column, around))
    return found


def _upper_half(spectrum: Spectrum) -> NDArray[np.bool_]:
    """One of each two bins of opposite frequency."""
    x, y = spectrum.x[None, :], spectrum.y[:, None]
    return (y > 0) | ((y == 0) & (x > 0))


def _of_tile(spectrum: Spectrum, rest: Float64Array, least: float) -> list[Peak]:
    """Waves of whole cycles of a tile that have a good part of its variance; ``rest`` then is without them."""
    found = []
    for row, column in np.argwhere(_upper_half(spectrum) & (2 * spectrum.power > least)).tolist():
        x, y, variance = float(spectrum.x[column]), float(spectrum.y[row]), 2 * float(spectrum.power[row, column])
        found.append(Peak(x, y, np.zeros((2, 2)), variance, np.inf))
        rest[row, column] = 0.0
    return found


def _forget_multiples(spectrum: Spectrum, rest: Float64Array, lines: list[Peak]) -> None:
    """Give ``rest`` the level around it wherever multiples of the two strongest lines, and their sums, lie."""
    basis: list[Peak] = []
    for line in sorted(lines, key=lambda one: -one.variance):
        if len(basis) < 2 and not _explained(line, basis, spectrum.bins):
            basis.append(line)
    if not basis:
        return
    level = _around_origin(rest, np.hypot(spectrum.x[None, :], spectrum.y[:, None]))
    places = np.zeros((1, 2))
    for line in basis:
        most = int(1 / line.frequency)
        places = (places[:, None] + np.arange(-most, most + 1)[:, None] * [line.y, line.x]).reshape(-1, 2)
    places = places[(np.abs(places) < 0.5).all(axis=1) & places.any(axis=1)]
    rows, columns = rest.shape
    row = np.rint(rows // 2 - places[:, 0] * rows).astype(int)
    column = np.rint(columns // 2 + places[:, 1] * columns).astype(int)
    around = np.arange(-_REACH, _REACH + 1)
    down, across = (row[:, None, None] + around[:, None]) % rows, (column[:, None, None] + around) % columns
    rest[down, across] = level[down, across]


def _around_origin(smooth: Float64Array, frequency: Float64Array) -> Float64Array:
    """Median of the smoothed spectrum in the ring of its own frequency, for every bin."""
    rings = np.floor(np.log(np.maximum(frequency, frequency[frequency > 0].min())) / _RING).astype(np.int16).ravel()
    order = np.argsort(rings, kind="stable")
    rings = rings[order]
    starts = np.flatnonzero(np.diff(rings, prepend=rings[0] - 1))
    medians = [np.median(part) for part in np.split(smooth.ravel()[order], starts[1:])]
    level = np.empty(smooth.size)
    level[order] = np.repeat(medians, np.diff(starts, append=len(rings)))
    return level.reshape(smooth.shape)


def _along_ray(spectrum: Spectrum, smooth: Float64Array, row: int, column: int) -> float:
    """Lower quartile of the smoothed spectrum on the ray through a bin, from half its frequency to twice it or more."""
    centre = np.array([np.argmin(np.abs(spectrum.y)), np.argmin(np.abs(spectrum.x))])
    step = np.array([row, column]) - centre
    length = float(np.hypot(*step))
    share = np.arange(0.5 * length, max(2 * length, length + 4 * _REACH) + 0.5) / length
    away = np.abs(share - 1) * length > _REACH
    places = centre[:, None] + step[:, None] * share[away]
    shape = np.array(smooth.shape)[:, None]
    places = places[:, ((places >= 0) & (places <= shape - 1)).all(axis=0)]
    if not places.shape[1]:
        return 0.0
    return float(np.percentile(ndimage.map_coordinates(smooth, places, order=1), 25))


def _explained(peak: Peak, found: list[Peak], bins: tuple[float, float]) -> bool:
    """Whether a peak lies where multiples of those found, and their sums, do."""
    here, found_at = complex(peak.x, peak.y), [complex(one.x, one.y) for one in found]
    sums = np.zeros(1, complex)
    for one in found_at:
        sums = (sums[:, None] + np.arange(-_HIGHEST_SUM, _HIGHEST_SUM + 1) * one).ravel()
    multiples = np.outer(found_at, np.arange(-_HIGHEST_MULTIPLE, _HIGHEST_MULTIPLE + 1)).ravel()
    near = max(3 * max(bins), _COINCIDE * peak.frequency)
    parts = (
        abs(here - sign * at) < _WIDE * one.width for one, at in zip(found, found_at, strict=True) for sign in (1, -1)
    )
    return bool(found) and (bool((np.abs(np.r_[sums, multiples] - here) < near).any()) or any(parts))


def _as_band(
    spectrum: Spectrum, rest: Float64Array, smoothed: Float64Array, row: int, column: int, level: float
) -> Peak | None:
    """The centroid of a peak of some width, over what stands higher than half of it; None for part of a higher one.

    Powers of a spectrum scatter as much as they are large, so with f from the centroid its covariance is ``sum P^2 f
    f^T / (2 (sum P)^2)``, times the number of bins that swing together.
    """
    reach = max(_REACH, int(0.5 * np.hypot(spectrum.x[column] / spectrum.bins[0], spectrum.y[row] / spectrum.bins[1])))
    rows, columns = slice(max(row - reach, 0), row + reach + 1), slice(max(column - reach, 0), column + reach + 1)
    smooth, power = smoothed[rows, columns], rest[rows, columns]
    top = smooth[row - rows.start, column - columns.start]
    labels, _ = ndimage.label(smooth > level + _FLANK * (top - level))
    region = labels == labels[row - rows.start, column - columns.start]
    if smooth[region].max() > top:
        return None
    places = np.argwhere(region)
    frequency = np.stack([spectrum.x[columns][places[:, 1]], spectrum.y[rows][places[:, 0]]])
    above = np.maximum(power[region] - level, 0)
    centre = frequency @ above / above.sum()
    off = frequency - centre[:, None]
    cells = 1.0 if spectrum.window[0].min() == 1 else _HANN_CELLS
    covariance = cells * (power[region] ** 2 * off) @ off.T / 2 / above.sum() ** 2
    width = float(np.sqrt(np.sum(above * off**2) / above.sum()))
    return Peak(*_upper(*centre), covariance, 2 * float(above.sum()), top / max(level, 1e-300), width)


def _as_line(
    spectrum: Spectrum, row: int, column: int, contrast: float, rest: Float64Array, least: float
) -> Peak | None:
    """The frequency of most power under the window, if a wave of it leaves little; ``rest`` then is without that wave.

    For a swing of amplitude A in noise of variance ``s^2`` a sample, seen under the weights w, the frequency has the
    variance ``2 s^2 sum w^2 n^2 / (2 pi A sum w n^2)^2`` (Rife and Boorstyn 1974 for even weights).
    """
    rows, columns = spectrum.power.shape
    near = spectrum.power[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3]
    first, second = np.unravel_index(int(near.argmax()), near.shape)
    row, column = max(row - 2, 0) + int(first), max(column - 2, 0) + int(second)
    fx, fy = float(spectrum.x[column]), float(spectrum.y[row])
    bins = np.arange(-_REACH, _REACH + 1)
    down, across = (row + bins) % rows, (column + bins) % columns
    if 2 * spectrum.power[np.ix_(down, across)].sum() < least:
        return None
    periodic = spectrum.window[0].min() == 1
    if not periodic:
        fx, fy = _refined(spectrum, fx, fy)
    near_x, near_y = spectrum.x[column] + bins * spectrum.bins[0], spectrum.y[row] - bins * spectrum.bins[1]
    seen = _transform(spectrum.windowed, near_y, near_x)
    of_window = np.outer(_of_window(spectrum.window[0], near_y - fy), _of_window(spectrum.window[1], near_x - fx))
    swing = _transform(spectrum.windowed, np.array([fy]), np.array([fx]))[0, 0] / np.outer(*spectrum.window).sum()
    scale = np.sum(np.outer(*spectrum.window) ** 2) * rows * columns
    left = np.abs(seen - swing * of_window) ** 2 / scale
    explained = np.abs(swing * of_window) ** 2 / scale
    if left.sum() > _LINE_LEFT * explained.sum():
        return None
    rest[np.ix_(down, across)] = left
    rest[np.ix_((2 * (rows // 2) - down) % rows, (2 * (columns // 2) - across) % columns)] = left
    noise = float(left.mean()) * rows * columns
    variances = [
        0.0 if periodic else 2 * noise * _of_frequency(one) * float(np.sum(other**2) / np.sum(other) ** 2)
        for one, other in (spectrum.window[::-1], spectrum.window)
    ]
    amplitude = 2 * float(np.abs(swing))
    covariance = np.diag(variances) / (2 * np.pi * amplitude) ** 2
    return Peak(*_upper(fx, fy), covariance, amplitude**2 / 2, contrast)


def _of_frequency(window: Float64Array) -> float:
    place = np.arange(len(window)) - (len(window) - 1) / 2
    return float(np.sum((window * place) ** 2) / np.sum(window * place**2) ** 2)


def _refined(spectrum: Spectrum, fx: float, fy: float) -> tuple[float, float]:
    """The nearest frequency at which the windowed map's transform is largest, by Newton's steps."""
    rows, columns = spectrum.power.shape
    row, column = -(np.arange(rows) - (rows - 1) / 2), np.arange(columns) - (columns - 1) / 2
    for _ in range(_STEPS):
        along_x = np.exp(-2j * np.pi * fx * column) * np.stack([column**0, column, column**2])
        along_y = np.exp(-2j * np.pi * fy * row) * np.stack([row**0, row, row**2])
        moment = along_y @ _times(spectrum.windowed, along_x.T)
        (d, dx, dxx), (dy, dxy, _), (dyy, _, _) = moment * np.array([1, -1j, -1])[:, None] * np.array([1, -1j, -1])
        gradient = 2 * np.real(np.conj(d) * np.array([dx, dy])) / abs(d) ** 2  # of the logarithm, which is concave
        mixed = np.conj(dx) * dy + np.conj(d) * dxy
        straight = [abs(dx) ** 2 + np.conj(d) * dxx, abs(dy) ** 2 + np.conj(d) * dyy]
        hessian = 2 * np.real([[straight[0], mixed], [mixed, straight[1]]]) / abs(d) ** 2 - np.outer(gradient, gradient)
        if not (hessian[0, 0] < 0 < np.linalg.det(hessian)):
            break
        step = -np.linalg.solve(hessian, gradient) / (2 * np.pi)
        limit = np.array(spectrum.bins) / 2
        fx, fy = np.array([fx, fy]) + np.clip(step, -limit, limit)
        if (np.abs(step) < _CONVERGED * limit).all():
            break
    return float(fx), float(fy)


def _transform(windowed: Float64Array, fy: Float64Array, fx: Float64Array) -> NDArray[np.complex128]:
    """Fourier transform at the frequencies fx by fy, phases counted from the middle."""
    rows, columns = windowed.shape
    column = np.arange(columns) - (columns - 1) / 2
    row = -(np.arange(rows) - (rows - 1) / 2)
    along_x = np.exp(-2j * np.pi * np.outer(column, fx))
    return np.asarray(np.exp(-2j * np.pi * np.outer(fy, row)) @ _times(windowed, along_x))


def _times(windowed: Float64Array, waves: NDArray[np.complex128]) -> NDArray[np.complex128]:
    return np.asarray(windowed @ waves.real + 1j * (windowed @ waves.imag))


def _of_window(window: Float64Array, frequency: Float64Array) -> Float64Array:
    """Fourier transform of a window, which is real since the window is even."""
    place = np.arange(len(window)) - (len(window) - 1) / 2
    return np.asarray(np.cos(2 * np.pi * np.outer(frequency, place)) @ window)


def _upper(x: float, y: float) -> tuple[float, float]:
    return (x, y) if y > 0 or (y == 0 and x > 0) else (-x, -y)
