"""What the viewer shows, as plain numbers: a tile's maps, the light, the eye, and what the gratings are made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.colour import Spectrum


@dataclass(frozen=True, eq=False)
class Scene:
    """A sheet of gratings under one light.

    Attributes
    ----------
    orientation_rad, period_um : ndarray of shape (M, N)
        Maps of a tile; NaN stays dark.
    pixel_mm : float
        Their pitch.
    light_mm, eye_mm : ndarray of shape (3,)
        Where the light is, and who looks: x right, y up, z towards both, from the middle of the sheet.
    tiles : tuple of int
        How often the tile repeats along x and along y.
    light_sigma_mm : float
        Standard deviation of the light's Gaussian extent.
    illuminant : str
        Spectrum of the light.
    depth_um, coherence_um : float
        Peak-to-valley depth of the gratings, and width of the coherence window.
    normal_reflectance : float
        At normal incidence, for Schlick's reflectance relative to it; 1 for a mirror.
    """

    orientation_rad: NDArray[np.floating]
    period_um: NDArray[np.floating]
    pixel_mm: float
    light_mm: NDArray[np.float64]
    eye_mm: NDArray[np.float64]
    tiles: tuple[int, int] = (1, 1)
    light_sigma_mm: float = 12.0
    illuminant: Spectrum = "D65"
    depth_um: float = 0.12
    coherence_um: float = 65.0
    normal_reflectance: float = 1.0

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height of the sheet."""
        rows, columns = self.orientation_rad.shape
        return columns * self.tiles[0] * self.pixel_mm, rows * self.tiles[1] * self.pixel_mm
