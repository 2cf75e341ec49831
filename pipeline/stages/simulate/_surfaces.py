"""What simulated surfaces share: their limits, and gratings that are one profile repeated."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipeline.data.height_fields import HeightField
from pipeline.errors import InputError
from pipeline.limits import above_zero, zero_or_more
from pipeline.optics.surfaces import grating_tile, plane_coordinates

Float64Array = NDArray[np.float64]

LARGEST_SIDE = 4096
LEAST_SAMPLES = 4
"""Samples a period."""
NOTICED_DEG = 1e-6

_log = logging.getLogger(__name__)


def repeated(
    profile: Callable[[Float64Array], Float64Array],
    name: str,
    *,
    period_um: float,
    depth_um: float,
    orientation_deg: float,
    size_um: float,
    pitch_um: float,
    periodic: bool,
) -> HeightField:
    """The surface whose height is ``profile`` of the cycles along one direction."""
    wanted = float(np.deg2rad(orientation_deg))
    if periodic:
        tile = grating_tile(period_um=period_um, orientation_rad=wanted, size_um=size_um, pitch_um=pitch_um)
        phase, pitch = tile.phase(), tile.pitch_um
        off = float(np.rad2deg(np.angle(np.exp(1j * (tile.orientation_rad - wanted)))))
        if abs(off) > NOTICED_DEG:
            _log.info("the orientation is %+.4f degrees off what was asked for, so that the tile repeats exactly", off)
            orientation_deg += off
    else:
        side = max(1, round(size_um / pitch_um))
        phase, pitch = plane_coordinates((side, side), pitch_um, wanted)[0] / period_um, pitch_um
    said = f"{name}, period {period_um:.6g} µm, {depth_um:.6g} µm deep, orientation {orientation_deg:.6g}°"
    return HeightField((depth_um * profile(phase)).astype(np.float32), pitch, periodic, said)


def unmakeable(*, period_um: float, depth_um: float, size_um: float, pitch_um: float, **_: object) -> list[InputError]:
    """What keeps a surface of such a size from being made."""
    problems = above_zero(period_um=period_um, size_um=size_um, pitch_um=pitch_um) + zero_or_more(depth_um=depth_um)
    if problems:
        return problems
    if pitch_um > period_um / LEAST_SAMPLES:
        right = f"at most {period_um / LEAST_SAMPLES:g}, {LEAST_SAMPLES} samples a period"
        problems.append(InputError(f"pitch_um is {pitch_um:g}", where="pitch_um", expected=right))
    if size_um < period_um:
        right = f"at least the period, {period_um:g}"
        problems.append(InputError(f"size_um is {size_um:g}", where="size_um", expected=right))
    if size_um / pitch_um > LARGEST_SIDE:
        right = f"at most {LARGEST_SIDE}"
        what = f"the surface would have {size_um / pitch_um:.0f} samples a side"
        problems.append(InputError(what, where="pitch_um, size_um", expected=right))
    return problems


def undirected(*, period_um: float, orientation_deg: float, size_um: float, periodic: bool) -> list[InputError]:
    """A tile cannot repeat along an axis on which its grating takes many tiles to come round once."""
    slopes = np.abs([np.cos(np.deg2rad(orientation_deg)), np.sin(np.deg2rad(orientation_deg))])
    least = min(slope for slope in slopes if slope > 1e-9)
    if not periodic or period_um / least < 2 * size_um:
        return []
    what = f"orientation_deg is {orientation_deg:g}: a tile would repeat after {period_um / least:.4g} um only"
    right = "0 or 90, or farther from them; or a larger size_um; or periodic: false"
    return [InputError(what, where="orientation_deg", expected=right)]
