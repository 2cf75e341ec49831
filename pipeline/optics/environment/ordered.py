"""The fast evaluator: look-ups in an equal-area map, the most important ones first, in short runs of pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.optics.environment.area_map import AreaMap
from pipeline.optics.environment.delta import Orders, frame
from pipeline.optics.environment.probe import Probe, look_up
from pipeline.optics.sheet.view import View

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

_RUN = 128
_NODES = 129
_U, _V, _EYE, _INVERSE, _T, _B, _N, _PARTS = 0, 1, 2, 3, 4, 7, 10, 13
_ROW, _COLUMN, _GAIN, _SHARE = range(4)
_NEAR_RIM = 16.0
"""Cells whose light is nearer to the horizon than this, in the square of its cosine, are averaged in closed form."""
_f = np.float32


@dataclass(frozen=True, eq=False)
class LookUps:
    """Pairs of an order and a wavelength, and the zeroth order.

    Attributes
    ----------
    order, wavelength_um, behind_um, ahead_um : ndarray of shape (K,), float32
        Of each, and how far its cell of wavelengths goes on.
    matrices : ndarray of shape (K, 3, 3), float32
        What each makes of a probe's colour.
    share : ndarray of shape (K, D), float32
        Share of its order, over ``w`` from 0 to 2.
    level : ndarray of shape (K,), int64
        Which level of the map it looks up.
    zeroth : ndarray of shape (D, 3, 3), float32
        Of the zeroth order, over ``w``.
    normal_reflectance : float
        See :class:`pipeline.optics.environment.delta.Orders`.
    """

    order: Float32Array
    wavelength_um: Float32Array
    behind_um: Float32Array
    ahead_um: Float32Array
    matrices: Float32Array
    share: Float32Array
    level: NDArray[np.int64]
    zeroth: Float32Array
    normal_reflectance: float

    def __len__(self) -> int:
        return len(self.order)

    def picked(self, which: NDArray[np.integer]) -> LookUps:
        """Some of them."""
        names = ("order", "wavelength_um", "behind_um", "ahead_um", "matrices", "share", "level")
        kept: dict[str, Any] = {name: np.ascontiguousarray(getattr(self, name)[which]) for name in names}
        return replace(self, **kept)

    def without_zeroth(self) -> LookUps:
        """All but the zeroth order."""
        return replace(self, zeroth=np.zeros_like(self.zeroth))


def all_look_ups(orders: Orders, map_: AreaMap, period_um: float) -> LookUps:
    """Every order and wavelength; a map's level is as coarse as neighbouring wavelengths lie apart at a period."""
    w = np.linspace(0, 2, _NODES)
    wavelength = orders.wavelength_um
    phases = 2 * np.pi / wavelength[:, None] * w * orders.depth_um * orders.per_phase
    nodes = np.arange(orders.share.shape[1])
    shares = np.array([np.interp(phases, nodes, share) for share in orders.share])
    highest, count = len(shares) - 1, wavelength.size
    order = np.repeat([m for m in range(-highest, highest + 1) if m], count)
    k = np.tile(np.arange(count), 2 * highest)
    apart = np.abs(order) * orders.step_um / period_um / map_.texel_rad
    return LookUps(
        order=order.astype(np.float32),
        wavelength_um=wavelength[k].astype(np.float32),
        behind_um=np.where(k + 1 < count, orders.step_um / 2, 0).astype(np.float32),
        ahead_um=np.where(k, orders.step_um / 2, 0).astype(np.float32),
        matrices=orders.matrices[k].astype(np.float32),
        share=shares[np.abs(order), k].astype(np.float32),
        level=np.clip(np.floor(np.log2(apart) - 1), 0, len(map_.levels) - 1).astype(np.int64),
        zeroth=np.einsum("kd,kij->dij", shares[0], orders.matrices).astype(np.float32),
        normal_reflectance=orders.normal_reflectance,
    )


def shade_rows(
    rgb: Float32Array,
    span: tuple[int, int],
    gratings: Float32Array,
    *,
    view: View,
    probe: Probe,
    map_: AreaMap,
    look_ups: LookUps,
    slopes: Float32Array | None = None,
) -> None:
    """Add the light that rows ``span`` of the picture get; as :func:`pipeline.optics.environment.delta.shade_rows`.

    Parameters
    ----------
    map_ : AreaMap
        Of the probe.
    look_ups : LookUps
        Which to do.
    rgb, span, gratings, view, probe, slopes
        As there.
    """
    _shade(
        rgb,
        span[0],
        span[1],
        gratings,
        np.zeros((2, 1, 1), np.float32) if slopes is None else slopes,
        slopes is None,
        view.homography,
        view.eye_mm,
        probe.rgb,
        probe.pose,
        map_.levels,
        _f(map_.reach),
        look_ups.order,
        look_ups.wavelength_um,
        look_ups.behind_um,
        look_ups.ahead_um,
        look_ups.matrices,
        look_ups.share,
        look_ups.level,
        look_ups.zeroth,
        _f(1 / look_ups.normal_reflectance - 1),
    )


@njit(nogil=True, cache=True, error_model="numpy")
def _shade(
    rgb: Any,
    first: int,
    last: int,
    gratings: Any,
    slopes: Any,
    flat: bool,
    hom: Any,
    eye: Any,
    probe: Any,
    pose: Any,
    levels: Any,
    reach: Any,
    order: Any,
    wavelength: Any,
    behind: Any,
    ahead: Any,
    matrices: Any,
    share: Any,
    level: Any,
    zeroth: Any,
    fresnel: Any,
) -> None:
    columns = gratings.shape[2]
    pixel = np.empty((_PARTS, _RUN), np.float32)
    found = np.empty((4, _RUN), np.float32)
    sums = np.empty((_RUN, 3), np.float32)
    which = np.empty(_RUN, np.int64)
    for row in range(first, last):
        for start in range(0, columns, _RUN):
            count = 0
            for column in range(start, min(start + _RUN, columns)):
                if not gratings[2, row, column] > 0:
                    continue
                z = hom[2, 0] * column + hom[2, 1] * row + hom[2, 2]
                x = (hom[0, 0] * column + hom[0, 1] * row + hom[0, 2]) / z
                y = (hom[1, 0] * column + hom[1, 1] * row + hom[1, 2]) / z
                ex, ey, ez = eye[0] - x, eye[1] - y, eye[2]
                length = 1 / np.sqrt(ex * ex + ey * ey + ez * ez)
                ex, ey, ez = ex * length, ey * length, ez * length
                p, q = (0.0, 0.0) if flat else (float(slopes[0, row, column]), float(slopes[1, row, column]))
                axes = frame(float(gratings[0, row, column]), float(gratings[1, row, column]), p, q)
                cos_eye = ex * axes[6] + ey * axes[7] + ez * axes[8]
                if cos_eye <= 0:
                    continue
                u = -(ex * axes[0] + ey * axes[1] + ez * axes[2])
                v = -(ex * axes[3] + ey * axes[4] + ez * axes[5])
                pixel[_U, count], pixel[_V, count], pixel[_EYE, count] = u, v, cos_eye
                pixel[_INVERSE, count] = 1 / gratings[2, row, column]
                pixel[_T, count], pixel[_T + 1, count], pixel[_T + 2, count] = axes[0], axes[1], axes[2]
                pixel[_B, count], pixel[_B + 1, count], pixel[_B + 2, count] = axes[3], axes[4], axes[5]
                pixel[_N, count], pixel[_N + 1, count], pixel[_N + 2, count] = axes[6], axes[7], axes[8]
                which[count] = column
                _mirrored(sums[count], pixel[:, count], probe, pose, zeroth, fresnel)
                count += 1
            for k in range(order.size):
                place_look_ups(found, pixel, count, order[k], wavelength[k], behind[k], ahead[k], fresnel, reach)
                _fetch(sums, found, count, levels[level[k]], share[k], matrices[k], _f(0.5) / reach)
            for j in range(count):
                for i in range(3):
                    rgb[row, which[j], i] += sums[j, i]


@njit(nogil=True, cache=True, error_model="numpy")
def _mirrored(out: Any, pixel: Any, probe: Any, pose: Any, zeroth: Any, fresnel: Any) -> None:
    u, v, c = pixel[_U], pixel[_V], pixel[_EYE]
    r, g, b = look_up(
        probe,
        pose,
        u * pixel[_T] + v * pixel[_B] + c * pixel[_N],
        u * pixel[_T + 1] + v * pixel[_B + 1] + c * pixel[_N + 1],
        u * pixel[_T + 2] + v * pixel[_B + 2] + c * pixel[_N + 2],
    )
    at = c * (zeroth.shape[0] - 1)
    node = min(int(at), zeroth.shape[0] - 2)
    rest = at - node
    gain = 1 + fresnel * (1 - c) ** 5
    for i in range(3):
        near = zeroth[node, i, 0] * r + zeroth[node, i, 1] * g + zeroth[node, i, 2] * b
        far = zeroth[node + 1, i, 0] * r + zeroth[node + 1, i, 1] * g + zeroth[node + 1, i, 2] * b
        out[i] = gain * ((1 - rest) * near + rest * far)


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz", "reassoc", "arcp"})
def place_look_ups(
    found: Any, pixel: Any, count: int, order: Any, wavelength: Any, behind: Any, ahead: Any, fresnel: Any, reach: Any
) -> None:
    """Where a run of pixels looks up an order and a wavelength, and how much of it they take."""
    for j in range(count):
        u0, v, cos_eye = pixel[_U, j], pixel[_V, j], pixel[_EYE, j]
        slope = order * pixel[_INVERSE, j]
        square = _f(1) - v * v
        half = abs(slope) * (behind + ahead) * _f(0.5)
        u = u0 + slope * wavelength
        rim = np.sqrt(square)
        u = min(max(u, -rim), rim)
        height = max(square - u * u, _f(0))
        cos_light = np.sqrt(height)
        w = cos_light + cos_eye
        between = cos_light * cos_eye - u * u0 - v * v
        bend = _f(1) - np.sqrt(_f(0.5) * (_f(1) + between))
        twice = bend * bend
        gain = (_f(1) + between) / w
        gain *= gain * (_f(1) + fresnel * twice * twice * bend) / cos_eye
        x = u * pixel[_T, j] + v * pixel[_B, j] + cos_light * pixel[_N, j]
        y = u * pixel[_T + 1, j] + v * pixel[_B + 1, j] + cos_light * pixel[_N + 1, j]
        z = u * pixel[_T + 2, j] + v * pixel[_B + 2, j] + cos_light * pixel[_N + 2, j]
        scale = _f(1) / np.sqrt(max(_f(1) + z, _f(1e-6)))
        found[_COLUMN, j], found[_ROW, j] = x * scale + reach, y * scale + reach
        found[_SHARE, j] = w * _f(0.5 * (_NODES - 1))
        far = height > _NEAR_RIM * (abs(u) + half) * half
        found[_GAIN, j] = gain / cos_light if far else -gain
    for j in range(count):
        if found[_GAIN, j] < 0:
            slope = order * pixel[_INVERSE, j]
            rim = np.sqrt(_f(1) - pixel[_V, j] * pixel[_V, j])
            low = pixel[_U, j] + slope * (wavelength - ahead)
            high = pixel[_U, j] + slope * (wavelength + behind)
            low, high = min(max(low / rim, _f(-1)), _f(1)), min(max(high / rim, _f(-1)), _f(1))
            inverse = (np.arcsin(high) - np.arcsin(low)) / (slope * (behind + ahead))
            found[_GAIN, j] = -found[_GAIN, j] * inverse


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz", "reassoc", "arcp"})
def _fetch(sums: Any, found: Any, count: int, texels: Any, share: Any, matrix: Any, per_side: Any) -> None:
    size = texels.shape[0]
    scale = per_side * _f(size)
    last = _f(size) - _f(1.001)
    for j in range(count):
        gain = found[_GAIN, j]
        if gain == 0:
            continue
        at = found[_SHARE, j]
        node = min(int(at), _NODES - 2)
        gain *= share[node] + (at - _f(node)) * (share[node + 1] - share[node])
        row = min(max(found[_ROW, j] * scale - _f(0.5), _f(0)), last)
        column = min(max(found[_COLUMN, j] * scale - _f(0.5), _f(0)), last)
        r, c = int(row), int(column)
        dr, dc = row - _f(r), column - _f(c)
        a, b = gain * (_f(1) - dr) * (_f(1) - dc), gain * (_f(1) - dr) * dc
        d, e = gain * dr * (_f(1) - dc), gain * dr * dc
        one, two, three, four = texels[r, c], texels[r, c + 1], texels[r + 1, c], texels[r + 1, c + 1]
        red = a * one[0] + b * two[0] + d * three[0] + e * four[0]
        green = a * one[1] + b * two[1] + d * three[1] + e * four[1]
        blue = a * one[2] + b * two[2] + d * three[2] + e * four[2]
        sums[j, 0] += matrix[0, 0] * red + matrix[0, 1] * green + matrix[0, 2] * blue
        sums[j, 1] += matrix[1, 0] * red + matrix[1, 1] * green + matrix[1, 2] * blue
        sums[j, 2] += matrix[2, 0] * red + matrix[2, 1] * green + matrix[2, 2] * blue
