"""Where two maps differ by more than their noise: means over windows of several sizes, against their own scatter."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.stats import norm

from pipeline.optics.regions import grown

Float32Array = NDArray[np.float32]
BoolArray = NDArray[np.bool_]

SCALES_PX = (0.0, 1.0, 2.0, 4.0, 8.0)
"""Standard deviations of the windows; 0 is the pixel itself."""

_LEAST_COVERAGE = 0.3
_CLEAR_CONTOUR = 4.0
_REACH = 2.5
_RIM_PX = 2.0
_LOOKS = 8
_MAD = 1.4826


@dataclass(frozen=True)
class Deviation:
    """What a difference of two maps amounts to.

    Attributes
    ----------
    means : ndarray of shape (S, M, N), float32
        Mean difference over each scale's window, weighted by the inverse of the variance; 0 where nothing is judged.
    deviations : ndarray of shape (S, M, N), float32
        Standard deviation of each mean, calibrated by the scatter of the means over the whole map.
    judged : ndarray of shape (M, N), bool
        Where there is a difference.
    noise : ndarray of shape (M, N), float32
        Standard deviation of each pixel's difference.
    inflation : float
        How much more the widest windows scatter than they would with independent pixels.
    """

    means: Float32Array
    deviations: Float32Array
    judged: BoolArray
    noise: Float32Array
    inflation: float

    @property
    def significance(self) -> Float32Array:
        """Mean over deviation, signed, at the scale at which it is largest; shape (M, N), NaN where not judged."""
        ratio = self.means / self.deviations
        best = np.argmax(np.abs(ratio), axis=0)[None]
        return np.where(self.judged, np.take_along_axis(ratio, best, axis=0)[0], np.float32(np.nan))

    def over(self, area: BoolArray) -> tuple[float, float]:
        """Mean difference over an area, and how many standard deviations that is; NaN where none of it is judged."""
        inside = area & self.judged
        if not inside.any():
            return float("nan"), float("nan")
        weight = 1 / self.noise[inside].astype(np.float64) ** 2
        # Over a wide area the mean scatters by what its pixels share, however many they are.
        mean = float(np.sum(weight * self.means[0][inside]) / weight.sum())
        return mean, mean * float(np.sqrt(weight.sum())) / self.inflation


def calibrated(difference: Float32Array, shape: Float32Array, judged: BoolArray) -> float:
    """Factor that makes a noise of known shape the standard deviation of a difference, robustly."""
    ratio = difference[judged] / shape[judged]
    return _MAD * float(np.median(np.abs(ratio - np.median(ratio)))) if ratio.size else 0.0


def deviation(difference: Float32Array, noise: Float32Array, judged: BoolArray) -> Deviation:
    """Mean differences over windows of every scale, with their standard deviations.

    The noise of neighbouring pixels is not quite independent, and faults of the optics are not noise at all; so the
    deviations of each scale are stretched until the middle half of all means scatters as they say, where it scatters
    more than expected.

    Parameters
    ----------
    difference, noise : ndarray of shape (M, N), float32
        Difference, and standard deviation of each pixel's.
    judged : ndarray of shape (M, N), bool
        Pixels that count.
    """
    difference = np.where(judged, difference, np.float32(0))
    weight = np.where(judged, 1 / np.where(judged, noise, 1) ** 2, 0).astype(np.float32)
    count = judged.astype(np.float32)
    means = np.zeros((len(SCALES_PX), *difference.shape), np.float32)
    spreads = np.full_like(means, np.inf)
    factor = 1.0
    for index, sigma in enumerate(SCALES_PX):
        total = _blurred(weight, sigma)
        enough = judged & (_blurred(count, sigma) >= _LEAST_COVERAGE) & (total > 0)
        safe = np.where(enough, total, 1)
        means[index] = np.where(enough, _blurred(weight * difference, sigma) / safe, 0)
        variance = _blurred(weight, sigma / np.sqrt(2)) / (4 * np.pi * sigma**2) if sigma else weight
        spreads[index] = np.where(enough, np.sqrt(np.maximum(variance, 1e-30)) / safe, np.inf)
        factor = max(1.0, calibrated(means[index], spreads[index], enough))
        spreads[index] *= factor
    return Deviation(means, spreads, judged, noise, factor)


def expected_extreme(judged: int, false_alarms: float) -> float:
    """Significance that Gaussian noise exceeds ``false_alarms`` times a map, in so many pixels at all scales."""
    return float(norm.isf(false_alarms / (2 * max(judged, 1) * len(SCALES_PX))))


def extents(found: Deviation, threshold: float, least: float) -> BoolArray:
    """Pixels of all regions that deviate by more than the threshold and by more than ``least``, shape (M, N).

    A wide window finds a weak region but smears it. So each region ends where the difference falls to half of that in
    its middle, seen at the finest scale at which noise leaves that contour clear. What was found no longer counts when
    the map is looked at again, for what was hidden beside it.
    """
    area = np.zeros_like(found.judged)
    rest = found
    for _ in range(_LOOKS):
        parts = [
            part
            for sign in (1, -1)
            for part in _parts(rest, (sign * rest.means > np.maximum(threshold * rest.deviations, least)), sign)
        ]
        if not parts:
            break
        seen = np.zeros_like(area)
        for part, guard in parts:
            area |= part
            seen |= grown(part, guard)
        rest = deviation(found.means[0], found.noise, rest.judged & ~seen)
    return area


def _parts(found: Deviation, passed: NDArray[np.bool_], sign: int) -> list[tuple[BoolArray, float]]:
    """A region for each patch that passed at any scale, with the width of the rim that it still reaches into."""
    labels, count = ndimage.label(passed.any(axis=0), np.ones((3, 3), int))
    return [
        _extent(found, labels, index + 1, (window[0], window[1]), sign)
        for index, window in enumerate(ndimage.find_objects(labels, count))
    ]


def _extent(
    found: Deviation, labels: NDArray[np.int32], label: int, window: tuple[slice, slice], sign: int
) -> tuple[BoolArray, float]:
    """The region around the most significant pixel of a label, and its rim."""
    inside = labels[window] == label
    ratio = np.where(inside, sign * found.means[(slice(None), *window)] / found.deviations[(slice(None), *window)], -1)
    scale, row, column = (int(i) for i in np.unravel_index(np.argmax(ratio), ratio.shape))
    row, column = row + window[0].start, column + window[1].start
    height = sign * float(found.means[scale, row, column])
    clear = [s for s in range(scale) if height > _CLEAR_CONTOUR * found.deviations[s, row, column]]
    contour = clear[0] if clear else scale
    margin = int(np.ceil(_REACH * max(SCALES_PX[scale], 1.0)))
    wide = tuple(
        slice(max(0, s.start - margin), min(n, s.stop + margin)) for s, n in zip(window, labels.shape, strict=True)
    )
    above = found.judged[wide] & (sign * found.means[contour][wide] > height / 2)
    areas, _ = ndimage.label(above, np.ones((3, 3), int))
    touched = np.unique(areas[(labels[wide] == label) & above])
    whole = np.zeros_like(found.judged)
    whole[wide] = np.isin(areas, touched[touched > 0])
    whole[row, column] = True
    return whole, _RIM_PX + SCALES_PX[contour]


def _blurred(image: Float32Array, sigma: float) -> Float32Array:
    if sigma == 0:
        return image
    return np.asarray(cv2.GaussianBlur(image, (0, 0), float(sigma), borderType=cv2.BORDER_CONSTANT))
