"""Periods of a height map from its own spectrum."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray

from pipeline.data.height_fields import HeightField, Periodicity
from pipeline.errors import InputError
from pipeline.limits import at_least, refuse, within
from pipeline.optics.levelling import plane
from pipeline.optics.periodicity import Peak, Spectrum, peaks, spectrum_of

LEAST_SIDE = 16
MOST_PERIODS = 6
SHOWN = 3.0
"""Highest frequency of the spectrum that is kept, over that of the highest peak."""

_log = logging.getLogger(__name__)
_tolerance_periodicity = {
    "period_um": 1e-4,
    "period_error_um": 1e-3,
    "direction_rad": 1e-4,
    "direction_error_rad": 1e-3,
    "rms_um": 1e-4,
    "contrast": 1e-2,
    "spread": 1e-3,
    "power_um2": 1e-6,
    "metrics": 1e-2,
}


def periodicity(surface: HeightField, *, count: int = 2, contrast: float = 10.0) -> Periodicity:
    """Find the periods of a surface and their directions, and say how well they are known, or that there are none.

    The map less its plane, under a Hann window, is transformed. A peak of the smoothed spectrum counts where it stands
    out from the other directions of its frequency as well as from the other frequencies of its direction, so that
    neither roughness, nor an isotropic texture, nor the streak of lines that jump is taken for one. A peak as sharp as
    the window allows is refined to a part of a bin by Newton's method, and its error is that of a wave in the noise
    around it; a wider one gives its centroid, and its error follows from how powers scatter, which is too small, up to
    twofold, where the map holds only a few parts that vary independently. Multiples of a period and
    sums of them are left out. A tile that repeats has whole cycles, whose periods are exact; it needs no window.

    Parameters
    ----------
    surface : HeightField
        Levelled or not; what is not known takes no part.
    count : int
        Periods to look for, at most.
    contrast : float
        Least ratio of a wide peak to the spectrum around it; a sharp one is recognised by its shape.

    Returns
    -------
    Periodicity
        With the figures ``periods``, how many there are, and for each, numbered from 1, ``period_1_um``,
        ``period_1_error_um``, ``direction_1_deg``, ``direction_1_error_deg``, ``rms_1_um`` and ``spread_1_percent``.

    Raises
    ------
    InputError, InputErrors
        Fewer than 16 samples a side, an impossible count or contrast.

    References
    ----------
    Rife and Boorstyn, Single-tone parameter estimation from discrete-time observations, IEEE Transactions on
    Information Theory 20, 591 (1974), for the error of a wave's frequency.
    """
    _check_periodicity(count=count, contrast=contrast)
    height = surface.height_um.astype(np.float64)
    if min(height.shape) < LEAST_SIDE:
        what = f"a map of {height.shape[1]} x {height.shape[0]} samples"
        raise InputError(what, expected=f"at least {LEAST_SIDE} a side")
    level = height - (np.nanmean(height) if surface.periodic else plane(height))
    spectrum = spectrum_of(np.nan_to_num(level), periodic=surface.periodic)
    found = peaks(spectrum, count=count, contrast=contrast)
    if not found:
        _log.warning(
            "No period stands out in any direction. A sharp one takes four cycles of the map, a wide one about six."
        )
    pitch = surface.pitch_um
    frequency = np.array([peak.frequency for peak in found])
    period = pitch / frequency
    rows = {
        "period_um": period,
        "period_error_um": period / frequency * [peak.frequency_error for peak in found],
        "direction_rad": np.array([peak.direction_rad for peak in found]),
        "direction_error_rad": np.array([peak.direction_error_rad for peak in found]),
        "rms_um": np.sqrt([peak.variance for peak in found]),
        "spread": np.array([peak.width for peak in found]) / frequency,
    }
    return Periodicity(
        **rows,
        contrast=np.array([peak.contrast for peak in found]),
        power_um2=_shown(spectrum, found),
        step_per_um=(spectrum.bins[0] / pitch, spectrum.bins[1] / pitch),
        metrics=_figures(rows),
    )


def _figures(rows: dict[str, NDArray[np.float64]]) -> dict[str, float]:
    figures = {"periods": float(len(rows["period_um"]))}
    for index, (period, error, direction, off, rms, spread) in enumerate(zip(*rows.values(), strict=True), 1):
        figures |= {
            f"period_{index}_um": float(period),
            f"period_{index}_error_um": float(error),
            f"direction_{index}_deg": float(np.rad2deg(direction)),
            f"direction_{index}_error_deg": float(np.rad2deg(off)),
            f"rms_{index}_um": float(rms),
            f"spread_{index}_percent": float(100 * spread),
        }
    return figures


def _shown(spectrum: Spectrum, found: list[Peak]) -> NDArray[np.float32]:
    """The part of the spectrum around frequency 0 in which the peaks lie, all of it where there are none."""
    middle = [int(np.argmin(np.abs(places))) for places in (spectrum.y, spectrum.x)]
    reach = [min(place, size - 1 - place) for place, size in zip(middle, spectrum.power.shape, strict=True)]
    if found:
        highest = SHOWN * max(peak.frequency for peak in found)
        reach = [min(r, int(highest / width) + 1) for r, width in zip(reach, spectrum.bins[::-1], strict=True)]
    rows, columns = (slice(place - r, place + r + 1) for place, r in zip(middle, reach, strict=True))
    return spectrum.power[rows, columns].astype(np.float32)


def _check_periodicity(*, count: int, contrast: float) -> None:
    """Refuse impossible settings before anything runs."""
    refuse(
        within(1, MOST_PERIODS, count=count),
        at_least(3, "below which noise would count as a period", contrast=contrast),
    )
