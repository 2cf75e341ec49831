"""A camera, and which triangle it sees at every pixel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.compiled import njit
from pipeline.optics.shaded_mesh import Float64Array, Mesh, unit


@dataclass(frozen=True)
class Camera:
    """A pinhole camera without distortion.

    Attributes
    ----------
    eye_mm, target_mm : ndarray of shape (3,)
        Where it stands, and what lies in the middle of its picture.
    up : ndarray of shape (3,)
        What points up in the picture, not along the view.
    field_of_view_rad : float
        Across the picture's width.
    """

    eye_mm: Float64Array
    target_mm: Float64Array
    up: Float64Array
    field_of_view_rad: float

    def axes(self) -> Float64Array:
        """Right, up and back of the picture, rows of a (3, 3) rotation."""
        back = unit(self.eye_mm - self.target_mm)
        right = unit(np.cross(self.up, back))
        return np.stack([right, np.cross(back, right), back])

    def seen(self, position_mm: Float64Array, rows: int, columns: int) -> Float64Array:
        """Column, row (0.5 in the middle of the first pixel) and depth along the view of points, shape (V, 3)."""
        x, y, z = self.axes() @ (position_mm - self.eye_mm).T
        focal = columns / 2 / np.tan(self.field_of_view_rad / 2)
        depth = np.where(z == 0, -1e-12, -z)
        return np.stack([columns / 2 + focal * x / depth, rows / 2 - focal * y / depth, depth], axis=1)


@dataclass(frozen=True)
class Fragments:
    """What a camera sees at every pixel, or at a point within it.

    Attributes
    ----------
    triangle : ndarray of shape (M, N), int32
        Nearest triangle; -1 for none.
    weights : ndarray of shape (M, N, 3)
        Barycentric coordinates on it, correct in perspective.
    depth_mm : ndarray of shape (M, N)
        Distance along the view; infinite where there is nothing.
    """

    triangle: NDArray[np.int32]
    weights: Float64Array
    depth_mm: Float64Array

    @staticmethod
    def empty(rows: int, columns: int) -> Fragments:
        """To be filled by :func:`rasterised_rows`."""
        return Fragments(
            np.full((rows, columns), -1, np.int32), np.zeros((rows, columns, 3)), np.full((rows, columns), np.inf)
        )


@dataclass(frozen=True)
class Hits:
    """The points of a mesh that are seen, H of them, in the order of ``triangle >= 0``.

    Attributes
    ----------
    position_mm, normal, tangent : ndarray of shape (H, 3)
        Interpolated; the vectors are not of length 1.
    uv : ndarray of shape (H, 2)
        Interpolated.
    """

    position_mm: Float64Array
    normal: Float64Array
    tangent: Float64Array
    uv: Float64Array


def interpolated(mesh: Mesh, fragments: Fragments) -> Hits:
    """What vertices carry, at the pixels that see a triangle."""
    seen = fragments.triangle >= 0
    corners, weights = mesh.triangles[fragments.triangle[seen]], fragments.weights[seen]
    of = (mesh.position_mm, mesh.normal, mesh.tangent, mesh.uv)
    return Hits(*(np.einsum("hc,hci->hi", weights, carried[corners]) for carried in of))


def rasterised_rows(
    seen: Float64Array,
    mesh: Mesh,
    into: Fragments,
    start: int,
    stop: int,
    *,
    at: tuple[float, float] = (0.5, 0.5),
    nearest_mm: float = 1e-3,
) -> None:
    """Find the nearest triangle at each pixel of rows ``start`` to ``stop``.

    Edges belong to both of their triangles and are computed in one order, so that no pixel falls between two.

    Parameters
    ----------
    seen : ndarray of shape (V, 3)
        The vertices as :meth:`Camera.seen` gives them.
    mesh : Mesh
        Its triangles; those that reach nearer than ``nearest_mm`` or behind the camera are left out.
    into : Fragments
        Written.
    start, stop : int
        Rows.
    at : tuple of float
        Point within each pixel, right and down from its corner.
    nearest_mm : float
        Least depth.
    """
    _rows(seen, mesh.triangles, at[0], at[1], nearest_mm, start, stop, into.triangle, into.weights, into.depth_mm)


@njit(nogil=True, cache=True)
def _rows(seen, triangles, right, down, nearest, start, stop, triangle, weights, depth):  # type: ignore[no-untyped-def]
    columns = triangle.shape[1]
    for index in range(len(triangles)):
        a, b, c = seen[triangles[index, 0]], seen[triangles[index, 1]], seen[triangles[index, 2]]
        if min(a[2], b[2], c[2]) < nearest:
            continue
        whole = _edge(a, b, c[0], c[1])
        if whole == 0:
            continue
        sign = 1.0 if whole > 0 else -1.0
        top = max(start, int(np.ceil(max(min(a[1], b[1], c[1]), start - 1.0) - down)))
        bottom = min(stop - 1, int(np.floor(min(max(a[1], b[1], c[1]), stop + 1.0) - down)))
        first = max(0, int(np.ceil(max(min(a[0], b[0], c[0]), -1.0) - right)))
        last = min(columns - 1, int(np.floor(min(max(a[0], b[0], c[0]), columns + 1.0) - right)))
        for row in range(top, bottom + 1):
            for column in range(first, last + 1):
                x, y = column + right, row + down
                towards_a, towards_b = sign * _edge(b, c, x, y), sign * _edge(c, a, x, y)
                towards_c = sign * _edge(a, b, x, y)
                if towards_a < 0 or towards_b < 0 or towards_c < 0:
                    continue
                # Barycentric coordinates over depth are linear in the picture.
                towards_a, towards_b, towards_c = towards_a / a[2], towards_b / b[2], towards_c / c[2]
                total = towards_a + towards_b + towards_c
                if total <= 0:
                    continue
                here = (sign * whole) / total
                if here < depth[row, column]:
                    depth[row, column] = here
                    triangle[row, column] = index
                    weights[row, column, 0] = towards_a / total
                    weights[row, column, 1] = towards_b / total
                    weights[row, column, 2] = towards_c / total


@njit(inline="always")
def _edge(start: Any, end: Any, x: Any, y: Any) -> Any:
    """Twice the area of an edge and a point; exactly the negative of that of the edge from end to start."""
    if start[0] < end[0] or (start[0] == end[0] and start[1] < end[1]):
        return (end[0] - start[0]) * (y - start[1]) - (end[1] - start[1]) * (x - start[0])
    return -((start[0] - end[0]) * (y - end[1]) - (start[1] - end[1]) * (x - end[0]))
