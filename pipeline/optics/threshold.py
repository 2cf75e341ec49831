"""Where to cut an image into a dark ground and what is printed on it, and whether there is anything to cut."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks

_BINS = 256
_MOST_SAMPLES = 1_000_000
_SMOOTHING_BINS = 4.0
_LEAST_SEPARABILITY = 0.85
_HIGHEST_VALLEY = 0.1
_LEAST_RATIO = 3.0


@dataclass(frozen=True)
class TwoModes:
    """What the histogram of the logarithm of an intensity looks like.

    Attributes
    ----------
    threshold : float
        Cut between the modes, in the unit of the intensity.
    separability : float
        Share of the variance of the logarithm that Otsu's cut explains; 0.64 for one Gaussian, 0.75 for a uniform one.
    valley : float
        Height of the histogram's lowest place between the two modes, relative to the lower of the two.
    ratio : float
        Geometric mean intensity of the bright class over that of the dark one.
    below : float
        Share of the pixels below the threshold.
    distinct : bool
        Separability of 0.85 or more, a valley of 0.1 or less and a ratio of 3 or more.
    """

    threshold: float
    separability: float
    valley: float
    ratio: float
    below: float

    @property
    def distinct(self) -> bool:
        """Whether the histogram has two modes far enough apart to be called ground and print."""
        return (
            self.separability >= _LEAST_SEPARABILITY and self.valley <= _HIGHEST_VALLEY and self.ratio >= _LEAST_RATIO
        )


def two_modes(intensity: ArrayLike) -> TwoModes:
    """Cut the logarithm of ``intensity`` in two and say how well that describes it.

    Otsu's cut separates two classes and says how well two describe the histogram. The threshold itself lies half way in
    intensity between the darkest mode and the next one that stands apart from it (three times as bright or more, with a
    valley between): half way up the blurred edge of the dimmest kind of facet, since facets of short period are dim and
    Otsu's cut may leave them with the ground. It is never above Otsu's cut. NaN are left out; of more than a million
    values every n-th is looked at.

    References
    ----------
    Otsu, A threshold selection method from gray-level histograms, IEEE Trans. SMC 9 (1979).
    """
    values = np.asarray(intensity, np.float64).ravel()
    values = values[np.isfinite(values)]
    values = values[:: 1 + values.size // _MOST_SAMPLES]
    top = float(np.percentile(values, 99.5)) if values.size else 0.0
    if top <= 0:
        return TwoModes(0.0, 0.0, 1.0, 1.0, 0.0)
    logarithm = np.log(np.maximum(values, top * 1e-4))
    low, high = np.percentile(logarithm, [0.1, 99.9])
    if high - low < 1e-6:
        return TwoModes(0.0, 0.0, 1.0, 1.0, 0.0)
    counts, edges = np.histogram(logarithm, _BINS, (low, high))
    share = counts / counts.sum()
    centre = (edges[1:] + edges[:-1]) / 2
    weight, moment = np.cumsum(share), np.cumsum(share * centre)
    mean = moment[-1]
    between = (mean * weight - moment) ** 2 / np.maximum(weight * (1 - weight), 1e-12)
    # In an empty gap the criterion is flat: the cut goes to its middle.
    cut = int(np.mean(np.flatnonzero(between[:-1] >= (1 - 1e-9) * between[:-1].max())))
    separability = float(between[cut] / np.sum(share * (centre - mean) ** 2))
    ratio = float(np.exp((mean - moment[cut]) / (1 - weight[cut]) - moment[cut] / weight[cut]))

    smooth = gaussian_filter1d(share, _SMOOTHING_BINS)
    dark = int(np.argmax(smooth[: cut + 1]))
    bright = cut + 1 + int(np.argmax(smooth[cut + 1 :]))
    valley = float(smooth[dark : bright + 1].min() / min(smooth[dark], smooth[bright]))
    threshold = min(_half_way(smooth, centre), float(np.exp(edges[cut + 1])))
    return TwoModes(threshold, separability, valley, ratio, float(np.mean(values < threshold)))


def _half_way(smooth: NDArray[np.float64], centre: NDArray[np.float64]) -> float:
    """Intensity half way between the darkest mode and the next one that stands apart from it; infinite without one."""
    peaks, _ = find_peaks(np.concatenate([[0.0], smooth, [0.0]]), prominence=0.03 * smooth.max())
    modes = peaks - 1
    for mode in modes[1:]:
        ground = modes[0]
        valley = smooth[ground : mode + 1].min() / min(smooth[ground], smooth[mode])
        if valley <= _HIGHEST_VALLEY and centre[mode] - centre[ground] >= np.log(_LEAST_RATIO):
            return float((np.exp(centre[ground]) + np.exp(centre[mode])) / 2)
    return float("inf")
