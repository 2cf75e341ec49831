"""Probes that need no file, drawn with several points to a texel so that edges are smooth."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.environment.probe import texel_directions

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
Scene = Callable[[Float64Array], Float64Array]

_POINTS = 4
_SKY_BLUE, _HORIZON, _GRASS = (0.35, 0.6, 1.0), (0.9, 0.95, 1.0), (0.12, 0.14, 0.06)
_WALL, _CEILING, _FLOOR = (0.16, 0.15, 0.14), (0.14, 0.14, 0.14), (0.10, 0.07, 0.045)
_DAYLIGHT, _LAMPLIGHT = (4.0, 4.6, 5.2), (1.0, 0.72, 0.42)
_ROOM_M = (2.5, 1.5, 3.0)
"""From the sheet to the walls at its sides, to ceiling and floor, and to the wall behind the viewer."""
_LAMP_IRRADIANCE, _SUN_IRRADIANCE = 0.1, 0.6


def drawn(scene: Scene, rows: int) -> Float32Array:
    """A scene in latitude and longitude, the mean of several points in each texel; shape (rows, 2 rows, 3)."""
    fine = scene(texel_directions(rows * _POINTS, 2 * rows * _POINTS))
    return fine.reshape(rows, _POINTS, 2 * rows, _POINTS, 3).mean(axis=(1, 3)).astype(np.float32)


def uniform() -> Scene:
    """White from everywhere."""
    return lambda towards: np.ones((*towards.shape[:-1], 3))


def outdoors(lamp_deg: float) -> Scene:
    """A clear sky over grass, and a sun behind the viewer's right shoulder, ``lamp_deg`` wide."""
    sun = np.array([0.35, 0.55, 0.76])

    def scene(towards: Float64Array) -> Float64Array:
        up = towards[..., 1:2]
        sky = _blend(np.clip(up, 0, 1) ** 0.5, _HORIZON, _SKY_BLUE)
        glow = np.exp((towards @ (sun / np.linalg.norm(sun)) - 1)[..., None] / 0.03)
        ground = _blend(np.clip(1 + up * 4, 0, 1), _GRASS, (0.3, 0.32, 0.25))
        return np.where(up > 0, sky + glow * np.array([0.9, 0.8, 0.6]), ground) + _disc(
            towards, sun, lamp_deg, _SUN_IRRADIANCE, (1.0, 0.95, 0.85)
        )

    return scene


def room(lamp_deg: float) -> Scene:
    """A room with a window of four panes behind the viewer's left shoulder and three warm lamps, ``lamp_deg`` wide."""
    lamps = [np.array([x, 0.62, 0.7]) for x in (-0.15, 0.3, 0.75)]

    def scene(towards: Float64Array) -> Float64Array:
        with np.errstate(divide="ignore"):
            paces = np.abs(np.array(_ROOM_M) / towards)
        nearest = paces.argmin(axis=-1)
        place = towards * paces.min(axis=-1, keepdims=True)
        x, y = place[..., 0], place[..., 1]
        light = np.broadcast_to(np.array(_WALL), place.shape).copy()
        light[nearest == 1] = np.where(y[nearest == 1][:, None] > 0, _CEILING, _FLOOR)
        ahead = (nearest == 2) & (towards[..., 2] > 0)
        across, up = (x + 0.9) / 0.7, (y - 0.15) / 0.8
        pane = ahead & (np.abs(across) < 1) & (np.abs(up) < 1) & (np.abs(across) > 0.06) & (np.abs(up) > 0.05)
        outside = _blend(np.clip(0.5 + up / 2, 0, 1)[..., None], (1.6, 1.7, 1.5), _DAYLIGHT)
        light[pane] = outside[pane]
        for lamp in lamps:
            light += _disc(towards, lamp, lamp_deg, _LAMP_IRRADIANCE, _LAMPLIGHT)
        return light

    return scene


SCENES: dict[str, Callable[[float], Scene]] = {"room": room, "outdoors": outdoors, "uniform": lambda _: uniform()}


def _disc(
    towards: Float64Array, middle: Float64Array, width_deg: float, irradiance: float, colour: Sequence[float]
) -> Float64Array:
    """A disc that gives the same light however wide it is."""
    edge = np.cos(np.deg2rad(width_deg / 2))
    inside = towards @ (middle / np.linalg.norm(middle)) > edge
    return np.asarray(inside[..., None] * np.array(colour) * irradiance / (2 * np.pi * (1 - edge)))


def _blend(part: Float64Array, first: Sequence[float], last: Sequence[float]) -> Float64Array:
    return np.asarray((1 - part) * np.array(first) + part * np.array(last))
