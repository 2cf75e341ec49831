"""Light probes: which direction each texel is seen in, and what is seen in a direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.compiled import njit

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Probe:
    """Radiance from all directions, and how the sheet lies in it.

    Attributes
    ----------
    rgb : ndarray of shape (M, N, 3), float32
        Linear sRGB over latitude and longitude.
    pose : ndarray of shape (3, 3), float64
        From directions in the sheet's frame (x right, y up along it, z its normal) to those in the probe's.
    """

    rgb: Float32Array
    pose: Float64Array

    @property
    def texel_rad(self) -> float:
        """Angle between neighbouring rows."""
        return float(np.pi / self.rgb.shape[0])

    def radiance(self, directions: NDArray[np.floating]) -> Float64Array:
        """What is seen in directions of the sheet's frame, bilinear; shape (..., 3) to (..., 3)."""
        away = np.asarray(directions, np.float64)
        out = np.empty((away[..., 0].size, 3))
        _look_up_all(self.rgb, self.pose, np.ascontiguousarray(away.reshape(-1, 3)), out)
        return out.reshape(away.shape)


def pose(rotation_rad: float, tilt_rad: float) -> Float64Array:
    """From directions in the sheet's frame to those in the probe's, shape (3, 3).

    Parameters
    ----------
    rotation_rad : float
        By which the probe is turned around the vertical, anticlockwise as seen from above.
    tilt_rad : float
        By which the sheet leans back: 0 upright, pi / 2 lying on a table.
    """
    c, s = np.cos(tilt_rad), np.sin(tilt_rad)
    leaning = np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
    c, s = np.cos(rotation_rad), np.sin(rotation_rad)
    turning_back = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    return np.asarray(turning_back @ leaning)


def texel_directions(rows: int, columns: int) -> Float64Array:
    """Unit vectors towards the middle of texels in the probe's frame, shape (rows, columns, 3)."""
    elevation = np.pi * (0.5 - (np.arange(rows) + 0.5) / rows)[:, None]
    azimuth = 2 * np.pi * ((np.arange(columns) + 0.5) / columns - 0.5)
    level = np.cos(elevation)
    return np.stack(
        [-level * np.sin(azimuth), np.broadcast_to(np.sin(elevation), (rows, columns)), level * np.cos(azimuth)], -1
    )


def solid_angles(rows: int, columns: int) -> Float64Array:
    """Of the texels of each row, shape (rows,); all texels add up to 4 pi."""
    edges = np.sin(np.pi * (0.5 - np.arange(rows + 1) / rows))
    return np.asarray(2 * np.pi / columns * (edges[:-1] - edges[1:]))


@njit(nogil=True, cache=True, error_model="numpy")
def look_up(rgb: Any, pose: Any, x: float, y: float, z: float) -> tuple[float, float, float]:
    """What is seen in one direction of the sheet's frame, between the middles of texels."""
    rows, columns = rgb.shape[0], rgb.shape[1]
    px = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z
    py = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z
    pz = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z
    column = (np.arctan2(-px, pz) / (2 * np.pi) + 0.5) * columns - 0.5
    row = (0.5 - np.arctan2(py, np.sqrt(px * px + pz * pz)) / np.pi) * rows - 0.5
    i, j = int(np.floor(row)), int(np.floor(column))
    di, dj = row - i, column - j
    i0, i1 = max(i, 0), min(i + 1, rows - 1)
    j0, j1 = j % columns, (j + 1) % columns
    a, b, c, d = (1 - di) * (1 - dj), (1 - di) * dj, di * (1 - dj), di * dj
    red = a * rgb[i0, j0, 0] + b * rgb[i0, j1, 0] + c * rgb[i1, j0, 0] + d * rgb[i1, j1, 0]
    green = a * rgb[i0, j0, 1] + b * rgb[i0, j1, 1] + c * rgb[i1, j0, 1] + d * rgb[i1, j1, 1]
    blue = a * rgb[i0, j0, 2] + b * rgb[i0, j1, 2] + c * rgb[i1, j0, 2] + d * rgb[i1, j1, 2]
    return red, green, blue


@njit(nogil=True, cache=True, error_model="numpy")
def _look_up_all(rgb: Any, pose: Any, directions: Any, out: Any) -> None:
    for k in range(len(directions)):
        out[k] = look_up(rgb, pose, directions[k, 0], directions[k, 1], directions[k, 2])
