"""What an instrument that scans line by line does to a surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.data.height_fields import HeightField
from pipeline.limits import refuse, within, zero_or_more

Float64Array = NDArray[np.float64]

MOST_BITS = 24
STEEPEST_DEG = 60.0

_tolerance_scanned = {"height_um": 1e-6}


def scanned(
    surface: HeightField,
    *,
    tilt_deg: float = 0.0,
    tilt_direction_deg: float = 0.0,
    line_offset_um: float = 0.0,
    spikes: int = 0,
    spike_um: float = 0.0,
    noise_um: float = 0.0,
    bits: int = 0,
    seed: int = 0,
) -> HeightField:
    """Scan a surface: the sample lies tilted, lines jump, the tip spikes, heights are noisy and end in whole levels.

    Lines are rows. Every fault is off by default.

    Parameters
    ----------
    surface : HeightField
        As it is.
    tilt_deg, tilt_direction_deg : float
        How steep the sample lies, and in which direction it rises, anticlockwise from +x, y up.
    line_offset_um : float
        Standard deviation of what is added to all of a line, independently of the others.
    spikes : int
        Samples, chosen by chance, that stand out.
    spike_um : float
        By how much, up.
    noise_um : float
        Standard deviation of each sample.
    bits : int
        Heights are rounded to 2**bits levels between lowest and highest; 0: not at all.
    seed : int
        Of all that is drawn.

    Returns
    -------
    HeightField
        Of the same shape and type; no longer periodic where the sample is tilted. Without faults, the surface itself.

    Raises
    ------
    InputError, InputErrors
        Numbers below 0, more than 24 bits, or a tilt that is no tilt any more.
    """
    _check_scanned(
        tilt_deg=tilt_deg,
        line_offset_um=line_offset_um,
        spikes=spikes,
        spike_um=spike_um,
        noise_um=noise_um,
        bits=bits,
        seed=seed,
    )
    if not (tilt_deg or line_offset_um or (spikes and spike_um) or noise_um or bits):
        return surface
    height = surface.height_um.astype(np.float64)
    rows, columns = height.shape
    rng = np.random.default_rng(seed)
    slope, direction = np.tan(np.deg2rad(tilt_deg)), np.deg2rad(tilt_direction_deg)
    x, y = np.arange(columns) * surface.pitch_um, -np.arange(rows)[:, None] * surface.pitch_um
    height += slope * (x * np.cos(direction) + y * np.sin(direction))
    height += line_offset_um * rng.standard_normal((rows, 1))
    height.flat[rng.choice(height.size, min(spikes, height.size), replace=False)] += spike_um
    height += noise_um * rng.standard_normal(height.shape)
    if bits:
        height = _in_levels(height, bits)
    periodic = surface.periodic and tilt_deg == 0
    caption = f"{surface.caption}, scanned" if surface.caption else "Scanned"
    return replace(surface, height_um=height.astype(surface.height_um.dtype), periodic=periodic, caption=caption)


def _in_levels(height: Float64Array, bits: int) -> Float64Array:
    low, high = np.nanmin(height), np.nanmax(height)
    step = (high - low) / (2**bits - 1)
    return low + step * np.rint((height - low) / step) if step > 0 else height


def _check_scanned(
    *,
    tilt_deg: float,
    line_offset_um: float,
    spikes: int,
    spike_um: float,
    noise_um: float,
    bits: int,
    seed: int,
    **_: object,
) -> None:
    """Refuse impossible faults before anything runs."""
    refuse(
        within(0, STEEPEST_DEG, tilt_deg=tilt_deg),
        zero_or_more(line_offset_um=line_offset_um, spikes=spikes, spike_um=spike_um, noise_um=noise_um, seed=seed),
        within(0, MOST_BITS, bits=bits),
    )
