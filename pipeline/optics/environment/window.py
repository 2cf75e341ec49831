"""Brute force: the sum over all texels of a probe of their light times the BRDF in the Gaussian coherence window.

The BRDF is that of :mod:`pipeline.optics.grating_brdf`. It costs milliseconds a pixel and shows what the delta response
leaves out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.compiled import njit
from pipeline.optics.environment.delta import Orders, frame, geometry
from pipeline.optics.environment.probe import Probe, solid_angles, texel_directions
from pipeline.optics.gratings import window_spread
from pipeline.optics.sheet.view import View

Float32Array = NDArray[np.float32]

_REACH = 4.5
"""Standard deviations beyond which a lobe is left out: 4e-5 of its peak."""
_WIDTHS_APART = 1.5
"""Distance of directions in standard deviations of the narrowest lobe, at which their sum is right to 3e-4."""
_MOST_LIGHTS = 40_000_000


@dataclass(frozen=True, eq=False)
class Lights:
    """All of a probe as many distant lights.

    Attributes
    ----------
    towards : ndarray of shape (K, 3), float32
        In the sheet's frame.
    rgb : ndarray of shape (K, 3), float32
        Radiance times solid angle.
    """

    towards: Float32Array
    rgb: Float32Array


def lights_of(probe: Probe, coherence_um: float, shortest_um: float, *, all_around: bool = False) -> Lights:
    """Cut texels, between whose middles the probe is bilinear, into parts that are small against every lobe.

    Parameters
    ----------
    probe : Probe
        The light.
    coherence_um : float
        Width of the window.
    shortest_um : float
        The shortest wavelength.
    all_around : bool
        Keep what lies behind the sheet, which a sheet with bumps may see.

    Raises
    ------
    ValueError
        There would be too many parts.
    """
    narrowest = float(window_spread(shortest_um, coherence_um))
    parts = max(1, int(np.ceil(probe.texel_rad / (_WIDTHS_APART * narrowest))))
    rows, columns = probe.rgb.shape[0] * parts, probe.rgb.shape[1] * parts
    if rows * columns > _MOST_LIGHTS:
        raise ValueError(f"a window of {coherence_um:g} um takes {rows * columns:.2g} lights")
    towards = texel_directions(rows, columns) @ probe.pose
    angles = np.broadcast_to(solid_angles(rows, columns)[:, None], (rows, columns))
    kept = np.full((rows, columns), True) if all_around else towards[..., 2] > 0
    rgb = probe.radiance(towards[kept]) * angles[kept][:, None]
    return Lights(towards[kept].astype(np.float32), rgb.astype(np.float32))


def shade_rows(
    rgb: Float32Array,
    span: tuple[int, int],
    gratings: Float32Array,
    *,
    view: View,
    lights: Lights,
    orders: Orders,
    coherence_um: float,
    slopes: Float32Array | None = None,
) -> None:
    """Add the light that rows ``span`` of the picture get; as :func:`pipeline.optics.environment.delta.shade_rows`."""
    _shade(
        rgb,
        span[0],
        span[1],
        gratings,
        np.zeros((2, 1, 1), np.float32) if slopes is None else slopes,
        slopes is None,
        view.homography,
        view.eye_mm,
        lights.towards,
        lights.rgb,
        orders.wavelength_um,
        window_spread(orders.wavelength_um, coherence_um),
        orders.matrices,
        orders.share,
        orders.per_phase,
        orders.depth_um,
        orders.normal_reflectance,
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
    towards: Any,
    light: Any,
    wavelength: Any,
    spread: Any,
    matrices: Any,
    share: Any,
    per_phase: float,
    depth: float,
    normal_reflectance: float,
) -> None:
    count = wavelength.size
    step = wavelength[1] - wavelength[0]
    phase = 2 * np.pi * depth * per_phase
    reach = _REACH * spread[count - 1]
    sums = np.empty(3)
    for row in range(first, last):
        for column in range(gratings.shape[2]):
            a = float(gratings[2, row, column])
            if not a > 0:
                continue
            z = hom[2, 0] * column + hom[2, 1] * row + hom[2, 2]
            x = (hom[0, 0] * column + hom[0, 1] * row + hom[0, 2]) / z
            y = (hom[1, 0] * column + hom[1, 1] * row + hom[1, 2]) / z
            ex, ey, ez = eye[0] - x, eye[1] - y, eye[2]
            length = np.sqrt(ex * ex + ey * ey + ez * ez)
            ex, ey, ez = ex / length, ey / length, ez / length
            p, q = (0.0, 0.0) if flat else (float(slopes[0, row, column]), float(slopes[1, row, column]))
            cosine, sine = float(gratings[0, row, column]), float(gratings[1, row, column])
            tx, ty, tz, bx, by, bz, nx, ny, nz = frame(cosine, sine, p, q)
            eye_u, eye_v = ex * tx + ey * ty + ez * tz, ex * bx + ey * by + ez * bz
            cos_eye = ex * nx + ey * ny + ez * nz
            if not cos_eye > 0:
                continue
            sums[:] = 0
            for one in range(len(towards)):
                lx, ly, lz = float(towards[one, 0]), float(towards[one, 1]), float(towards[one, 2])
                v = eye_v + lx * bx + ly * by + lz * bz
                if abs(v) > reach:
                    continue
                cos_light = lx * nx + ly * ny + lz * nz
                if cos_light <= 0:
                    continue
                u = abs(eye_u + lx * tx + ly * ty + lz * tz)
                w = cos_light + cos_eye
                gain = geometry(lx * ex + ly * ey + lz * ez, w, normal_reflectance) / cos_eye
                for order in range(1 - share.shape[0], share.shape[0]):
                    low, high = 0, count - 1
                    if order == 0 and u > reach:
                        continue
                    if order:
                        side = reach if order > 0 else -reach
                        low = max(0, int(np.ceil(((u - side) * a / order - wavelength[0]) / step)))
                        high = min(count - 1, int(np.floor(((u + side) * a / order - wavelength[0]) / step)))
                    for k in range(low, high + 1):
                        away = u - order * wavelength[k] / a
                        square = spread[k] * spread[k]
                        lobe = np.exp(-0.5 * (away * away + v * v) / square) / (2 * np.pi * square)
                        position = phase * w / wavelength[k]
                        node = min(int(position), share.shape[1] - 2)
                        rest = position - node
                        part = share[abs(order), node] * (1 - rest) + share[abs(order), node + 1] * rest
                        value = gain * lobe * part
                        for i in range(3):
                            for j in range(3):
                                sums[i] += value * matrices[k, i, j] * light[one, j]
            for i in range(3):
                rgb[row, column, i] += sums[i]
