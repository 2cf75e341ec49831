"""Flash photographs without a camera's faults: what the reference renderer sends to the eye, and exact tiles."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.data.flash import FlashPhotographs, Tiles
from pipeline.devices.virtual_light import Lighting, add_light
from pipeline.optics.sheet.view import rectified

EYE = np.array([0.0, 0.0, 500.0])
GREEN = (530.0, 10.0)


def photographed(
    orientation_rad: NDArray[np.floating],
    period_um: NDArray[np.floating],
    lights_mm: ArrayLike,
    *,
    pixel_mm: float,
    tiles: tuple[int, int] = (1, 1),
    band_nm: tuple[float, float] | None = None,
    light_sigma_mm: float = 5.0,
    depth_um: float = 0.12,
) -> FlashPhotographs:
    """Photographs of a sheet of (columns, rows) tiles, rectified."""
    lights = np.asarray(lights_mm, np.float64)
    lighting = Lighting(
        lights_mm=lights,
        camera_mm=EYE,
        light_sigma_mm=light_sigma_mm,
        illuminant="inverse A",
        depth_um=depth_um,
        coherence_um=65.0,
        wavelength_step_nm=5.0,
        band_nm=band_nm,
    )
    laid = [np.tile(part, tiles[::-1]).astype(np.float32) for part in (orientation_rad, period_um)]
    rows, columns = laid[0].shape
    radiance = np.zeros((len(lights), rows, columns, 3), np.float32)
    for picture, light in zip(radiance, lights, strict=True):
        add_light(picture, *laid, rectified(rows, columns, pixel_mm, EYE), light, lighting, pixel_part=1.0)
    wavelength, bandwidth = band_nm or (None, None)
    return FlashPhotographs(
        radiance=np.maximum(radiance, 0),
        valid=np.ones(radiance.shape[:3], bool),
        light_mm=lights,
        camera_mm=EYE,
        pixel_mm=pixel_mm,
        wavelength_nm=wavelength,
        bandwidth_nm=bandwidth,
        light_sigma_mm=light_sigma_mm,
    )


def laid_tiles(shape: tuple[int, int], tiles: tuple[int, int], pixel_mm: float) -> Tiles:
    """Where the tiles of such a sheet lie."""
    rows, columns = shape
    places = [(columns * i, rows * j) for j in range(tiles[1]) for i in range(tiles[0])]
    homographies = np.stack([np.array([[1.0, 0, x], [0, 1.0, y], [0, 0, 1.0]]) for x, y in places])
    none = np.zeros(len(places))
    return Tiles(homographies, shape, 0, none, none, np.ones(len(places)), pixel_mm)


def stripes(degrees: list[float], *, side: int) -> NDArray[np.float32]:
    """A square tile of upright stripes, each of one orientation."""
    across = np.repeat(np.deg2rad(degrees), -(-side // len(degrees)))[:side]
    return np.broadcast_to(across, (side, side)).astype(np.float32)
