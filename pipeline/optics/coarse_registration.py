"""Motions to start from: how the edges of two photographs agree best, wherever one lies on the other.

Edges count by how sharp they are, whatever the sign of their contrast. Where one photograph leaves the other there is
nothing to agree on, so that far motions have to be worth what they lose: along stripes only the stripes' ends tell.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft

from pipeline.optics.edge_patches import edge_band
from pipeline.optics.rigid import RigidMotion, corner_px
from pipeline.optics.rigid_sampling import resampled

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

_LEVELS = (8, 4, 2, 1)
_LEAST_SIDE = 130
"""Turns are looked for in photographs averaged over so many pixels a side, in the two coarsest that keep this size."""

_TURN_STEP_PX = 1.5  # of the corners; as wide as an edge is
_APART_PX = 5

FARTHEST = 0.75
"""Shifts are looked for up to this share of the picture's side."""

AMBIGUOUS = 0.95
"""Of scenes with outlines, rivals reach 0.5 to 0.92; of fringes or stripes without an end, 0.98 and more."""


@dataclass(frozen=True)
class Start:
    """A motion right to about a pixel.

    Attributes
    ----------
    motion : RigidMotion
        Of one photograph against another.
    rival : float
        How well the edges agree at the best shift more than five pixels away, in units of how well they agree here.
    """

    motion: RigidMotion = field(default_factory=RigidMotion)
    rival: float = 0.0

    @property
    def ambiguous(self) -> bool:
        """Whether a motion elsewhere would do as well."""
        return self.rival > AMBIGUOUS


def edge_image(image: Float32Array) -> Float32Array:
    """Soft edge magnitude in [0, 1), whatever the sign of the contrast."""
    magnitude = cv2.GaussianBlur(np.abs(edge_band(image)), (0, 0), 1.0)
    level = np.float32(2 * np.mean(magnitude) + np.finfo(np.float32).tiny)
    return np.asarray(magnitude / (magnitude + level), np.float32)


def edge_images(image: Float32Array) -> list[Float32Array]:
    """Edge images of the photograph averaged over several pixels a side, for turns, and last that of itself."""
    height, width = image.shape
    levels = [
        cv2.resize(image[: height // f * f, : width // f * f], (width // f, height // f), interpolation=cv2.INTER_AREA)
        for f in [f for f in _LEVELS if f == 1 or min(image.shape) >= _LEAST_SIDE * f][:2]
    ]
    return [edge_image(one) for one in (*levels, image)]


def coarse_turn(
    reference: list[Float32Array], moved: list[Float32Array], *, largest_px: float, largest_rad: float
) -> float:
    """Turn of one photograph against another, in radians anticlockwise; 0 where it moves the corners by less than 1 px.

    Parameters
    ----------
    reference, moved : list of ndarray, float32
        The :func:`edge_images` of both.
    largest_px, largest_rad : float
        Shifts along an axis and turns beyond these are not looked for.
    """
    turn, reach = 0.0, largest_rad
    if corner_px(reference[-1].shape) <= 1:
        return 0.0
    for one, other in zip(reference[:-1], moved[:-1], strict=True):
        step = _TURN_STEP_PX / corner_px(one.shape)
        count = int(np.ceil(reach / step))
        # None is zero: a picture that is not interpolated is sharper and would win.
        turns = turn + step * (np.arange(-count, count) + 0.5)
        still = _Reference(one, largest_px * one.shape[0] / reference[-1].shape[0])
        scores = [float(still.correlation(turned_back(other, t)).max()) for t in turns]
        turn, reach = float(turns[0] + step * _highest(scores)), step
    return turn if abs(turn) * corner_px(reference[-1].shape) > 1 else 0.0


def coarse_motion(reference: Float32Array, moved: Float32Array, *, largest_px: float, turn_rad: float = 0.0) -> Start:
    """Motion of one photograph, turned by so much, against another, in whole pixels, from an edge image of each.

    Shifts along an axis beyond ``largest_px`` are not looked for.
    """
    still = _Reference(reference, largest_px)
    shift, rival = still.best(still.correlation(turned_back(moved, turn_rad)))
    row, column = RigidMotion(turn_rad).matrix @ shift
    return Start(RigidMotion(turn_rad, (float(row), float(column))), rival)


class _Reference:
    """An edge image to correlate others with, at shifts of whole pixels along each axis."""

    def __init__(self, edges: Float32Array, largest_px: float) -> None:
        self._reach = int(min(largest_px, *(FARTHEST * n for n in edges.shape)))
        self._sizes = [fft.next_fast_len(n + self._reach, real=True) for n in edges.shape]
        self._spectrum = np.conj(self._transform(edges))

    def correlation(self, edges: Float32Array) -> Float32Array:
        """With an image off by -reach ... reach rows and columns, shape (2 reach + 1, 2 reach + 1)."""
        around = fft.irfft2(self._spectrum * self._transform(edges), s=self._sizes)
        reach = self._reach
        return np.asarray(np.roll(around, (reach, reach), axis=(0, 1))[: 2 * reach + 1, : 2 * reach + 1])

    def best(self, correlation: Float32Array) -> tuple[Float64Array, float]:
        """Rows and columns of the highest correlation, and the highest one apart from there, relative to it."""
        row, column = np.unravel_index(np.argmax(correlation), correlation.shape)
        highest = float(correlation[row, column])
        apart = correlation.copy()
        apart[max(0, row - _APART_PX) : row + _APART_PX + 1, max(0, column - _APART_PX) : column + _APART_PX + 1] = 0
        shift = np.array([row - self._reach, column - self._reach], np.float64)
        return shift, float(apart.max()) / highest if highest > 0 else np.inf

    def _transform(self, edges: Float32Array) -> NDArray[np.complex64]:
        return np.asarray(fft.rfft2(edges - edges.mean(), s=self._sizes))


def turned_back(edges: Float32Array, turn_rad: float) -> Float32Array:
    """An edge image of a photograph that was turned anticlockwise by so much, as it would be without the turn."""
    if not turn_rad:
        return edges
    return resampled(edges, RigidMotion(turn_rad), edges.shape, order=1, outside=float(edges.mean()))


def _highest(values: list[float]) -> float:
    """Where the parabola through the largest value and its neighbours is highest, as an index."""
    best = int(np.argmax(values))
    if not 0 < best < len(values) - 1:
        return float(best)
    before, here, after = values[best - 1 : best + 2]
    bend = before - 2 * here + after
    return best + (0.5 * (before - after) / bend if bend < 0 else 0.0)
