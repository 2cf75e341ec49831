"""Who looks at the sheet, and which of its points each pixel of the picture shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.rasterise import Camera

Float64Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class View:
    """A picture of the plane z = 0.

    Attributes
    ----------
    homography : ndarray of shape (3, 3), float64
        From ``(column, row, 1)``, whole numbers in the middle of pixels, to homogeneous ``(x, y, 1)`` in mm. The third
        component is positive where the pixel shows a point of the plane in front of the camera.
    eye_mm : ndarray of shape (3,), float64
        Where the light has to go to be seen.
    rows, columns : int
        Size of the picture.
    """

    homography: Float64Array
    eye_mm: Float64Array
    rows: int
    columns: int

    def points(self, column: NDArray[np.floating], row: NDArray[np.floating]) -> Float64Array:
        """``(x, y)`` on the sheet in mm, shape (..., 2); NaN where the pixel shows nothing of its plane."""
        places = np.stack(np.broadcast_arrays(column, row, 1.0), axis=-1) @ self.homography.T
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(places[..., 2:] > 0, places[..., :2] / places[..., 2:], np.nan)

    def pixels(self, x_mm: NDArray[np.floating], y_mm: NDArray[np.floating]) -> Float64Array:
        """``(column, row)`` of points on the sheet, shape (..., 2)."""
        places = np.stack(np.broadcast_arrays(x_mm, y_mm, 1.0), axis=-1) @ np.linalg.inv(self.homography).T
        return np.asarray(places[..., :2] / places[..., 2:])

    def moved(self, across: float, down: float) -> View:
        """The view whose pixels show what lies so many pixels to the right and below."""
        shift = np.array([[1.0, 0.0, across], [0.0, 1.0, down], [0.0, 0.0, 1.0]])
        return View(self.homography @ shift, self.eye_mm, self.rows, self.columns)

    def thinned(self, every: int) -> View:
        """The view of every so manieth pixel along rows and columns."""
        stride = np.diag([every, every, 1.0])
        return View(self.homography @ stride, self.eye_mm, -(-self.rows // every), -(-self.columns // every))


def rectified(rows: int, columns: int, pixel_mm: float, eye_mm: Float64Array) -> View:
    """The sheet as it would lie on a scanner, centred, its brightness that which is seen from ``eye_mm``."""
    to_sheet = np.array(
        [[pixel_mm, 0.0, -pixel_mm * (columns - 1) / 2], [0.0, -pixel_mm, pixel_mm * (rows - 1) / 2], [0.0, 0.0, 1.0]]
    )
    return View(to_sheet, np.asarray(eye_mm, np.float64), rows, columns)


def photographed(camera: Camera, rows: int, columns: int) -> View:
    """The sheet as a pinhole camera sees it.

    Raises
    ------
    ValueError
        The camera is not above the sheet.
    """
    if camera.eye_mm[2] <= 0:
        raise ValueError(f"a camera at z = {camera.eye_mm[2]:g} does not see the front of the sheet")
    focal = columns / 2 / np.tan(camera.field_of_view_rad / 2)
    to_ray = np.array([[1, 0, 0.5 - columns / 2], [0, -1, rows / 2 - 0.5], [0, 0, -focal]]) / focal
    x, y, z = camera.axes().T @ to_ray
    eye = camera.eye_mm
    # The ray meets the plane after -eye_z / z of its length.
    return View(np.stack([eye[2] * x - eye[0] * z, eye[2] * y - eye[1] * z, -z]), eye, rows, columns)


def fitting_field_of_view(
    camera: Camera, width_mm: float, height_mm: float, rows: int, columns: int, margin: float = 1.05
) -> float:
    """The least angle across the picture in which the whole sheet is seen, and a margin around it.

    Raises
    ------
    ValueError
        Part of the sheet lies beside or behind the camera.
    """
    corners = np.array([[x, y, 0.0] for x in (-width_mm / 2, width_mm / 2) for y in (-height_mm / 2, height_mm / 2)])
    across, up, back = camera.axes() @ (corners - camera.eye_mm).T
    if back.max() >= 0:
        raise ValueError("part of the sheet is not in front of the camera")
    tangent = max(np.abs(across / back).max(), np.abs(up / back).max() * columns / rows)
    return float(2 * np.arctan(margin * tangent))
