"""A scene of varying gratings, and the reference's picture of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.sheet.maps import Tiled, sample_rows
from pipeline.optics.sheet.spectral import shade_rows, spectral_table
from pipeline.optics.sheet.view import View
from pipeline.viewer.scene import Scene
from pipeline.viewer.textures import coded_maps

SIDE = 60


def spiral(**changes: object) -> Scene:
    """Orientations that turn around the middle, periods that grow away from it, a corner without gratings."""
    y, x = np.mgrid[1 : -1 : SIDE * 1j, -1 : 1 : SIDE * 1j]
    orientation = (np.arctan2(y, x) + np.hypot(x, y)) % np.pi
    orientation[:9, :20] = np.nan
    settings: dict[str, object] = {
        "orientation_rad": orientation.astype(np.float32),
        "period_um": (0.7 + 0.9 * np.hypot(x, y)).astype(np.float32),
        "pixel_mm": 0.4,
        "light_mm": np.array([90.0, 60.0, 300.0]),
        "eye_mm": np.array([0.0, 0.0, 500.0]),
    }
    return as_coded(Scene(**(settings | changes)))  # type: ignore[arg-type]


def as_coded(scene: Scene, levels: int = 65535) -> Scene:
    """The scene with its maps as the texture keeps them, so that pictures differ by the shading alone."""
    codes, (turn, low, step) = coded_maps(scene.orientation_rad, scene.period_um, levels)
    known = codes[..., 0] > 0
    return replace(
        scene,
        orientation_rad=np.where(known, (codes[..., 0] - 1.0) * turn, np.nan).astype(np.float32),
        period_um=np.where(known, low + (codes[..., 1] - 1.0) * step, np.nan).astype(np.float32),
    )


def reference(scene: Scene, view: View, *, pixel_part: float = 0.0) -> NDArray[np.float32]:
    """The sum over wavelengths and orders in double precision."""
    planes = np.stack([scene.orientation_rad, scene.period_um]).astype(np.float32)
    shown = np.empty((2, view.rows, view.columns), np.float32)
    sample_rows(Tiled(planes, scene.pixel_mm, scene.tiles), view, shown, (0, view.rows))
    table = spectral_table(
        light=scene.illuminant,
        wavelength_step_nm=1.0,
        coherence_um=scene.coherence_um,
        depth_um=scene.depth_um,
        longest_period_um=float(np.nanmax(scene.period_um)),
        largest_half_vector=2.0,
        normal_reflectance=scene.normal_reflectance,
    )
    rgb = np.zeros((view.rows, view.columns, 3), np.float32)
    shade_rows(
        rgb,
        (0, view.rows),
        shown[0],
        shown[1],
        view=view,
        light_mm=scene.light_mm,
        light_sigma_mm=scene.light_sigma_mm,
        table=table,
        pixel_part=pixel_part,
    )
    return rgb


def difference(found: NDArray[np.floating], expected: NDArray[np.floating]) -> float:
    """The largest, relative to the maximum."""
    return float(np.abs(found - expected).max() / expected.max())
