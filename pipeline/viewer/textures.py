"""What the shader reads: coded maps, shares of orders over phase, and the spectrum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.colour import FIRST_NM, LAST_NM, Spectrum, white_balanced_weights
from pipeline.optics.gratings import efficiencies, highest_order, window_spread
from pipeline.viewer.scene import Scene

Uniform = float | list[float]

FINE_NM, COARSE_NM = 1.0, 20.0
_LARGEST_HALF_VECTOR = 2.0
_PHASE_STEP = 0.03
_NEGLIGIBLE = 1e-5
_MIDDLE_UM = 0.55
COLOURS = (705, 96)
"""Wavelengths and widths of the table of colours."""
_COLOUR_UM = (-0.6, 1.6)
_WIDTH_UM = (1e-3, 2.0)


@dataclass(frozen=True, eq=False)
class Textures:
    """All that stays as it is while light, eye and sliders move.

    Attributes
    ----------
    maps : ndarray of shape (M, N, 2), uint16
        Codes of orientation and period, from 1; 0 where nothing diffracts.
    shares : ndarray of shape (orders, D), float32
        Share of each order over the phase between crest and trough.
    spectrum : ndarray of shape (2, W, 4), float32
        Weights of linear sRGB, the factor 1 / lambda^2 of diffraction relative to 550 nm included: at the fine and at
        the coarse step.
    constants : dict
        Uniforms that tell the axes, by name.
    """

    maps: NDArray[np.uint16]
    shares: NDArray[np.float32]
    spectrum: NDArray[np.float32]
    constants: dict[str, Uniform]


def textures(scene: Scene, *, levels: int = 65535, deepest_um: float | None = None, stretch: float = 1.0) -> Textures:
    """Prepare a scene.

    Parameters
    ----------
    scene : Scene
        What is shown.
    levels : int
        Codes of a map besides the one for no grating, 2 to 65535.
    deepest_um, stretch : float
        Greatest depth, and factor to the periods, that a slider will ask for.
    """
    maps, coding = coded_maps(scene.orientation_rad, scene.period_um, levels)
    longest = float(np.nanmax(scene.period_um, initial=0.0)) * stretch
    shares, scale = _shares(max(deepest_um or 0.0, scene.depth_um), longest)
    return Textures(
        maps,
        shares,
        _spectrum(scene.illuminant),
        {
            "coding": coding,
            "pixel_mm": scene.pixel_mm,
            "tiles": [float(count) for count in scene.tiles],
            "inverse_reflectance": 1 / scene.normal_reflectance,
            "per_um": float(window_spread(1.0, scene.coherence_um)),
            "wavelengths": [FIRST_NM / 1000, LAST_NM / 1000, FINE_NM / 1000],
            "coarse_step": COARSE_NM / 1000,
            "phase_scale": scale,
            "colour_axis": [_COLOUR_UM[0], (COLOURS[0] - 1) / (_COLOUR_UM[1] - _COLOUR_UM[0])],
            "width_axis": [float(np.log(_WIDTH_UM[0])), (COLOURS[1] - 1) / float(np.log(_WIDTH_UM[1] / _WIDTH_UM[0]))],
        },
    )


def coded_maps(
    orientation_rad: NDArray[np.floating], period_um: NDArray[np.floating], levels: int
) -> tuple[NDArray[np.uint16], list[float]]:
    """Codes of both maps, and what they mean: radians of a step, um of the first code, um of a step."""
    known = np.isfinite(orientation_rad) & (period_um > 0)
    turn = np.pi / levels
    low, high = (float(period_um[known].min()), float(period_um[known].max())) if known.any() else (1.0, 1.0)
    step = (high - low) / (levels - 1)
    codes = np.zeros((*known.shape, 2), np.uint16)
    codes[known, 0] = np.rint(orientation_rad[known].astype(np.float64) / turn) % levels + 1
    codes[known, 1] = np.rint((period_um[known].astype(np.float64) - low) / step) + 1 if step else 1
    return codes, [turn, low, step]


def _shares(depth_um: float, longest_um: float) -> tuple[NDArray[np.float32], float]:
    """Shares of all orders that reach an eye and are not negligible, and nodes a radian."""
    shortest = FIRST_NM / 1000
    deepest = max(2 * np.pi / shortest * _LARGEST_HALF_VECTOR * depth_um, 1e-3)
    phase = np.linspace(0, deepest, int(np.ceil(deepest / _PHASE_STEP)) + 2)
    orders = np.arange(highest_order(longest_um, shortest, _LARGEST_HALF_VECTOR) + 1)
    table = efficiencies("exact", orders[:, None], phase[None, :])
    seen = np.flatnonzero(table.max(axis=1) > _NEGLIGIBLE)
    return table[: seen[-1] + 1].astype(np.float32), (len(phase) - 1) / deepest


def _spectrum(light: Spectrum) -> NDArray[np.float32]:
    rows = [white_balanced_weights(light, step) for step in (FINE_NM, COARSE_NM)]
    table = np.zeros((2, len(rows[0][0]), 4), np.float32)
    for row, (wavelength_nm, weights) in zip(table, rows, strict=True):
        row[: len(weights), :3] = weights * (_MIDDLE_UM * 1000 / wavelength_nm[:, None]) ** 2
    return table
