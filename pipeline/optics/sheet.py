"""A flat sheet of sinusoidal gratings under a small light, seen by a camera, integrated over the spectrum.

The sheet lies in the plane z = 0: x right, y up, z towards the camera, origin at its centre, lengths in mm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.optics.colour import Spectrum, white_balanced_weights
from pipeline.optics.gratings import Form, efficiencies, highest_order, window_spread

Float64Array = NDArray[np.float64]

REACH = 4.0
"""Standard deviations beyond which a lobe counts as dark: 3e-4 of its peak."""
_DEPTH_STEPS = 1024


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
    """

    wavelength_um: Float64Array
    weights: Float64Array
    spread: Float64Array
    efficiency: Float64Array
    deepest: float
    depth_um: float


def spectral_table(
    *,
    light: Spectrum,
    wavelength_step_nm: float,
    coherence_um: float,
    depth_um: float,
    longest_period_um: float,
    largest_half_vector: float,
    orders: Form = "exact",
) -> SpectralTable:
    """Tabulate everything that does not depend on the pixel; orders up to the highest that can be seen."""
    wavelength_nm, weights = white_balanced_weights(light, wavelength_step_nm)
    wavelength = wavelength_nm / 1000
    deepest = float(2 * np.pi / wavelength[0] * 2 * depth_um)
    count = highest_order(longest_period_um, float(wavelength[0]), largest_half_vector) + 1
    depths = np.linspace(0, deepest, _DEPTH_STEPS)
    return SpectralTable(
        wavelength_um=wavelength,
        weights=np.ascontiguousarray(weights * (0.55 / wavelength[:, None]) ** 2),
        spread=window_spread(wavelength, coherence_um),
        efficiency=efficiencies(orders, np.arange(count)[:, None], depths[None, :]),
        deepest=deepest,
        depth_um=depth_um,
    )


def largest_half_vector(light_mm: Float64Array, camera_mm: Float64Array, half_width_mm: float) -> float:
    """Largest in-plane length of the half vector anywhere on the sheet."""
    corners = half_width_mm * np.array([[1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]], dtype=np.float64)
    towards = [
        (point - corners) / np.linalg.norm(point - corners, axis=1, keepdims=True) for point in (light_mm, camera_mm)
    ]
    return float(np.linalg.norm((towards[0] + towards[1])[:, :2], axis=1).max())


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
    pixel_mm: float,
    light_mm: Float64Array,
    camera_mm: Float64Array,
    light_sigma_mm: float,
    table: SpectralTable,
) -> None:
    """Add the light that rows ``span`` of the sheet send to the camera; releases the interpreter lock.

    A light of Gaussian extent widens every lobe by its angular size, and lowers it so that its integral stays: the
    convolution of both Gaussians in the half vector's plane, where the light's obliquity is neglected.

    Parameters
    ----------
    rgb : ndarray of shape (M, N, 3), float32
        Where the radiance goes, linear sRGB, relative.
    span : tuple of int
        First row, and the row after the last.
    orientation_rad, period_um : ndarray of shape (M, N)
        The maps; NaN stays dark.
    pixel_mm : float
        Pitch of the maps.
    light_mm, camera_mm : ndarray of shape (3,)
        Positions.
    light_sigma_mm : float
        Standard deviation of the light's extent.
    table : SpectralTable
        From :func:`spectral_table`.
    """
    _shade(
        rgb,
        span[0],
        span[1],
        orientation_rad,
        period_um,
        pixel_mm,
        light_mm,
        camera_mm,
        light_sigma_mm,
        table.wavelength_um,
        table.weights,
        table.spread,
        table.efficiency,
        (table.efficiency.shape[1] - 1) / table.deepest,
        table.depth_um,
        REACH,
    )


@njit(nogil=True, cache=True, error_model="numpy")
def _shade(
    rgb: Any,
    first: int,
    last: int,
    orientation: Any,
    period: Any,
    pixel: float,
    light: Any,
    camera: Any,
    light_sigma: float,
    wavelength: Any,
    weights: Any,
    spread: Any,
    efficiency: Any,
    depth_scale: float,
    depth: float,
    reach: float,
) -> None:
    rows, columns = orientation.shape
    count = wavelength.size
    step = (wavelength[count - 1] - wavelength[0]) / (count - 1)
    widest = spread[count - 1]
    for row in range(first, last):
        y = (0.5 * (rows - 1) - row) * pixel
        for column in range(columns):
            theta = orientation[row, column]
            a = period[row, column]
            if not (np.isfinite(theta) and a > 0):
                continue
            x = (column - 0.5 * (columns - 1)) * pixel
            lx, ly, lz = light[0] - x, light[1] - y, light[2]
            cx, cy, cz = camera[0] - x, camera[1] - y, camera[2]
            light_distance = np.sqrt(lx * lx + ly * ly + lz * lz)
            camera_distance = np.sqrt(cx * cx + cy * cy + cz * cz)
            lx, ly, lz = lx / light_distance, ly / light_distance, lz / light_distance
            cx, cy, cz = cx / camera_distance, cy / camera_distance, cz / camera_distance
            c, s = np.cos(theta), np.sin(theta)
            u = abs((lx + cx) * c + (ly + cy) * s)
            v = (ly + cy) * c - (lx + cx) * s
            light_variance = (light_sigma / light_distance) ** 2
            if v * v > reach * reach * (widest * widest + light_variance):
                continue
            w = lz + cz
            between = lx * cx + ly * cy + lz * cz
            # Stam's factor, times the cosine of the light's incidence, times the inverse square of its distance.
            geometry = (1 + between) ** 2 / (cz * w * w) * (500.0 / light_distance) ** 2
            reach_u = np.sqrt(reach * reach * (widest * widest + light_variance) - v * v)
            red = green = blue = 0.0
            for order in range(efficiency.shape[0]):
                low, high = 0, count - 1
                if order == 0 and u > reach_u:
                    continue
                if order:
                    low = max(0, int(((u - reach_u) * a / order - wavelength[0]) / step))
                    high = min(count - 1, int(((u + reach_u) * a / order - wavelength[0]) / step) + 1)
                for i in range(low, high + 1):
                    variance = spread[i] * spread[i] + light_variance
                    away = u - order * wavelength[i] / a
                    lobe = np.exp(-0.5 * (away * away + v * v) / variance) * (spread[i] * spread[i] / variance)
                    position = 2 * np.pi / wavelength[i] * w * depth * depth_scale
                    node = min(int(position), efficiency.shape[1] - 2)
                    part = position - node
                    share = efficiency[order, node] * (1 - part) + efficiency[order, node + 1] * part
                    value = lobe * share
                    red += value * weights[i, 0]
                    green += value * weights[i, 1]
                    blue += value * weights[i, 2]
            rgb[row, column, 0] += geometry * red
            rgb[row, column, 1] += geometry * green
            rgb[row, column, 2] += geometry * blue
