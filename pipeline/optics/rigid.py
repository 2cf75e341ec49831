"""Pictures of one thing that was laid down or photographed twice: a turn and a shift between their pixels.

Rows run downwards, so an anticlockwise turn takes (row, column) about the centre to
(row cos - column sin, row sin + column cos).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]


@dataclass(frozen=True)
class RigidMotion:
    """Where the points of one picture lie in another: turned about the picture's centre, then shifted.

    Attributes
    ----------
    turn_rad : float
        Anticlockwise, as displayed.
    shift_px : tuple of float
        Pixels of the other picture, down and to the right: where the one's centre lies, seen from the other's.
    scale : float
        Pixels of the other picture in one of the one's.
    """

    turn_rad: float = 0.0
    shift_px: tuple[float, float] = (0.0, 0.0)
    scale: float = 1.0

    @property
    def matrix(self) -> Float64Array:
        """What turns (down, right) from the one's centre into (down, right) from the other's, shape (2, 2)."""
        cosine, sine = np.cos(self.turn_rad), np.sin(self.turn_rad)
        return self.scale * np.array([[cosine, -sine], [sine, cosine]])

    def offset_px(self, shape: tuple[int, ...], other_shape: tuple[int, ...]) -> Float64Array:
        """What has to be added to ``matrix @ (row, column)``, for pictures of these shapes."""
        return np.asarray(centre_of(other_shape) + self.shift_px - self.matrix @ centre_of(shape))

    def apply(self, place_px: Float64Array, shape: tuple[int, ...], other_shape: tuple[int, ...]) -> Float64Array:
        """Rows and columns in the other picture, shape (2, P), of rows and columns in the one."""
        return np.asarray(self.matrix @ place_px + self.offset_px(shape, other_shape)[:, None])

    def after(self, turn_rad: float, shift_px: Float64Array) -> RigidMotion:
        """This motion of points that before were turned by ``turn_rad`` and then shifted, in the one's pixels."""
        moved = self.matrix @ shift_px + self.shift_px
        return RigidMotion(self.turn_rad + turn_rad, (float(moved[0]), float(moved[1])), self.scale)

    @property
    def inverse(self) -> RigidMotion:
        """The motion back, from the other picture to the one."""
        back = RigidMotion(-self.turn_rad, scale=1 / self.scale)
        row, column = -back.matrix @ self.shift_px
        return RigidMotion(back.turn_rad, (float(row), float(column)), back.scale)


def centre_of(shape: tuple[int, ...]) -> Float64Array:
    """Row and column of a picture's centre, halfway between its outermost pixel centres."""
    return (np.array(shape[:2], np.float64) - 1) / 2


def corner_px(shape: tuple[int, ...]) -> float:
    """Distance of a picture's corners from its centre."""
    return float(np.hypot(*centre_of(shape)))
