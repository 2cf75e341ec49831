"""The fast renderer: half vectors of short runs of pixels, then look-ups where a lobe reaches the eye."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.colour import LAST_NM
from pipeline.optics.compiled import njit
from pipeline.optics.sheet.colour_table import MIDDLE_UM, REACH, Axis, ColourTable
from pipeline.optics.sheet.half_vectors import GAIN, MORE_U, MORE_V, V_SQUARE, U, W, half_vectors
from pipeline.optics.sheet.view import View

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

_RUN = 128
_PERIOD, _SCALE, _PART_W, _PART_S, _PART_L, _ALL = range(6, 12)
_REACH_SQUARE = np.float32(REACH**2)
_f, _i, _u = np.float32, np.int32, np.uintp
_fast = njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz", "reassoc", "arcp"})
_inlined = njit(inline="always")


def shade_rows(
    rgb: Float32Array,
    span: tuple[int, int],
    gratings: NDArray[np.floating],
    *,
    view: View,
    light_mm: Float64Array,
    light_sigma_mm: float,
    table: ColourTable,
    slopes: Float32Array | None = None,
    pixel_part: float = 0.0,
) -> None:
    """Add the light that rows ``span`` of the picture get from the sheet; releases the interpreter lock.

    Parameters
    ----------
    gratings : ndarray of shape (3, M, N), of the table's type
        What each pixel shows: cosine and sine of the orientation and the period, all 0 or NaN where there is none.
    table : ColourTable
        For what occurs in this picture; its type is that in which pixels are worked out.
    rgb, span, view, light_mm, light_sigma_mm, slopes, pixel_part
        As of :func:`pipeline.optics.sheet.spectral.shade_rows`.
    """
    real = table.orders.dtype.type
    _shade(
        rgb,
        span[0],
        span[1],
        gratings,
        np.zeros((2, 1, 1), real) if slopes is None else slopes.astype(real, copy=False),
        slopes is None,
        tuple(view.homography.astype(real).ravel()),
        tuple(view.eye_mm.astype(real)),
        tuple(light_mm.astype(real)),
        real(light_sigma_mm),
        real(pixel_part),
        real(1 / table.normal_reflectance - 1),
        table.orders.ravel(),
        _steps(table.orders),
        table.zeroth.ravel(),
        _steps(table.zeroth),
        _line(table.w, real),
        _line(table.root_width, real),
        _line(table.wavelength_um, real),
        _line(table.added, real),
        _line(table.distance, real),
        real(table.spread_per_um),
    )


def _steps(table: NDArray[np.floating]) -> tuple[np.int32, ...]:
    """Numbers from node to node along each axis."""
    return tuple(_i(stride // table.itemsize) for stride in table.strides)


def _line(axis: Axis, real: type[np.floating]) -> tuple[np.floating, ...]:
    """First node, nodes in a unit, the last place from which another node follows, and the last node."""
    return real(axis.low), real(axis.per_unit), real(axis.count - 1.001), real(axis.high)


@_fast
def _shade(
    rgb: Any,
    first: int,
    last: int,
    gratings: Any,
    slopes: Any,
    flat: bool,
    homography: Any,
    eye: Any,
    light: Any,
    light_sigma: Any,
    part: Any,
    fresnel: Any,
    orders: Any,
    steps: Any,
    zeroth: Any,
    zeroth_steps: Any,
    w_axis: Any,
    width_axis: Any,
    wavelength_axis: Any,
    added_axis: Any,
    distance_axis: Any,
    per_um: Any,
) -> None:
    run, lit_run = np.empty((_ALL, _RUN), gratings.dtype), np.empty((_ALL, _RUN), gratings.dtype)
    lit, which = np.empty(_RUN, np.bool_), np.empty(_RUN, np.int32)
    cell, cell_w = np.empty(_RUN, np.int32), np.empty(_RUN, np.int32)
    colour = np.empty((3, _RUN), gratings.dtype)
    widest = (per_um * _f(LAST_NM / 1000)) ** 2
    violet, red = wavelength_axis[0], wavelength_axis[3]
    for row in range(first, last):
        for start in range(0, gratings.shape[2], _RUN):
            end = min(start + _RUN, gratings.shape[2])
            period = gratings[2, row, start:end]
            slope_x = period if flat else slopes[0, row, start:end]
            slope_y = period if flat else slopes[1, row, start:end]
            half_vectors(
                run,
                lit,
                row,
                start,
                end - start,
                gratings[0, row, start:end],
                gratings[1, row, start:end],
                slope_x,
                slope_y,
                flat,
                homography,
                eye,
                light,
                light_sigma,
                part,
                fresnel,
            )
            for j in range(end - start):
                near = run[V_SQUARE, j] < _REACH_SQUARE * (widest + run[MORE_V, j])
                mirror = run[U, j] * run[U, j] < _REACH_SQUARE * (widest + run[MORE_U, j])
                lit[j] &= near & (period[j] > _f(0)) & (mirror | (run[U, j] * period[j] > violet))
            count = _listed(lit, end - start, which)
            least, most = _f(np.inf), _f(0)
            for k in range(count):
                j = which[k]
                for quantity in range(GAIN + 1):
                    lit_run[quantity, k] = run[quantity, j]
                lit_run[_PERIOD, k] = period[j]
                away = period[j] * run[U, j]
                least, most = min(least, away), max(most, away)
                colour[0, k] = colour[1, k] = colour[2, k] = _f(0)
            for k in range(count):
                at_w = _place(lit_run[W, k], w_axis)
                cell_w[k] = _i(at_w)
                lit_run[_PART_W, k] = at_w - _f(_i(at_w))
            _find_zeroth(lit_run, cell_w, count, cell, lit, zeroth_steps, added_axis, distance_axis, per_um)
            _look_up(zeroth, cell, zeroth_steps[0], zeroth_steps[1], lit, count, lit_run, colour)
            for m in range(1, orders.size // steps[0] + 1):
                for order in (_f(m), _f(-m)):
                    ends = least / order, most / order
                    if max(ends) > violet and min(ends) < red:
                        base = (m - 1) * steps[0]
                        _find_order(
                            order, base, lit_run, cell_w, count, cell, lit, steps, width_axis, wavelength_axis, per_um
                        )
                        _look_up(orders, cell, steps[1], steps[2], lit, count, lit_run, colour)
            for k in range(count):
                column, gain = start + which[k], lit_run[GAIN, k]
                for channel in range(3):
                    rgb[row, column, channel] += gain * colour[channel, k]


@_fast
def _listed(chosen: Any, length: int, which: Any) -> int:
    """Write down which are chosen, and return how many."""
    count = 0
    for j in range(length):
        which[count] = j
        count += chosen[j]
    return count


@_inlined
def _place(value: Any, axis: Any) -> Any:
    """Where between the nodes of an axis, in nodes."""
    return min(max((value - axis[0]) * axis[1], _f(0)), axis[2])


@_inlined
def _exponential(x: Any) -> Any:
    """``exp(-x)`` for x in [0, 8], to 2e-4 of 1: that of a sixteenth by its series, to the sixteenth power."""
    y = x * _f(-1 / 16)
    y = _f(1) + y * (_f(1) + y * (_f(1 / 2) + y * (_f(1 / 6) + y * _f(1 / 24))))
    y *= y
    y *= y
    y *= y
    return y * y


@_fast
def _find_zeroth(
    run: Any, cell_w: Any, count: int, cell: Any, lit: Any, steps: Any, added_axis: Any, distance_axis: Any, per_um: Any
) -> None:
    """Where in its table the order 0 of each pixel lies, and whether it reaches the eye."""
    middle, widest = (per_um * _f(MIDDLE_UM)) ** 2, (per_um * _f(LAST_NM / 1000)) ** 2
    for k in range(count):
        u = run[U, k]
        var_u, var_v = middle + run[MORE_U, k], middle + run[MORE_V, k]
        both = np.sqrt(var_u * var_v)
        at_l = _place(np.sqrt(u * u / var_u + run[V_SQUARE, k] / var_v), distance_axis)
        at_s = _place(np.sqrt(max(both - middle, _f(0))), added_axis)
        run[_PART_L, k], run[_PART_S, k] = at_l - _f(_i(at_l)), at_s - _f(_i(at_s))
        run[_SCALE, k] = _f(1) / both
        cell[k] = cell_w[k] * steps[0] + _i(at_s) * steps[1] + _i(at_l) * steps[2]
        lit[k] = u * u < _REACH_SQUARE * (widest + run[MORE_U, k])


@_fast
def _find_order(
    order: Any,
    base: Any,
    run: Any,
    cell_w: Any,
    count: int,
    cell: Any,
    lit: Any,
    steps: Any,
    width_axis: Any,
    axis: Any,
    per_um: Any,
) -> None:
    """Where in its table, which starts at ``base``, an order of each pixel lies, and whether it reaches the eye."""
    for k in range(count):
        wavelength = run[_PERIOD, k] * run[U, k] / order
        square = (per_um * wavelength) ** 2
        var_u, var_v = square + run[MORE_U, k], square + run[MORE_V, k]
        across = run[V_SQUARE, k] / var_v
        at_l = _place(wavelength, axis)
        at_s = _place(np.sqrt(run[_PERIOD, k] * np.sqrt(var_u)), width_axis)
        run[_PART_L, k], run[_PART_S, k] = at_l - _f(_i(at_l)), at_s - _f(_i(at_s))
        run[_SCALE, k] = _exponential(min(_f(0.5) * across, _f(8))) / np.sqrt(var_u * var_v)
        cell[k] = base + cell_w[k] * steps[1] + _i(at_s) * steps[2] + _i(at_l) * steps[3]
        lit[k] = (across < _REACH_SQUARE) & (wavelength > axis[0]) & (wavelength < axis[3])


@_fast
def _look_up(table: Any, cell: Any, step_w: Any, step_s: Any, lit: Any, count: int, run: Any, colour: Any) -> None:
    """Add the colours between the eight nodes around each pixel's place."""
    over, further, next_ = _u(step_w), _u(step_s), _u(4)
    for k in range(count):
        if not lit[k]:
            continue
        near, far = _f(1) - run[_PART_L, k], run[_PART_L, k]
        here, after = run[_SCALE, k] * (_f(1) - run[_PART_W, k]), run[_SCALE, k] * run[_PART_W, k]
        s1 = run[_PART_S, k]
        s0 = _f(1) - s1
        at = _u(cell[k])
        for channel in range(3):
            a, b = at + _u(channel), at + over + _u(channel)
            c, d = a + further, b + further
            low = near * table[a] + far * table[a + next_]
            high = near * table[b] + far * table[b + next_]
            low_s = near * table[c] + far * table[c + next_]
            high_s = near * table[d] + far * table[d + next_]
            colour[channel, k] += here * (s0 * low + s1 * low_s) + after * (s0 * high + s1 * high_s)
