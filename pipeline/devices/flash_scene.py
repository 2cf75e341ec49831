"""What a camera gets from a holographic sheet on a table: under a phone's flash, and under the lamps of a room."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.devices.virtual_light import Image, Lighting, white_level
from pipeline.devices.virtual_sheet import Sheet, automatic_sampling, render_sheet
from pipeline.optics.charuco import Board
from pipeline.optics.sheet.view import View

Float64Array = NDArray[np.float64]

_TOLERANCE = 0.01
_WHITE_PERCENTILE = 99.5
_TABLE = 0.15
_WHITE_BOARD = 4.0
"""Of the table and of the board's white, relative to the paper."""


@dataclass(frozen=True, eq=False)
class FlashScene:
    """A sheet on a table, and the camera above it.

    Attributes
    ----------
    sheet : Sheet
        Its gratings.
    view : View
        The camera's picture.
    samples : int
        Points along each side of a pixel.
    paper : float
        Brightness of what scatters evenly, as print, dust and varnish do, in the point nearest to the flash, relative
        to the brightest gratings.
    board : Board or None
        A ChArUco board below the middle of the sheet.
    """

    sheet: Sheet
    view: View
    samples: int
    paper: float
    board: Board | None = None

    def under_flash(self, lighting: Lighting) -> Image:
        """Radiance of shape (lights, M, N, 3), not below 0; 1 is a bright grating's."""
        sampling = automatic_sampling(self.sheet, self.view, lighting, samples=self.samples, tolerance=_TOLERANCE)
        rgb = render_sheet(self.sheet, self.view, lighting, evaluator="auto", sampling=sampling, tolerance=_TOLERANCE)
        rgb = np.maximum(rgb, 0)
        white = white_level(rgb, _WHITE_PERCENTILE)
        rgb /= white
        place, albedo = self._places(), self._albedo()[..., None]
        tint = _tint(lighting, rgb)
        for index, (x, y, z) in enumerate(lighting.lights_mm):
            # Lambert's cosine and the inverse square of the distance, 1 below the light.
            falloff = (1 + ((place - (x, y)) ** 2).sum(axis=-1, keepdims=True) / z**2) ** -1.5
            rgb[index] += (self.paper * albedo * falloff * tint).astype(np.float32)
        return rgb

    def under_lamps(self, lighting: Lighting) -> Image:
        """Radiance of shape (M, N, 3) with all lamps on; 1 is a bright grating's."""
        sampling = automatic_sampling(self.sheet, self.view, lighting, samples=self.samples, tolerance=_TOLERANCE)
        rgb = render_sheet(
            self.sheet, self.view, lighting, evaluator="auto", sampling=sampling, tolerance=_TOLERANCE, together=True
        )[0]
        rgb = np.maximum(rgb, 0)
        rgb /= white_level(rgb, _WHITE_PERCENTILE)
        return np.asarray(0.75 * rgb + 0.2 * self._albedo()[..., None], np.float32)

    def corners_px(self) -> Float64Array:
        """Where the corners of the sheet are seen, shape (4, 2): top left, top right, bottom right, bottom left."""
        x, y = (side / 2 for side in self.sheet.size_mm)
        return self.view.pixels(np.array([-x, x, x, -x]), np.array([y, y, -y, -y]))

    def _places(self) -> Float64Array:
        column, row = np.meshgrid(np.arange(self.view.columns, dtype=float), np.arange(self.view.rows, dtype=float))
        return self.view.points(column, row)

    def _albedo(self) -> Image:
        """Of what scatters, 1 for the sheet; pixels at its edges are part sheet, part table."""
        place = self._places()
        half = np.array(self.sheet.size_mm) / 2
        pixel = np.linalg.norm(place[1:, 1:] - place[:-1, :-1], axis=-1) / np.sqrt(2)
        pixel = np.pad(pixel, ((0, 1), (0, 1)), mode="edge")[..., None]
        covered = np.clip(0.5 + (half - np.abs(place)) / pixel, 0, 1).prod(axis=-1)
        table = np.full(covered.shape, _TABLE)
        if self.board is not None:
            table = np.where(self.board.covers(place), _WHITE_BOARD * self._printed(self.board), table)
        return np.asarray(covered + (1 - covered) * table, np.float32)

    def _printed(self, board: Board) -> Float64Array:
        """The board's print where each pixel sees it."""
        scale = 8
        drawn = board.drawn(scale)
        rows, columns = drawn.shape
        to_print = np.array([[scale, 0, columns / 2 - 0.5], [0, -scale, rows / 2 - 0.5], [0, 0, 1]])
        size = (self.view.columns, self.view.rows)
        blurred = cv2.GaussianBlur(drawn, (0, 0), 1.5)
        return cv2.warpPerspective(
            blurred, to_print @ self.view.homography, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        ) / np.float64(255)


def lamps(places_mm: Sequence[Sequence[float]], sigma_mm: float, lighting: Lighting) -> Lighting:
    """The lamps of a room instead of the flash, the rest as it is, without a filter."""
    return Lighting(
        lights_mm=np.asarray(places_mm, np.float64),
        camera_mm=lighting.camera_mm,
        light_sigma_mm=sigma_mm,
        illuminant="D65",
        depth_um=lighting.depth_um,
        coherence_um=lighting.coherence_um,
        wavelength_step_nm=lighting.wavelength_step_nm,
    )


def _tint(lighting: Lighting, rgb: Image) -> Float64Array:
    """Colour of white paper behind the camera's filter, the brightest channel 1."""
    if lighting.band_nm is None:
        return np.ones(3)
    colour = rgb.sum(axis=(0, 1, 2), dtype=np.float64)
    return np.asarray(colour / colour.max()) if colour.max() > 0 else np.ones(3)
