"""The body of a snake: a tube that winds over a plane and tapers to head and tail."""

from __future__ import annotations

import numpy as np

from pipeline.optics.shaded_mesh import Float64Array, Mesh, grid_triangles, unit

AROUND = 15
"""Rows of scales around the body, as in Xenopeltis."""
LENGTH_MM = 300.0
"""From head to tail, seen from above, along the line about which the body winds."""
_RADIUS_MM = 14.0
_SWING_MM, _WINDS = 42.0, 1.5
_HEAD, _TAIL = 0.1, 0.45
"""Shares of the length over which it tapers."""
_SCALE, _LEAST = 0.65, 0.35
"""Length of a scale over the body's radius, and the least radius that scales shrink to, over the largest."""


def snake_body(along: int = 600, around: int = 72) -> Mesh:
    """A body on the plane z = 0, its head at -x.

    The bitangent runs along the body towards the head, and the tangent around it: what a height field has along y lies
    along the body. Texture coordinates count scales, from head to tail and around from the belly.

    Parameters
    ----------
    along, around : int
        Vertices.
    """
    share = (1 - np.cos(np.linspace(0, np.pi, along))) / 2
    line, heading = _centre_line(share)
    radius = _radius(share)
    left = np.cross([0.0, 0.0, 1.0], heading)[:, None]
    turn = np.linspace(0, 2 * np.pi, around)[:, None]
    up = np.array([0.0, 0.0, 1.0])
    # From the belly up the right side, over the back, and down the left one.
    outwards = -np.sin(turn) * left - np.cos(turn) * up
    tangent = -np.cos(turn) * left + np.sin(turn) * up
    position = line[:, None] + radius[:, None, None] * (outwards + up)
    normal = unit(np.cross(np.gradient(position, share, axis=0), tangent))
    step = np.linalg.norm(np.diff(line, axis=0), axis=1) / _SCALE / np.maximum(radius, _LEAST * _RADIUS_MM)[1:]
    rows = np.concatenate([[0.0], np.cumsum(step)])[:, None]
    uv = np.stack(np.broadcast_arrays(rows, AROUND * turn.T / (2 * np.pi)), axis=-1)
    flat = (np.ascontiguousarray(part).reshape(-1, part.shape[-1]) for part in (position, normal, tangent, uv))
    return Mesh(np.ascontiguousarray(grid_triangles(along, around)[:, ::-1]), *flat)


def back_of(share: float) -> Float64Array:
    """Point on the middle of the back, at a share of the length from the head, shape (3,), mm."""
    at = np.array([share])
    return np.asarray(_centre_line(at)[0][0] + [0.0, 0.0, 2 * _radius(at)[0]])


def _centre_line(share: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Where the body lies, shape (N, 3), and unit vectors towards its tail."""
    phase = 2 * np.pi * _WINDS * (share - 0.5)
    line = np.stack([LENGTH_MM * (share - 0.5), _SWING_MM * np.sin(phase), 0 * share], axis=1)
    slope = 2 * np.pi * _WINDS * _SWING_MM * np.cos(phase)
    return line, unit(np.stack([np.full_like(share, LENGTH_MM), slope, 0 * share], axis=1))


def _radius(share: Float64Array) -> Float64Array:
    head = np.sqrt(np.clip(share / _HEAD, 0, 1) * (2 - np.clip(share / _HEAD, 0, 1)))
    tail = np.clip((1 - share) / _TAIL, 0, 1)
    return np.asarray(_RADIUS_MM * (0.02 + 0.98 * head * tail * (2 - tail)))
