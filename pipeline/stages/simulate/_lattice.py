"""Samples of surfaces that repeat along two directions at right angles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.optics.surfaces import plane_coordinates

Float64Array = NDArray[np.float64]


@dataclass(frozen=True)
class Lattice:
    """Periods along the orientation and across it, and how samples are laid on them.

    Attributes
    ----------
    period_um, across_um : float
        The periods.
    periods, periods_across : int
        How many the tile holds; 0 where it does not repeat.
    pitch_um : float
        Of the samples.
    quarter_turns : int
        By which a tile that repeats has to be turned, anticlockwise.
    """

    period_um: float
    across_um: float
    periods: int = 0
    periods_across: int = 0
    pitch_um: float = 0.0
    quarter_turns: int = 0

    def laid(self, height: NDArray[np.float32]) -> NDArray[np.float32]:
        """Heights turned into the orientation that was asked for."""
        return np.ascontiguousarray(np.rot90(height, self.quarter_turns), np.float32)


def lattice(
    wanted: Lattice, *, orientation_deg: float, size_um: float, pitch_um: float, periodic: bool
) -> tuple[Lattice, Float64Array, Float64Array]:
    """The lattice as it can be sampled, and each sample's place in its periods, ``u`` along and ``v`` across, (M, N).

    Of a tile that repeats, the pitch makes the first period exact, and the second is the nearest that takes a whole
    number of samples.
    """
    if not periodic:
        side = max(1, round(size_um / pitch_um))
        along, across = plane_coordinates((side, side), pitch_um, float(np.deg2rad(orientation_deg)))
        made = Lattice(wanted.period_um, wanted.across_um, pitch_um=pitch_um)
        return made, along / wanted.period_um, across / wanted.across_um
    periods = max(1, round(size_um / wanted.period_um))
    columns = max(1, round(periods * wanted.period_um / pitch_um))
    pitch = periods * wanted.period_um / columns
    periods_across = max(1, round(size_um / wanted.across_um))
    rows = max(1, round(periods_across * wanted.across_um / pitch))
    turns = round(orientation_deg / 90)
    made = Lattice(wanted.period_um, rows * pitch / periods_across, periods, periods_across, pitch, turns)
    u = np.arange(columns) * periods / columns
    v = np.arange(rows)[::-1, None] * periods_across / rows
    return made, u, v


def unturnable(*, orientation_deg: float, periodic: bool) -> list[InputError]:
    """What keeps a rectangular lattice from repeating on square samples."""
    if not periodic or orientation_deg % 90 == 0:
        return []
    return [
        InputError(
            f"orientation_deg is {orientation_deg:g}",
            where="orientation_deg",
            expected="a multiple of 90 of a tile that repeats, or periodic: false",
        )
    ]
