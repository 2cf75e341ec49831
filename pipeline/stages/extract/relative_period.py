"""Grating periods on a relative scale from the brightness of the zeroth order."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks

from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.errors import InputError
from pipeline.limits import above_zero, above_zero_up_to, refuse, zero_or_more
from pipeline.optics.median import median_rows
from pipeline.parallel import over_rows

_log = logging.getLogger(__name__)

Float32Array = NDArray[np.float32]

_BINS = 512
_SMOOTHING_BINS = 4.0

# What a step of 14 bits in a simulated photograph comes to: 1.2e-5 was seen; last bits of float32 do less than 2e-6.
_tolerance_relative_period = {"period_um": 1e-4}


def relative_period(
    orientation: OrientationMap,
    *,
    longest_um: float = 1.4,
    shortest_um: float | None = None,
    percentile: float = 99.0,
    median_radius: int = 2,
) -> PeriodMap:
    """Periods relative to the longest: the zeroth order falls as ``1 / K^2`` when the period falls as ``1 / K``.

    ``period / longest = sqrt(I / I_longest)`` with ``I`` the mean intensity over the photographs. The intensity of the
    longest period is not the largest one, which is noise, dust or an edge: it is the brightest mode of the histogram
    of ``sqrt(I)``, where that lies within ten percent of the given percentile and stands out; a map without such a mode
    (periods that vary continuously) takes the percentile itself. What was used is reported.

    Parameters
    ----------
    orientation : OrientationMap
        Its ``intensity`` and ``mask`` are used.
    longest_um : float
        Longest period of the sample, which the photographs cannot tell.
    shortest_um : float, optional
        Re-target the range [shortest, longest] of the relative periods to [``shortest_um``, ``longest_um``]. By default
        the periods are only scaled.
    percentile : float
        Of ``sqrt(I)`` over the diffracting pixels, near which the longest period is looked for.
    median_radius : int
        Half width of a median over the diffracting pixels that removes noise and the blur at edges; 0 for none.

    Returns
    -------
    PeriodMap
        Relative: its scale was given.

    Raises
    ------
    InputError, InputErrors
        Impossible settings, or no pixel that diffracts.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018),
    section 5.4, eq. 11.
    """
    _check_relative_period(
        longest_um=longest_um, shortest_um=shortest_um, percentile=percentile, median_radius=median_radius
    )
    mask = orientation.mask & np.isfinite(orientation.intensity)
    if not mask.any():
        raise InputError("no pixel diffracts", expected="an orientation map with pixels inside its mask")
    root = np.sqrt(np.maximum(orientation.intensity, 0)).astype(np.float32)
    root = _median(root, mask, median_radius)
    relative = root / np.float32(_longest(root[mask], percentile))
    if shortest_um is None:
        period = longest_um * relative
    else:
        least = float(np.percentile(relative[mask], 100 - percentile))
        period = shortest_um + (relative - least) * (longest_um - shortest_um) / (1 - least)
        period = np.maximum(period, 0)
    period = np.where(mask, period, np.nan).astype(np.float32)
    return PeriodMap(period, mask, orientation.pixel_mm, relative=True)


def _check_relative_period(
    *, longest_um: float, shortest_um: float | None, percentile: float, median_radius: int
) -> None:
    """Refuse impossible periods before anything runs."""
    problems = above_zero(longest_um=longest_um, shortest_um=shortest_um)
    if shortest_um is not None and not problems and shortest_um >= longest_um:
        problems.append(
            InputError(
                f"shortest_um is {shortest_um:g}", where="shortest_um", expected=f"below longest_um, {longest_um:g}"
            )
        )
    refuse(problems, above_zero_up_to(100, percentile=percentile), zero_or_more(median_radius=median_radius))


def _median(values: Float32Array, mask: NDArray[np.bool_], radius: int) -> Float32Array:
    if radius == 0:
        return np.where(mask, values, np.float32(np.nan))
    out = np.empty_like(values)
    over_rows(lambda start, stop: median_rows(values, mask, radius, start, stop, out), len(values))
    return out


def _longest(root: Float32Array, percentile: float) -> float:
    """Root intensity of the longest period."""
    near = float(np.percentile(root, percentile))
    if near <= 0:
        raise InputError("the diffracting pixels are black", expected="photographs that show the zeroth order")
    counts, edges = np.histogram(root, _BINS, (0.0, 1.2 * near))
    smooth = gaussian_filter1d(counts / counts.sum(), _SMOOTHING_BINS)
    centre = (edges[1:] + edges[:-1]) / 2
    peaks, found = find_peaks(smooth, height=0.002, prominence=0.5 * smooth.mean(), width=0, rel_height=0.5)
    distinct = [p for p, width in zip(peaks, found["widths"], strict=True) if width < 0.1 * _BINS]
    distinct = [p for p in distinct if 0.9 * near <= centre[p] <= 1.1 * near]
    if not distinct:
        _log.info("Longest period: percentile %g of the root intensity, %.4f; no mode stands out.", percentile, near)
        return near
    brightest = float(centre[distinct[-1]])
    _log.info(
        "Longest period: brightest mode of the root intensity, %.4f (percentile %g: %.4f).", brightest, percentile, near
    )
    return brightest
