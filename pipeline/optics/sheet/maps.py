"""What each pixel of a view shows of a sheet's maps: the nearest point of a tile that repeats, and slopes of bumps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.compiled import njit
from pipeline.optics.sheet.view import View

Float32Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Tiled:
    """Maps of a tile that is laid side by side, centred on the sheet.

    Attributes
    ----------
    planes : ndarray of shape (K, M, N), float32
        K maps, such as orientation and period.
    pixel_mm : float
        Their pitch.
    tiles : tuple of int
        How often they repeat along x and along y.
    """

    planes: Float32Array
    pixel_mm: float
    tiles: tuple[int, int] = (1, 1)

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height of the sheet."""
        rows, columns = self.planes.shape[1:]
        return columns * self.tiles[0] * self.pixel_mm, rows * self.tiles[1] * self.pixel_mm


@dataclass(frozen=True, eq=False)
class Bumps:
    """Slopes of a sheet that is not flat, by which its gratings' frames are tilted.

    Attributes
    ----------
    slopes : ndarray of shape (2, M, N), float32
        dz/dx and dz/dy; the middle of the field lies on the middle of the sheet.
    pixel_mm : float
        Their pitch.
    periodic : bool
        Whether the field goes on as it repeats; otherwise the sheet is flat where it ends.
    """

    slopes: Float32Array
    pixel_mm: float
    periodic: bool


def prepared_gratings(orientation_rad: NDArray[np.floating], period_um: NDArray[np.floating]) -> Float32Array:
    """Cosine and sine of the orientation and the period, shape (3, M, N); all 0 where there is no grating."""
    dark = ~(np.isfinite(orientation_rad) & (period_um > 0))
    planes = np.stack([np.cos(orientation_rad), np.sin(orientation_rad), period_um]).astype(np.float32)
    planes[:, dark] = 0
    return planes


def slopes_of(height_um: NDArray[np.floating], pitch_um: float, *, periodic: bool) -> Float32Array:
    """dz/dx and dz/dy of a height field by central differences, shape (2, M, N); row 0 is the one of largest y."""
    height = np.asarray(height_um, np.float64)
    if periodic:
        height = np.pad(height, 1, mode="wrap")
    down, across = np.gradient(height, pitch_um, axis=0), np.gradient(height, pitch_um, axis=1)
    inside = slice(1, -1) if periodic else slice(None)
    return np.stack([across[inside, inside], -down[inside, inside]]).astype(np.float32)


def sample_rows(maps: Tiled, view: View, out: Float32Array, span: tuple[int, int]) -> None:
    """Fill rows ``span`` of ``out`` (K, rows, columns) with the nearest points of the maps, NaN beside the sheet.

    Releases the interpreter lock.
    """
    _nearest(maps.planes, maps.pixel_mm, maps.tiles[0], maps.tiles[1], view.homography, out, span[0], span[1])


def slope_rows(bumps: Bumps, view: View, out: Float32Array, span: tuple[int, int]) -> None:
    """Fill rows ``span`` of ``out`` (2, rows, columns) with slopes between neighbouring points of the field."""
    _between(bumps.slopes, bumps.pixel_mm, bumps.periodic, view.homography, out, span[0], span[1])


@njit(nogil=True, cache=True, error_model="numpy")
def _nearest(
    planes: Any, pixel: float, across: int, down: int, homography: Any, out: Any, first: int, last: int
) -> None:
    count, rows, columns = planes.shape
    for r in range(first, last):
        for c in range(out.shape[2]):
            z = homography[2, 0] * c + homography[2, 1] * r + homography[2, 2]
            column = (homography[0, 0] * c + homography[0, 1] * r + homography[0, 2]) / (z * pixel)
            row = -(homography[1, 0] * c + homography[1, 1] * r + homography[1, 2]) / (z * pixel)
            column += 0.5 * columns * across
            row += 0.5 * rows * down
            if z > 0 and 0 <= column < columns * across and 0 <= row < rows * down:
                i, j = int(row) % rows, int(column) % columns
                for k in range(count):
                    out[k, r, c] = planes[k, i, j]
            else:
                for k in range(count):
                    out[k, r, c] = np.nan


@njit(nogil=True, cache=True, error_model="numpy")
def _between(slopes: Any, pixel: float, periodic: bool, homography: Any, out: Any, first: int, last: int) -> None:
    rows, columns = slopes.shape[1:]
    for r in range(first, last):
        for c in range(out.shape[2]):
            z = homography[2, 0] * c + homography[2, 1] * r + homography[2, 2]
            column = (homography[0, 0] * c + homography[0, 1] * r + homography[0, 2]) / (z * pixel)
            row = -(homography[1, 0] * c + homography[1, 1] * r + homography[1, 2]) / (z * pixel)
            column += 0.5 * (columns - 1)
            row += 0.5 * (rows - 1)
            inside = -0.5 <= column <= columns - 0.5 and -0.5 <= row <= rows - 0.5
            if not (z > 0 and (periodic or inside)):
                out[0, r, c] = out[1, r, c] = 0
                continue
            i, j = int(np.floor(row)), int(np.floor(column))
            di, dj = row - i, column - j
            if periodic:
                i0, i1, j0, j1 = i % rows, (i + 1) % rows, j % columns, (j + 1) % columns
            else:
                i0, i1 = max(i, 0), min(i + 1, rows - 1)
                j0, j1 = max(j, 0), min(j + 1, columns - 1)
            for k in range(2):
                above = slopes[k, i0, j0] * (1 - dj) + slopes[k, i0, j1] * dj
                below = slopes[k, i1, j0] * (1 - dj) + slopes[k, i1, j1] * dj
                out[k, r, c] = above * (1 - di) + below * di
