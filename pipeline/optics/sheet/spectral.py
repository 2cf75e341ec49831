"""The reference: a sheet under a small light, summed over wavelengths and all orders in double precision."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.colour import Spectrum, filtered_weights, white_balanced_weights
from pipeline.optics.compiled import njit
from pipeline.optics.gratings import Form, efficiencies, highest_order, window_spread
from pipeline.optics.sheet.view import View

Float64Array = NDArray[np.float64]

REACH = 4.0
"""Standard deviations beyond which a lobe counts as dark: 3e-4 of its peak."""
_DEPTH_STEPS, _DEPTH_STEP = 1024, 0.03
_SHALLOWEST = 1e-6


@dataclass(frozen=True)
class SpectralTable:
    """What a pixel's colour is summed from.

    Attributes
    ----------
    wavelength_um : ndarray of shape (W,)
        Wavelengths.
    weights : ndarray of shape (W, 3)
        Contribution of each to linear sRGB, the factor 1 / lambda^2 of diffraction relative to 550 nm included.
    spread : ndarray of shape (W,)
        Standard deviation of an order through the coherence window.
    efficiency : ndarray of shape (orders, D)
        Share of each order over phase depth, from 0 to ``deepest``.
    deepest : float
        Largest phase depth ``k w h0`` of the table.
    depth_um : float
        Peak-to-valley depth of the gratings.
    normal_reflectance : float
        At normal incidence, for Schlick's reflectance relative to it; 1 for a mirror.
    """

    wavelength_um: Float64Array
    weights: Float64Array
    spread: Float64Array
    efficiency: Float64Array
    deepest: float
    depth_um: float
    normal_reflectance: float = 1.0


def spectral_table(
    *,
    light: Spectrum,
    wavelength_step_nm: float,
    coherence_um: float,
    depth_um: float,
    longest_period_um: float,
    largest_half_vector: float,
    orders: Form = "exact",
    normal_reflectance: float = 1.0,
    band_nm: tuple[float, float] | None = None,
) -> SpectralTable:
    """Tabulate everything that does not depend on the pixel; orders up to the highest that can be seen.

    ``band_nm`` is the centre and the full width at half maximum of a filter before the camera.
    """
    if band_nm is None:
        wavelength_nm, weights = white_balanced_weights(light, wavelength_step_nm)
    else:
        wavelength_nm, weights = filtered_weights(light, wavelength_step_nm, *band_nm)
    wavelength = wavelength_nm / 1000
    deepest = max(float(2 * np.pi / wavelength[0] * 2 * depth_um), _SHALLOWEST)
    count = highest_order(longest_period_um, float(wavelength[0]), largest_half_vector) + 1
    depths = np.linspace(0, deepest, max(_DEPTH_STEPS, int(deepest / _DEPTH_STEP)))
    return SpectralTable(
        wavelength_um=wavelength,
        weights=np.ascontiguousarray(weights * (0.55 / wavelength[:, None]) ** 2),
        spread=window_spread(wavelength, coherence_um),
        efficiency=efficiencies(orders, np.arange(count)[:, None], depths[None, :]),
        deepest=deepest,
        depth_um=depth_um,
        normal_reflectance=normal_reflectance,
    )


def aliasing(wavelength_step_nm: float, shortest_period_um: float, spread: float) -> float:
    """Relative error of the spectral sum within a first-order lobe, by Poisson's formula ``2 exp(-2 pi^2 s^2)``.

    ``s`` is the lobe's standard deviation ``spread``, in the half vector's components, in units of the distance
    ``step / period`` of the lobes of neighbouring wavelengths.
    """
    steps = spread * shortest_period_um / (wavelength_step_nm / 1000)
    return float(2 * np.exp(-2 * np.pi**2 * steps**2))


def shade_rows(
    rgb: NDArray[np.float32],
    span: tuple[int, int],
    orientation_rad: NDArray[np.floating],
    period_um: NDArray[np.floating],
    *,
    view: View,
    light_mm: Float64Array,
    light_sigma_mm: float,
    table: SpectralTable,
    slopes: NDArray[np.float32] | None = None,
    pixel_part: float = 0.0,
) -> None:
    """Add the light that rows ``span`` of the picture get from the sheet; releases the interpreter lock.

    A light of Gaussian extent widens every lobe by its angular size, foreshortened along the tangent and across it, and
    lowers it so that its integral stays: the convolution of both Gaussians, where their correlation is neglected. So
    does the half vector's change within a pixel, as a Gaussian of the variance of a box.

    Parameters
    ----------
    rgb : ndarray of shape (M, N, 3), float32
        Where the radiance goes, linear sRGB, relative.
    span : tuple of int
        First row, and the row after the last.
    orientation_rad, period_um : ndarray of shape (M, N)
        What each pixel shows; NaN stays dark.
    view : View
        Of M by N pixels.
    light_mm : ndarray of shape (3,)
        Where the light is.
    light_sigma_mm : float
        Standard deviation of the light's extent.
    table : SpectralTable
        From :func:`spectral_table`.
    slopes : ndarray of shape (2, M, N), float32, optional
        dz/dx and dz/dy of the sheet: they tilt its normal, and with it tangent and bitangent.
    pixel_part : float
        Side of the area that a value stands for, in pixels; 0 for a point.
    """
    flat = slopes is None
    _shade(
        rgb,
        span[0],
        span[1],
        orientation_rad,
        period_um,
        np.zeros((2, 1, 1), np.float32) if slopes is None else slopes,
        flat,
        view.homography,
        view.eye_mm,
        light_mm,
        light_sigma_mm,
        pixel_part,
        table.wavelength_um,
        table.weights,
        table.spread,
        table.efficiency,
        (table.efficiency.shape[1] - 1) / table.deepest,
        table.depth_um,
        table.normal_reflectance,
        REACH,
    )


@njit(nogil=True, cache=True, error_model="numpy")
def _shade(
    rgb: Any,
    first: int,
    last: int,
    orientation: Any,
    period: Any,
    slopes: Any,
    flat: bool,
    homography: Any,
    eye: Any,
    light: Any,
    light_sigma: float,
    part: float,
    wavelength: Any,
    weights: Any,
    spread: Any,
    efficiency: Any,
    depth_scale: float,
    depth: float,
    normal_reflectance: float,
    reach: float,
) -> None:
    count = wavelength.size
    step = (wavelength[count - 1] - wavelength[0]) / (count - 1)
    widest = spread[count - 1]
    hom = homography
    for row in range(first, last):
        for column in range(orientation.shape[1]):
            theta = float(orientation[row, column])
            a = float(period[row, column])
            if not (np.isfinite(theta) and a > 0):
                continue
            z = hom[2, 0] * column + hom[2, 1] * row + hom[2, 2]
            x = (hom[0, 0] * column + hom[0, 1] * row + hom[0, 2]) / z
            y = (hom[1, 0] * column + hom[1, 1] * row + hom[1, 2]) / z
            lx, ly, lz = light[0] - x, light[1] - y, light[2]
            cx, cy, cz = eye[0] - x, eye[1] - y, eye[2]
            light_distance = np.sqrt(lx * lx + ly * ly + lz * lz)
            eye_distance = np.sqrt(cx * cx + cy * cy + cz * cz)
            lx, ly, lz = lx / light_distance, ly / light_distance, lz / light_distance
            cx, cy, cz = cx / eye_distance, cy / eye_distance, cz / eye_distance
            hx, hy, hz = lx + cx, ly + cy, lz + cz
            tx, ty, tz = np.cos(theta), np.sin(theta), 0.0
            bx, by, bz = -ty, tx, 0.0
            nx, ny, nz = 0.0, 0.0, 1.0
            if not flat:
                p, q = float(slopes[0, row, column]), float(slopes[1, row, column])
                nz = 1 / np.sqrt(1 + p * p + q * q)
                nx, ny = -p * nz, -q * nz
                tz = p * tx + q * ty
                length = np.sqrt(1 + tz * tz)
                tx, ty, tz = tx / length, ty / length, tz / length
                bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
            cos_light = lx * nx + ly * ny + lz * nz
            cos_eye = cx * nx + cy * ny + cz * nz
            if cos_light <= 0 or cos_eye <= 0:
                continue
            u = abs(hx * tx + hy * ty + hz * tz)
            v = hx * bx + hy * by + hz * bz
            w = cos_light + cos_eye
            on_tangent, on_bitangent = lx * tx + ly * ty + lz * tz, lx * bx + ly * by + lz * bz
            more_u = (1 - on_tangent**2) * (light_sigma / light_distance) ** 2
            more_v = (1 - on_bitangent**2) * (light_sigma / light_distance) ** 2
            if part > 0:
                for side in range(2):
                    ex = part * (hom[0, side] - x * hom[2, side]) / z
                    ey = part * (hom[1, side] - y * hom[2, side]) / z
                    by_light, by_eye = (lx * ex + ly * ey) / light_distance, (cx * ex + cy * ey) / eye_distance
                    across = 1 / light_distance + 1 / eye_distance
                    dx = lx * by_light + cx * by_eye - ex * across
                    dy = ly * by_light + cy * by_eye - ey * across
                    dz = lz * by_light + cz * by_eye
                    more_u += (dx * tx + dy * ty + dz * tz) ** 2 / 12
                    more_v += (dx * bx + dy * by + dz * bz) ** 2 / 12
            square_v = v * v * (widest * widest + more_u) / (widest * widest + more_v)
            within = reach * reach * (widest * widest + more_u)
            if square_v > within:
                continue
            between = lx * cx + ly * cy + lz * cz
            bend = 1 - np.sqrt(0.5 * (1 + between))
            fresnel = 1 + (1 / normal_reflectance - 1) * bend**5
            # Stam's factor, times the cosine of the light's incidence, times the inverse square of its distance.
            geometry = fresnel * (1 + between) ** 2 / (cos_eye * w * w) * (500.0 / light_distance) ** 2
            reach_u = np.sqrt(within - square_v)
            red = green = blue = 0.0
            for order in range(1 - efficiency.shape[0], efficiency.shape[0]):
                low, high = 0, count - 1
                if (order == 0 and u > reach_u) or (order < 0 and (reach_u - u) * a < -order * wavelength[0]):
                    continue
                if order:
                    side = reach_u if order > 0 else -reach_u
                    low = max(0, int(((u - side) * a / order - wavelength[0]) / step))
                    high = min(count - 1, int(((u + side) * a / order - wavelength[0]) / step) + 1)
                for i in range(low, high + 1):
                    square = spread[i] * spread[i]
                    variance_u, variance_v = square + more_u, square + more_v
                    away = u - order * wavelength[i] / a
                    lobe = np.exp(-0.5 * (away * away / variance_u + v * v / variance_v))
                    lobe *= square / np.sqrt(variance_u * variance_v)
                    position = 2 * np.pi / wavelength[i] * w * depth * depth_scale
                    node = min(int(position), efficiency.shape[1] - 2)
                    rest = position - node
                    share = efficiency[abs(order), node] * (1 - rest) + efficiency[abs(order), node + 1] * rest
                    value = lobe * share
                    red += value * weights[i, 0]
                    green += value * weights[i, 1]
                    blue += value * weights[i, 2]
            rgb[row, column, 0] += geometry * red
            rgb[row, column, 1] += geometry * green
            rgb[row, column, 2] += geometry * blue
