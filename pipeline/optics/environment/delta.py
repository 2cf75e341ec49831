"""The reference: each order and wavelength shows the one direction that it sends to the eye, in double precision.

With the coherence window taken as infinitely wide, order m of wavelength ``lambda`` comes from the direction whose
components in the sheet are ``-omega_o + (m lambda / a) t``, and the radiance is the sum over orders and wavelengths of

    share_m(k w h0) F (1 + i . r)^2 / (cos_i cos_r w^2) C_lambda L(omega_i),

C the colour matrix of a wavelength. Towards grazing light ``1 / cos_i`` grows without limit, but its integral over the
wavelength does not: each wavelength stands for the cell around it, over which ``1 / cos_i`` is averaged in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.compiled import njit
from pipeline.optics.environment.probe import Probe, look_up
from pipeline.optics.environment.spectrum import colour_matrices
from pipeline.optics.gratings import Form, efficiencies
from pipeline.optics.sheet.view import View

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

_DEPTH_STEPS, _DEPTH_STEP = 1024, 0.03
_SHALLOWEST = 1e-6
_LARGEST_SINE_SUM = 2.0
_NEGLIGIBLE = 1e-7
_SMALLEST = 1e-15


@dataclass(frozen=True)
class Orders:
    """What does not depend on the pixel.

    Attributes
    ----------
    wavelength_um : ndarray of shape (W,)
        Wavelengths, evenly spaced.
    matrices : ndarray of shape (W, 3, 3)
        What each makes of a probe's colour.
    share : ndarray of shape (M + 1, D)
        Of orders 0 to M over phase depth, evenly spaced from 0.
    per_phase : float
        Nodes of ``share`` in a unit of phase depth ``k w h0``.
    depth_um : float
        Of the gratings, from crest to trough.
    normal_reflectance : float
        At normal incidence, for Schlick's reflectance relative to it; 1 for a mirror.
    """

    wavelength_um: Float64Array
    matrices: Float64Array
    share: Float64Array
    per_phase: float
    depth_um: float
    normal_reflectance: float = 1.0

    @property
    def step_um(self) -> float:
        """Distance of the wavelengths."""
        return float(self.wavelength_um[1] - self.wavelength_um[0])


def tabulated_orders(
    *,
    wavelength_step_nm: float,
    depth_um: float,
    longest_period_um: float,
    form: Form = "exact",
    normal_reflectance: float = 1.0,
) -> Orders:
    """Wavelengths, and the shares of all orders that light of any direction has, but what is negligible."""
    nodes, matrices = colour_matrices(wavelength_step_nm)
    wavelength = nodes / 1000
    highest = int(longest_period_um * _LARGEST_SINE_SUM / wavelength[0])
    deepest = max(float(4 * np.pi / wavelength[0] * depth_um), _SHALLOWEST)
    phases = np.linspace(0, deepest, max(_DEPTH_STEPS, int(deepest / _DEPTH_STEP)))
    share = efficiencies(form, np.arange(highest + 1)[:, None], phases)
    seen = int(np.flatnonzero(share.max(axis=1) > _NEGLIGIBLE)[-1])
    return Orders(
        wavelength,
        matrices,
        share[: seen + 1],
        (len(phases) - 1) / deepest,
        depth_um,
        normal_reflectance,
    )


def shade_rows(
    rgb: Float32Array,
    span: tuple[int, int],
    gratings: Float32Array,
    *,
    view: View,
    probe: Probe,
    orders: Orders,
    slopes: Float32Array | None = None,
) -> None:
    """Add the light that rows ``span`` of the picture get from the sheet; releases the interpreter lock.

    Parameters
    ----------
    rgb : ndarray of shape (M, N, 3), float32
        Where the radiance goes, linear sRGB in the probe's unit.
    span : tuple of int
        First row, and the row after the last.
    gratings : ndarray of shape (3, M, N), float32
        What each pixel shows: cosine and sine of the orientation and period in um, all 0 or NaN where there is none.
    view : View
        Of M by N pixels.
    probe : Probe
        What is seen from the sheet.
    orders : Orders
        From :func:`tabulated_orders`.
    slopes : ndarray of shape (2, M, N), float32, optional
        dz/dx and dz/dy of the sheet: they tilt its normal, and with it tangent and bitangent.
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
        orders.wavelength_um,
        orders.matrices,
        orders.share,
        orders.per_phase,
        orders.depth_um,
        orders.normal_reflectance,
    )


@njit(nogil=True, cache=True, error_model="numpy")
def geometry(between: float, w: float, normal_reflectance: float) -> float:
    """Stam's factor without both cosines, times Schlick's reflectance relative to that at normal incidence."""
    facing = max(1 + between, 0.0)
    bend = 1 - np.sqrt(0.5 * facing)
    return (1 + (1 / normal_reflectance - 1) * bend**5) * (facing / w) ** 2


@njit(nogil=True, cache=True, error_model="numpy")
def frame(theta_cos: float, theta_sin: float, p: float, q: float) -> tuple[float, ...]:
    """Tangent, bitangent and normal of a grating on a sheet with slopes p and q."""
    nz = 1 / np.sqrt(1 + p * p + q * q)
    nx, ny = -p * nz, -q * nz
    tz = p * theta_cos + q * theta_sin
    length = 1 / np.sqrt(1 + tz * tz)
    tx, ty, tz = theta_cos * length, theta_sin * length, tz * length
    return tx, ty, tz, ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx, nx, ny, nz


@njit(nogil=True, cache=True, error_model="numpy")
def _between_nodes(share: Any, order: int, position: float) -> float:
    node = min(int(position), share.shape[1] - 2)
    rest = position - node
    return share[order, node] * (1 - rest) + share[order, node + 1] * rest


@njit(nogil=True, cache=True, error_model="numpy")
def _add(sums: Any, part: float, matrix: Any, red: float, green: float, blue: float) -> None:
    for i in range(3):
        sums[i] += part * (matrix[i, 0] * red + matrix[i, 1] * green + matrix[i, 2] * blue)


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
    texels: Any,
    pose: Any,
    wavelength: Any,
    matrices: Any,
    share: Any,
    per_phase: float,
    depth: float,
    normal_reflectance: float,
) -> None:
    step = wavelength[1] - wavelength[0]
    phase = 2 * np.pi * depth * per_phase
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
            u0 = -(ex * tx + ey * ty + ez * tz)
            v = -(ex * bx + ey * by + ez * bz)
            cos_eye = ex * nx + ey * ny + ez * nz
            if not cos_eye > 0:
                continue
            radius = np.sqrt(max(1 - v * v, _SMALLEST))
            gain = 1 + (1 / normal_reflectance - 1) * (1 - cos_eye) ** 5
            r, g, b = look_up(
                texels,
                pose,
                u0 * tx + v * bx + cos_eye * nx,
                u0 * ty + v * by + cos_eye * ny,
                u0 * tz + v * bz + cos_eye * nz,
            )
            sums[:] = 0
            for k in range(wavelength.size):
                part = gain * _between_nodes(share, 0, phase * 2 * cos_eye / wavelength[k])
                _add(sums, part, matrices[k], r, g, b)
            for order in range(-(share.shape[0] - 1), share.shape[0]):
                if order == 0:
                    continue
                slope = order / a
                # Angles of the ends of the cell around a wavelength, in the plane of its light, not below the horizon.
                start = np.arcsin(min(max((u0 + slope * wavelength[0]) / radius, -1.0), 1.0))
                for k in range(wavelength.size):
                    behind = 0.5 * step if k + 1 < wavelength.size else 0.0
                    ahead = 0.5 * step if k else 0.0
                    end = np.arcsin(min(max((u0 + slope * (wavelength[k] + behind)) / radius, -1.0), 1.0))
                    inverse = (end - start) / (slope * (behind + ahead))
                    start = end
                    if inverse == 0:
                        continue
                    u = min(max(u0 + slope * wavelength[k], -radius), radius)
                    cos_light = np.sqrt(radius * radius - u * u)
                    w = cos_light + cos_eye
                    part = _between_nodes(share, abs(order), phase * w / wavelength[k]) * inverse / cos_eye
                    part *= geometry(cos_light * cos_eye - u * u0 - v * v, w, normal_reflectance)
                    r, g, b = look_up(
                        texels,
                        pose,
                        u * tx + v * bx + cos_light * nx,
                        u * ty + v * by + cos_light * ny,
                        u * tz + v * bz + cos_light * nz,
                    )
                    _add(sums, part, matrices[k], r, g, b)
            for i in range(3):
                rgb[row, column, i] += sums[i]
