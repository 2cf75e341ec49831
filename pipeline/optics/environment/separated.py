"""On a flat sheet: radiance as a sum of products, one factor of the place in the picture, one of the grating.

Before a fixed camera a pixel's radiance depends on its place, through the direction of view, and on its grating,
``R(x, y, t / a)``. It is worked out for few places and few gratings and interpolated linearly between them,

    R(x, y, theta, a) = sum over j, k of A_j(x, y) R_jk B_k(theta, a),

with hats A_j and B_k. It pays where there are more points than nodes: where many of them lie within each pixel. The
zeroth order does not depend on the grating and is as sharp as the probe: it is left to a look-up in each pixel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.compiled import njit
from pipeline.optics.sheet.maps import prepared_gratings
from pipeline.optics.sheet.view import View

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

_MIDDLE_UM = 0.6
_f = np.float32


@dataclass(frozen=True)
class Nodes:
    """For which places and gratings radiance is worked out.

    Attributes
    ----------
    every : int
        Pixels between neighbouring places.
    places : tuple of int
        Rows and columns of them.
    orientations : int
        Evenly spaced, around half a turn.
    lines_per_um : ndarray of shape (P,), float64
        Evenly spaced inverse periods.
    """

    every: int
    places: tuple[int, int]
    orientations: int
    lines_per_um: Float64Array

    def __len__(self) -> int:
        return self.places[0] * self.places[1] * self.orientations * len(self.lines_per_um)

    def __str__(self) -> str:
        rows, columns = self.places
        return f"{columns} x {rows} places, {self.orientations} orientations and {len(self.lines_per_um)} periods"


def nodes_of(view: View, periods_um: tuple[float, float], apart: float) -> Nodes:
    """Nodes between which the light of 600 nm in the first order comes from directions ``apart`` from each other.

    Parameters
    ----------
    view : View
        The picture.
    periods_um : tuple of float
        The shortest and the longest.
    apart : float
        In the half vector's components.
    """
    column, row = np.meshgrid(np.linspace(0, view.columns - 1, 17), np.linspace(0, view.rows - 1, 17))
    here = _towards_eye(view, column, row)
    turns = [np.linalg.norm(_towards_eye(view, column + dx, row + dy) - here, axis=-1) for dx, dy in ((1, 0), (0, 1))]
    every = max(1, int(apart / max(float(np.nanmax(turns)), 1e-9)))
    every = min(every, max(view.rows, view.columns))
    shortest, longest = periods_um
    count = int(np.ceil(_MIDDLE_UM * (1 / shortest - 1 / longest) / apart))
    return Nodes(
        every,
        ((view.rows - 1) // every + 2, (view.columns - 1) // every + 2),
        int(np.ceil(np.pi * _MIDDLE_UM / shortest / apart)),
        np.linspace(1 / longest, 1 / shortest, count + 1 if count else 1),
    )


def worked_out(nodes: Nodes, view: View, paint: Callable[[Float32Array, Float32Array, View], None]) -> Float32Array:
    """Radiance at all nodes, shape (periods, orientations, rows, columns, 4).

    Parameters
    ----------
    nodes, view : Nodes, View
        Of the picture.
    paint : callable
        Adds to a picture (rows, columns, 3) what its gratings (3, rows, columns) show in a view.
    """
    coarse = View(view.homography @ np.diag([nodes.every, nodes.every, 1.0]), view.eye_mm, *nodes.places)
    values = np.zeros((len(nodes.lines_per_um), nodes.orientations, *nodes.places, 4), np.float32)
    for p, lines in enumerate(nodes.lines_per_um):
        for t in range(nodes.orientations):
            angle = np.full(nodes.places, np.pi * t / nodes.orientations)
            picture = np.zeros((*nodes.places, 3), np.float32)
            paint(picture, prepared_gratings(angle, np.full(nodes.places, 1 / lines)), coarse)
            values[p, t, :, :, :3] = picture
    return values


def interpolate_rows(
    rgb: Float32Array,
    span: tuple[int, int],
    gratings: Float32Array,
    *,
    nodes: Nodes,
    values: Float32Array,
    shift: tuple[float, float] = (0.0, 0.0),
    every: float = 1.0,
) -> None:
    """Add what rows ``span`` show, between nodes; releases the interpreter lock.

    Parameters
    ----------
    rgb, span, gratings
        As of :func:`pipeline.optics.environment.delta.shade_rows`.
    nodes, values : Nodes, ndarray
        From :func:`nodes_of` and :func:`worked_out`.
    shift : tuple of float
        By how many pixels to the right and down the points lie from those for which the nodes were made.
    every : float
        How many of these pixels apart they are.
    """
    lines = nodes.lines_per_um
    per_line = (len(lines) - 1) / (lines[-1] - lines[0]) if len(lines) > 1 else 0.0
    _interpolate(
        rgb,
        span[0],
        span[1],
        gratings,
        values,
        _f(every / nodes.every),
        _f(lines[0]),
        _f(per_line),
        _f(shift[0] / nodes.every),
        _f(shift[1] / nodes.every),
    )


def _towards_eye(view: View, column: Float64Array, row: Float64Array) -> Float64Array:
    away = np.concatenate([-view.points(column, row), np.zeros((*row.shape, 1))], axis=-1) + view.eye_mm
    return np.asarray(away / np.linalg.norm(away, axis=-1, keepdims=True))


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz", "reassoc", "arcp"})
def _interpolate(
    rgb: Any,
    first: int,
    last: int,
    gratings: Any,
    values: Any,
    per_pixel: Any,
    fewest: Any,
    per_line: Any,
    across: Any,
    down: Any,
) -> None:
    periods, turns, rows, columns = values.shape[:4]
    per_radian = _f(turns / np.pi)
    weights = np.empty(4, np.float32)
    for row in range(first, last):
        at_row = min(max(_f(row) * per_pixel + down, _f(0)), _f(rows) - _f(1.001))
        i = int(at_row)
        di = at_row - _f(i)
        for column in range(gratings.shape[2]):
            a = gratings[2, row, column]
            if not a > 0:
                continue
            at_column = min(max(_f(column) * per_pixel + across, _f(0)), _f(columns) - _f(1.001))
            j = int(at_column)
            dj = at_column - _f(j)
            weights[0], weights[1] = (_f(1) - di) * (_f(1) - dj), (_f(1) - di) * dj
            weights[2], weights[3] = di * (_f(1) - dj), di * dj
            at_turn = np.arctan2(gratings[1, row, column], gratings[0, row, column]) * per_radian
            whole = np.floor(at_turn)
            dt = at_turn - whole
            t = int(whole) % turns
            at_period = min(max((_f(1) / a - fewest) * per_line, _f(0)), max(_f(periods) - _f(1.001), _f(0)))
            p = int(at_period)
            dp = at_period - _f(p)
            red = green = blue = _f(0)
            for which in range(4 if periods > 1 else 2):
                by_turn = dt if which % 2 else _f(1) - dt
                by_period = dp if which // 2 else _f(1) - dp
                plane = values[p + which // 2, (t + which % 2) % turns]
                one, two, three, four = plane[i, j], plane[i, j + 1], plane[i + 1, j], plane[i + 1, j + 1]
                weight = by_turn * by_period
                red += weight * (
                    one[0] * weights[0] + two[0] * weights[1] + three[0] * weights[2] + four[0] * weights[3]
                )
                green += weight * (
                    one[1] * weights[0] + two[1] * weights[1] + three[1] * weights[2] + four[1] * weights[3]
                )
                blue += weight * (
                    one[2] * weights[0] + two[2] * weights[1] + three[2] * weights[2] + four[2] * weights[3]
                )
            rgb[row, column, 0] += red
            rgb[row, column, 1] += green
            rgb[row, column, 2] += blue
