"""Overlapping scales of a snake: which one covers a point, how it leans, lies and is coloured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.shaded_mesh import Float64Array

Texture = Literal["iridescent", "blotched", "grey"]

_HALF_LENGTH, _HALF_WIDTH = 0.80, 0.60
"""Of a scale, in units of texture coordinates: rows of scales are half a unit apart and shifted by half of one."""
_VAULT, _LIFT = 0.10, 0.05
"""Slopes of a scale from its middle to its edge, and from head to tail of it as it lies upon the next."""
_TURN_RAD = np.deg2rad(2.5)
_SEAM = 0.80
"""Share of a scale's radius where its darker seam begins."""
_PIGMENTS = {
    # Back, flank and belly: linear sRGB.
    "iridescent": [(0.030, 0.020, 0.014), (0.050, 0.034, 0.024), (0.55, 0.50, 0.42)],
    "blotched": [(0.42, 0.17, 0.05), (0.50, 0.24, 0.09), (0.65, 0.58, 0.48)],
    "grey": [(0.18, 0.18, 0.18)] * 3,
}
_BLOTCH = (0.22, 0.030, 0.012)


@dataclass(frozen=True)
class ScalePoints:
    """Points on scales.

    Attributes
    ----------
    row, column : ndarray of shape (H,), int64
        Which scale: row from the head, column around the body in half steps.
    along, sideways : ndarray of shape (H,)
        Place on the scale, -1 to 1 from its head end to its tail end and from one side to the other, within a disc.
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    along: Float64Array
    sideways: Float64Array

    @property
    def slopes(self) -> tuple[Float64Array, Float64Array]:
        """By how much the scale rises towards the tail and sideways."""
        return _LIFT - _VAULT * self.along, -_VAULT * self.sideways

    @property
    def turn_rad(self) -> Float64Array:
        """By how much each scale lies turned, by its own chance."""
        return np.asarray(_TURN_RAD * (2 * _chance(self.row, self.column, 1) - 1))


def scales_at(uv: Float64Array, around: int) -> ScalePoints:
    """The scale on top at each point: each lies over those behind it.

    Parameters
    ----------
    uv : ndarray of shape (H, 2)
        In scales, from head to tail and around the body.
    around : int
        Scales around the body, which a whole turn brings back to the same.
    """
    u, v = uv.T
    first = np.ceil(2 * (u - _HALF_LENGTH)).astype(np.int64)
    found = ScalePoints(first * 0, first * 0, np.full(len(u), np.nan), np.full(len(u), np.nan))
    for back in range(int(4 * _HALF_LENGTH), -1, -1):
        row = first + back
        shift = row % 2 / 2
        for side in (0, 1):
            whole = np.floor(v - shift).astype(np.int64) + side
            along, sideways = (u - row / 2) / _HALF_LENGTH, (v - whole - shift) / _HALF_WIDTH
            on = along**2 + sideways**2 <= 1
            column = (2 * whole + row % 2) % (2 * around)
            for to, of in zip(
                (found.row, found.column, found.along, found.sideways), (row, column, along, sideways), strict=True
            ):
                to[on] = of[on]
    return found


def pigment(points: ScalePoints, uv: Float64Array, around: int, texture: Texture) -> Float64Array:
    """Albedo of the skin, shape (H, 3), linear sRGB.

    ``iridescent`` is dark brown above and pale below, after Xenopeltis; ``blotched`` orange with red saddles, after
    Elaphe guttata; ``grey`` 18 percent.
    """
    back, flank, belly = np.array(_PIGMENTS[texture])
    # The middle of the scale decides, so that each has one colour.
    height = (1 - np.cos(np.pi * points.column / around)) / 2
    colour = _mixed(belly, _mixed(flank, back, _smooth(height, 0.4, 0.9)), _smooth(height, 0.08, 0.2))
    if texture == "blotched":
        saddle = _smooth(height, 0.35, 0.45) * (np.abs(points.row / 2 % 8 - 4) < 2)
        colour = _mixed(colour, np.array(_BLOTCH), saddle)
    if texture == "grey":
        return np.asarray(colour)
    varied = 0.75 + 0.5 * _chance(points.row, points.column, 2)
    seam = 1 - 0.6 * _smooth(np.hypot(points.along, points.sideways), _SEAM, 1.0)
    return np.asarray(np.clip(colour * (varied * seam)[:, None], 0, 1))


def _mixed(first: Float64Array, second: Float64Array, share: Float64Array) -> Float64Array:
    return np.asarray(first + (second - first) * share[:, None])


def _smooth(value: Float64Array, low: float, high: float) -> Float64Array:
    share = np.clip((value - low) / (high - low), 0, 1)
    return np.asarray(share * share * (3 - 2 * share))


def _chance(row: NDArray[np.int64], column: NDArray[np.int64], kind: int) -> Float64Array:
    """A number in [0, 1) for each scale that looks like chance: the bits of its indices, mixed."""
    with np.errstate(over="ignore"):
        mixed = row.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15) + column.astype(np.uint64) * np.uint64(
            0xC2B2AE3D27D4EB4F
        )
        mixed += np.uint64(kind) * np.uint64(0x165667B19E3779F9)
        for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
            mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
    return np.asarray((mixed >> np.uint64(11)).astype(np.float64) / 2**53)
