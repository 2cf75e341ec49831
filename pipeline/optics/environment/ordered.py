"""The fast evaluator: look-ups in an equal-area map, the most important ones first, in short runs of pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.compiled import njit
from pipeline.optics.environment.area_map import AreaMap
from pipeline.optics.environment.delta import Orders, frame
from pipeline.optics.environment.probe import Probe, look_up
from pipeline.optics.sheet.view import View

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

_RUN = 128
_NODES = 129
_X, _Y, _KX, _KY, _EYE, _AXES, _PARTS = 0, 1, 2, 3, 4, 5, 14
"""Of a pixel: where its mirror looks, the grating's lines per um along both axes of the sheet's own frame, the cosine
towards the eye, and that frame."""
_ROW, _COLUMN, _GAIN, _W, _FOUND = range(5)
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
    order = np.repeat(np.array([m for m in range(-highest, highest + 1) if m], np.int64), count)
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
    found = np.empty((_FOUND, _RUN), np.float32)
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
                axes = frame(1.0, 0.0, p, q)
                cos_eye = ex * axes[6] + ey * axes[7] + ez * axes[8]
                if not cos_eye > 0:
                    continue
                tangent = frame(float(gratings[0, row, column]), float(gratings[1, row, column]), p, q)
                along = tangent[0] * axes[0] + tangent[1] * axes[1] + tangent[2] * axes[2]
                across = tangent[0] * axes[3] + tangent[1] * axes[4] + tangent[2] * axes[5]
                pixel[_X, count] = -(ex * axes[0] + ey * axes[1] + ez * axes[2])
                pixel[_Y, count] = -(ex * axes[3] + ey * axes[4] + ez * axes[5])
                lines = 1 / float(gratings[2, row, column])
                pixel[_KX, count], pixel[_KY, count] = along * lines, across * lines
                pixel[_EYE, count] = cos_eye
                for i in range(9):
                    pixel[_AXES + i, count] = axes[i]
                which[count] = column
                _mirrored(sums[count], pixel[:, count], probe, pose, zeroth, fresnel)
                count += 1
            for k in range(order.size):
                _diffract(found, pixel, count, order[k], wavelength[k], behind[k], ahead[k], fresnel)
                _fetch(sums, found, pixel, count, flat, levels[level[k]], share[k], matrices[k], reach)
            for j in range(count):
                for i in range(3):
                    rgb[row, which[j], i] += sums[j, i]


@njit(nogil=True, cache=True, error_model="numpy")
def _mirrored(out: Any, pixel: Any, probe: Any, pose: Any, zeroth: Any, fresnel: Any) -> None:
    x, y, c, axes = pixel[_X], pixel[_Y], pixel[_EYE], pixel[_AXES:]
    r, g, b = look_up(
        probe,
        pose,
        x * axes[0] + y * axes[3] + c * axes[6],
        x * axes[1] + y * axes[4] + c * axes[7],
        x * axes[2] + y * axes[5] + c * axes[8],
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
def _diffract(
    found: Any, pixel: Any, count: int, order: Any, wavelength: Any, behind: Any, ahead: Any, fresnel: Any
) -> None:
    """Where a run of pixels looks up an order and a wavelength, in the sheet's own frame, and how much they take."""
    shift, reaches = order * wavelength, abs(order) * (behind + ahead) * _f(0.5)
    x0, y0, kx, ky, eye = pixel[_X], pixel[_Y], pixel[_KX], pixel[_KY], pixel[_EYE]
    for j in range(count):
        x, y, cos_eye = x0[j] + shift * kx[j], y0[j] + shift * ky[j], eye[j]
        square = x * x + y * y
        height = _f(1) - square
        # Cells that reach over the horizon with an end stand for light from the horizon.
        to_rim = _f(1) / np.sqrt(max(square, _f(1)))
        x, y = x * to_rim, y * to_rim
        cos_light = np.sqrt(max(height, _f(1e-12)))
        w = cos_light + cos_eye
        between = cos_light * cos_eye - x * x0[j] - y * y0[j]
        facing = max(_f(1) + between, _f(0))
        bend = _f(1) - np.sqrt(_f(0.5) * facing)
        twice = bend * bend
        gain = facing / w
        gain *= gain * (_f(1) + fresnel * twice * twice * bend) / cos_eye
        half = reaches * np.sqrt(kx[j] * kx[j] + ky[j] * ky[j])
        far = height > _f(_NEAR_RIM) * (_f(1) + half) * half
        found[_COLUMN, j], found[_ROW, j], found[_W, j] = x, y, w
        found[_GAIN, j] = gain / cos_light if far else -gain
    for j in range(count):
        if found[_GAIN, j] < 0:
            inverse = np.sqrt(kx[j] * kx[j] + ky[j] * ky[j])
            u = (x0[j] * kx[j] + y0[j] * ky[j]) / inverse
            v = (y0[j] * kx[j] - x0[j] * ky[j]) / inverse
            rim = np.sqrt(max(_f(1) - v * v, _f(1e-7)))
            slope = order * inverse
            low = min(max((u + slope * (wavelength - ahead)) / rim, _f(-1)), _f(1))
            high = min(max((u + slope * (wavelength + behind)) / rim, _f(-1)), _f(1))
            found[_GAIN, j] *= (np.arcsin(low) - np.arcsin(high)) / (slope * (behind + ahead))


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz", "reassoc", "arcp"})
def _fetch(
    sums: Any, found: Any, pixel: Any, count: int, flat: bool, texels: Any, share: Any, matrix: Any, reach: Any
) -> None:
    size = texels.shape[0]
    scale = _f(0.5) * _f(size) / reach
    last = _f(size) - _f(1.001)
    for j in range(count):
        gain = found[_GAIN, j]
        if gain == 0:
            continue
        at = found[_W, j] * _f(0.5 * (_NODES - 1))
        node = min(int(at), _NODES - 2)
        gain *= share[node] + (at - _f(node)) * (share[node + 1] - share[node])
        x, y = found[_COLUMN, j], found[_ROW, j]
        z = found[_W, j] - pixel[_EYE, j]
        if not flat:
            axes = pixel[_AXES:, j]
            x, y, z = (
                x * axes[0] + y * axes[3] + z * axes[6],
                x * axes[1] + y * axes[4] + z * axes[7],
                x * axes[2] + y * axes[5] + z * axes[8],
            )
        to_map = _f(1) / np.sqrt(max(_f(1) + z, _f(1e-6)))
        row = min(max((y * to_map + reach) * scale - _f(0.5), _f(0)), last)
        column = min(max((x * to_map + reach) * scale - _f(0.5), _f(0)), last)
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
