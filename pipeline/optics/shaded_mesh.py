"""Triangle meshes whose every vertex carries a tangent frame: a flat plate, and what frames have in common.

The tangent is the direction in which a height field's x lies on the surface, the bitangent ``normal x tangent`` that of
its y, so that seen from outside the field lies as on a page.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mesh:
    """A surface of triangles.

    Attributes
    ----------
    triangles : ndarray of shape (T, 3), int32
        Vertices of each triangle, anticlockwise from outside.
    position_mm, normal, tangent : ndarray of shape (V, 3)
        Of each vertex; normals point outside, tangents lie across them, both of length 1.
    uv : ndarray of shape (V, 2)
        Where on the texture.
    """

    triangles: NDArray[np.int32]
    position_mm: Float64Array
    normal: Float64Array
    tangent: Float64Array
    uv: Float64Array


def plate(width_mm: float, height_mm: float) -> Mesh:
    """A plate in the plane z = 0, its tangent along +x, its texture 0 to 1 in both directions."""
    uv = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    position = np.column_stack([(uv - 0.5) * [width_mm, height_mm], np.zeros(4)])
    normal, tangent = np.tile([0.0, 0.0, 1.0], (4, 1)), np.tile([1.0, 0.0, 0.0], (4, 1))
    return Mesh(np.array([[0, 1, 2], [0, 2, 3]], np.int32), position, normal, tangent, uv)


def grid_triangles(rows: int, columns: int) -> NDArray[np.int32]:
    """Two triangles for each cell of a grid of vertices, anticlockwise with columns to the right and rows up."""
    corner = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    low, right, up, both = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    halves = [np.stack(three, axis=-1).reshape(-1, 3) for three in ((low, right, both), (low, both, up))]
    return np.ascontiguousarray(np.concatenate(halves))


def unit(vectors: Float64Array) -> Float64Array:
    """Vectors of length 1 along the last axis."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def across(vectors: Float64Array, normal: Float64Array) -> Float64Array:
    """Unit vectors along what of ``vectors`` lies across the normals."""
    return unit(vectors - (vectors * normal).sum(axis=-1, keepdims=True) * normal)


def frames(normal: Float64Array, tangent: Float64Array, turn_rad: Float64Array | float = 0.0) -> Float64Array:
    """Right-handed tangent frames, turned about their normals.

    Parameters
    ----------
    normal, tangent : ndarray of shape (..., 3)
        Of any length, as interpolation leaves them.
    turn_rad : float or ndarray of shape (...)
        Anticlockwise, seen from outside.

    Returns
    -------
    ndarray of shape (..., 3, 3)
        Rows tangent, bitangent and normal: times a vector of the world it gives the same vector in the frame.
    """
    n = unit(normal)
    t = across(tangent, n)
    b = np.cross(n, t)
    cos, sin = (np.asarray(part)[..., None] for part in (np.cos(turn_rad), np.sin(turn_rad)))
    return np.stack([cos * t + sin * b, cos * b - sin * t, n], axis=-2)
