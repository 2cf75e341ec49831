"""Half vectors of a run of neighbouring pixels, in the precision that is given and in loops that become vectors."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.optics.compiled import njit

U, V_SQUARE, W, MORE_U, MORE_V, GAIN = range(6)
"""Rows of what is found: |u|, v^2, w, the variances that light and pixel add, and what geometry makes of radiance."""

_f = np.float32


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz", "reassoc", "arcp"})
def half_vectors(
    run: Any,
    above: Any,
    row: int,
    start: int,
    length: int,
    cosine: Any,
    sine: Any,
    slope_x: Any,
    slope_y: Any,
    flat: bool,
    homography: Any,
    eye: Any,
    light: Any,
    light_sigma: Any,
    part: Any,
    fresnel: Any,
) -> None:
    """Fill ``run`` (6, length or more) and ``above``, whether light and eye are in front of the surface."""
    x_column, y_column, z_column = homography[0], homography[3], homography[6]
    x_row, y_row, z_row = homography[1], homography[4], homography[7]
    r = _f(row)
    x0, y0, z0 = x_row * r + homography[2], y_row * r + homography[5], z_row * r + homography[8]
    light_x, light_y, light_z = light
    eye_x, eye_y, eye_z = eye
    for j in range(length):
        column = _f(start + j)
        scale = _f(1) / (z_column * column + z0)
        x, y = (x_column * column + x0) * scale, (y_column * column + y0) * scale
        lx, ly, lz = light_x - x, light_y - y, light_z
        cx, cy, cz = eye_x - x, eye_y - y, eye_z
        by_light = _f(1) / np.sqrt(lx * lx + ly * ly + lz * lz)
        by_eye = _f(1) / np.sqrt(cx * cx + cy * cy + cz * cz)
        lx, ly, lz = lx * by_light, ly * by_light, lz * by_light
        cx, cy, cz = cx * by_eye, cy * by_eye, cz * by_eye
        hx, hy, hz = lx + cx, ly + cy, lz + cz
        tx, ty, tz = cosine[j], sine[j], _f(0)
        bx, by, bz = -ty, tx, _f(0)
        cos_eye, w = cz, hz
        if not flat:
            p, q = slope_x[j], slope_y[j]
            nz = _f(1) / np.sqrt(_f(1) + p * p + q * q)
            nx, ny = -p * nz, -q * nz
            tz = p * tx + q * ty
            shorter = _f(1) / np.sqrt(_f(1) + tz * tz)
            tx, ty, tz = tx * shorter, ty * shorter, tz * shorter
            bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
            cos_eye = cx * nx + cy * ny + cz * nz
            w = hx * nx + hy * ny + hz * nz
        more = light_sigma * by_light
        on_tangent, on_bitangent = lx * tx + ly * ty + lz * tz, lx * bx + ly * by + lz * bz
        more_u = (_f(1) - on_tangent * on_tangent) * more * more
        more_v = (_f(1) - on_bitangent * on_bitangent) * more * more
        if part > _f(0):
            for ex, ey in (
                ((x_column - x * z_column) * scale, (y_column - y * z_column) * scale),
                ((x_row - x * z_row) * scale, (y_row - y * z_row) * scale),
            ):
                on_light, on_eye = (lx * ex + ly * ey) * by_light, (cx * ex + cy * ey) * by_eye
                dx = lx * on_light + cx * on_eye - ex * (by_light + by_eye)
                dy = ly * on_light + cy * on_eye - ey * (by_light + by_eye)
                dz = lz * on_light + cz * on_eye
                du, dv = dx * tx + dy * ty + dz * tz, dx * bx + dy * by + dz * bz
                more_u += du * du * (part * part * _f(1 / 12))
                more_v += dv * dv * (part * part * _f(1 / 12))
        u, v = hx * tx + hy * ty + hz * tz, hx * bx + hy * by + hz * bz
        between = lx * cx + ly * cy + lz * cz
        bend = _f(1) - np.sqrt(_f(0.5) * (_f(1) + between))
        square = bend * bend
        gain = (_f(1) + fresnel * square * square * bend) * (_f(1) + between) ** 2
        run[U, j], run[V_SQUARE, j], run[W, j] = abs(u), v * v, w
        run[MORE_U, j], run[MORE_V, j] = more_u, more_v
        run[GAIN, j] = gain * (_f(500) * by_light) ** 2 / (cos_eye * w * w)
        above[j] = (cos_eye > _f(0)) & (w > cos_eye)
