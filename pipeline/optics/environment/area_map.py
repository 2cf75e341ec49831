"""A probe as the sheet sees it, on a square in which equal areas are equal solid angles, and coarser averages of it.

A direction ``(x, y, z)`` of the sheet's frame lies at ``(x, y) / sqrt(1 + z)`` (Lambert's azimuthal projection): what
is before the sheet within 1 of the middle, what is behind it within the square root of 2. It takes one square root to
get there, and a mean over texels is one over solid angle, which is twice the area.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.environment.probe import Probe

Float32Array = NDArray[np.float32]

_FINEST, _FEWEST_TEXELS, _MOST_TEXELS = 0.3, 768, 2048
_MARGIN = 1.02
_HALVED = 32


@dataclass(frozen=True, eq=False)
class AreaMap:
    """Radiance over the square.

    Attributes
    ----------
    levels : tuple of ndarray of shape (N, N, 4), float32
        Linear sRGB and a zero, each level the mean of two by two texels of the one before. Columns follow x, rows y.
    reach : float
        Half the side of the square.
    """

    levels: tuple[Float32Array, ...]
    reach: float

    @property
    def texel_rad(self) -> float:
        """Angle across the finest texels, straight before the sheet."""
        return float(np.sqrt(8.0) * self.reach / len(self.levels[0]))


def area_map(probe: Probe, *, all_around: bool = False) -> AreaMap:
    """Project a probe, each texel the mean of several points where the probe is finer.

    Parameters
    ----------
    probe : Probe
        The light.
    all_around : bool
        Go beyond the horizon, for a sheet with bumps.
    """
    reach = float(np.sqrt(2.0)) if all_around else _MARGIN
    size = int(np.clip(np.sqrt(8.0) * reach / (_FINEST * probe.texel_rad), _FEWEST_TEXELS, _MOST_TEXELS))
    size += -size % _HALVED
    points = max(1, int(np.ceil(np.sqrt(8.0) * reach / size / probe.texel_rad)))
    places = ((np.arange(size * points) + 0.5) / (size * points) * 2 - 1) * reach
    finest = np.zeros((size, size, 4), np.float32)
    for row in range(size):
        x, y = np.meshgrid(places, places[row * points : (row + 1) * points])
        square = np.minimum(x**2 + y**2, 2.0)
        scale = np.sqrt(2 - square)
        seen = probe.radiance(np.stack([x * scale, y * scale, 1 - square], axis=-1))
        finest[row, :, :3] = seen.reshape(points, size, points, 3).mean(axis=(0, 2))
    levels = [finest]
    while size // len(levels[-1]) < _HALVED:
        half = len(levels[-1]) // 2
        levels.append(levels[-1].reshape(half, 2, half, 2, 4).mean(axis=(1, 3)))
    return AreaMap(tuple(levels), reach)
