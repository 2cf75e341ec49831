"""The fast renderer: geometry of short runs of pixels in vectors, then look-ups where a lobe reaches the eye."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.optics.sheet.colour_table import MIDDLE_UM, REACH, Axis, ColourTable
from pipeline.optics.sheet.view import View

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

_RUN = 128
_U, _V2, _W, _GAIN, _MORE_U, _MORE_V, _PARTS = range(7)
_f = np.float32


def shade_rows(
    rgb: Float32Array,
    span: tuple[int, int],
    gratings: Float32Array,
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
    gratings : ndarray of shape (3, M, N), float32
        What each pixel shows: cosine and sine of the orientation and the period, all 0 or NaN where there is none.
    table : ColourTable
        For what occurs in this picture.
    rgb, span, view, light_mm, light_sigma_mm, slopes, pixel_part
        As of :func:`pipeline.optics.sheet.spectral.shade_rows`.
    """
    _shade(
        rgb,
        span[0],
        span[1],
        gratings,
        np.zeros((2, 1, 1), np.float32) if slopes is None else slopes,
        slopes is None,
        view.homography.astype(np.float32),
        view.eye_mm.astype(np.float32),
        light_mm.astype(np.float32),
        _f(light_sigma_mm),
        _f(pixel_part),
        table.orders,
        table.zeroth,
        _line(table.w),
        _line(table.s_um),
        _line(table.wavelength_um),
        _line(table.added),
        _line(table.distance),
        _f(table.spread_per_um),
        _f(1 / table.normal_reflectance - 1),
    )


def _line(axis: Axis) -> Float32Array:
    """First node, nodes in a unit, and the last node from which another follows."""
    return np.array([axis.low, axis.per_unit, axis.count - 1.001, axis.high], np.float32)


@njit(inline="always")
def _place(value: Any, axis: Any) -> Any:
    return min(max((value - axis[0]) * axis[1], _f(0)), axis[2])


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz", "reassoc", "arcp"})
def _shade(
    rgb: Any,
    first: int,
    last: int,
    gratings: Any,
    slopes: Any,
    flat: bool,
    hom: Any,
    eye: Any,
    light: Any,
    light_sigma: Any,
    part: Any,
    orders: Any,
    zeroth: Any,
    w_axis: Any,
    s_axis: Any,
    wavelength_axis: Any,
    added_axis: Any,
    distance_axis: Any,
    per_um: Any,
    fresnel: Any,
) -> None:
    columns = gratings.shape[2]
    run = np.empty((_PARTS, _RUN), np.float32)
    lit = np.empty(_RUN, np.bool_)
    which = np.empty(_RUN, np.int32)
    reach = _f(REACH * REACH)
    violet, red_end = wavelength_axis[0], wavelength_axis[3]
    widest = (per_um * _f(0.78)) ** 2
    middle = (per_um * _f(MIDDLE_UM)) ** 2
    highest = orders.shape[0]
    for row in range(first, last):
        r = _f(row)
        x0, y0, z0 = hom[0, 1] * r + hom[0, 2], hom[1, 1] * r + hom[1, 2], hom[2, 1] * r + hom[2, 2]
        for start in range(0, columns, _RUN):
            length = min(_RUN, columns - start)
            cosine, sine = gratings[0, row, start : start + length], gratings[1, row, start : start + length]
            period = gratings[2, row, start : start + length]
            for j in range(length):
                column = _f(start + j)
                scale = _f(1) / (hom[2, 0] * column + z0)
                x, y = (hom[0, 0] * column + x0) * scale, (hom[1, 0] * column + y0) * scale
                lx, ly, lz = light[0] - x, light[1] - y, light[2]
                cx, cy, cz = eye[0] - x, eye[1] - y, eye[2]
                by_light = _f(1) / np.sqrt(lx * lx + ly * ly + lz * lz)
                by_eye = _f(1) / np.sqrt(cx * cx + cy * cy + cz * cz)
                lx, ly, lz = lx * by_light, ly * by_light, lz * by_light
                cx, cy, cz = cx * by_eye, cy * by_eye, cz * by_eye
                tx, ty = cosine[j], sine[j]
                hx, hy, w = lx + cx, ly + cy, lz + cz
                u, v = hx * tx + hy * ty, hy * tx - hx * ty
                more = light_sigma * by_light
                more *= more
                between = lx * cx + ly * cy + lz * cz
                bend = _f(1) - np.sqrt(_f(0.5) * (_f(1) + between))
                square = bend * bend
                gain = (_f(1) + fresnel * square * square * bend) * (_f(1) + between) ** 2
                gain *= (_f(500) * by_light) ** 2 / (cz * w * w)
                run[_U, j], run[_V2, j], run[_W, j], run[_GAIN, j] = abs(u), v * v, w, gain
                run[_MORE_U, j] = more
                run[_MORE_V, j] = more
            for j in range(length):
                sigma2 = reach * (widest + run[_MORE_U, j])
                away = run[_U, j] * period[j]
                inside = (run[_V2, j] < sigma2) & (period[j] > _f(0))
                lit[j] = inside & ((away > violet) | (run[_U, j] * run[_U, j] < sigma2))
            count = 0
            for j in range(length):
                which[count] = j
                count += lit[j]
            for k in range(count):
                j = which[k]
                u, v2, w = run[_U, j], run[_V2, j], run[_W, j]
                more_u, more_v, a = run[_MORE_U, j], run[_MORE_V, j], period[j]
                at_w = _place(w, w_axis)
                iw = int(at_w)
                fw = at_w - _f(iw)
                red = green = blue = _f(0)
                if u * u < reach * (widest + more_u):
                    var_u, var_v = middle + more_u, middle + more_v
                    both = np.sqrt(var_u * var_v)
                    at_r = np.sqrt(u * u / var_u + v2 / var_v)
                    at_r = _place(at_r, distance_axis)
                    ir = int(at_r)
                    fr = at_r - _f(ir)
                    at_s = _place(np.sqrt(max(both - middle, _f(0))), added_axis)
                    ie = int(at_s)
                    fe = at_s - _f(ie)
                    one = _f(1) / both
                    for dw in range(2):
                        one_w = one * (fw if dw else _f(1) - fw)
                        for ds in range(2):
                            one_s = one_w * (fe if ds else _f(1) - fe)
                            here, there = zeroth[iw + dw, ie + ds, ir], zeroth[iw + dw, ie + ds, ir + 1]
                            near, far = one_s * (_f(1) - fr), one_s * fr
                            red += here[0] * near + there[0] * far
                            green += here[1] * near + there[1] * far
                            blue += here[2] * near + there[2] * far
                away = a * u
                m = max(int(away / red_end), 1)
                while m <= highest and away > violet * _f(m):
                    wavelength = away / _f(m)
                    m += 1
                    spread2 = (per_um * wavelength) ** 2
                    var_u, var_v = spread2 + more_u, spread2 + more_v
                    if wavelength > red_end or v2 > reach * var_v:
                        continue
                    one = np.exp(_f(-0.5) * v2 / var_v) / np.sqrt(var_u * var_v)
                    at_l = _place(wavelength, wavelength_axis)
                    il = int(at_l)
                    fl = at_l - _f(il)
                    at_s = _place(a * np.sqrt(var_u), s_axis)
                    js = int(at_s)
                    fs = at_s - _f(js)
                    for dw in range(2):
                        one_w = one * (fw if dw else _f(1) - fw)
                        for ds in range(2):
                            one_s = one_w * (fs if ds else _f(1) - fs)
                            here, there = orders[m - 2, iw + dw, js + ds, il], orders[m - 2, iw + dw, js + ds, il + 1]
                            near, far = one_s * (_f(1) - fl), one_s * fl
                            red += here[0] * near + there[0] * far
                            green += here[1] * near + there[1] * far
                            blue += here[2] * near + there[2] * far
                gain = run[_GAIN, j]
                rgb[row, start + j, 0] += gain * red
                rgb[row, start + j, 1] += gain * green
                rgb[row, start + j, 2] += gain * blue
