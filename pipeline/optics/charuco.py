"""Chessboards with markers, whose corners tell which they are; by OpenCV."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]

LEAST_CORNERS = 8
"""Twice as many as a homography needs."""


@dataclass(frozen=True)
class Board:
    """A ChArUco board of OpenCV's dictionary of 4 x 4 markers, its middle where that of the sheet is.

    Attributes
    ----------
    columns, rows : int
        Squares across and down.
    square_mm, marker_mm : float
        Sides of a square, and of the marker in it.
    """

    columns: int
    rows: int
    square_mm: float
    marker_mm: float

    def covers(self, place_mm: Float64Array) -> NDArray[np.bool_]:
        """Whether points (..., 2) in the frame of the sheet, y up, lie on the board."""
        half = np.array([self.columns, self.rows]) * self.square_mm / 2
        return np.asarray((np.abs(place_mm) <= half).all(axis=-1))

    def drawn(self, pixels_per_mm: int) -> NDArray[np.uint8]:
        """The board, to be printed."""
        size = [round(count * self.square_mm * pixels_per_mm) for count in (self.columns, self.rows)]
        return np.asarray(self._board().generateImage((size[0], size[1])), np.uint8)

    def homography(self, photo: NDArray[np.uint8]) -> Float64Array:
        """From ``(x, y, 1)`` in mm on the board, y up, to ``(column, row, 1)`` of a grey photograph.

        Raises
        ------
        ValueError
            Fewer than 8 corners of the board are seen.
        """
        board = self._board()
        detector = cv2.aruco.CharucoDetector(board)
        every = detector.getCharucoParameters()
        every.minMarkers = 1  # the sheet covers many
        detector.setCharucoParameters(every)
        corners, names, *_ = detector.detectBoard(photo)
        if names is None or len(names) < LEAST_CORNERS:
            found = 0 if names is None else len(names)
            raise ValueError(f"{found} corners of the ChArUco board are seen, of at least {LEAST_CORNERS}")
        known = board.getChessboardCorners()[names.ravel(), :2]
        half = np.array([self.columns, self.rows]) * self.square_mm / 2
        homography, _ = cv2.findHomography((known - half) * (1, -1), corners.reshape(-1, 2), cv2.RANSAC, 1.0)
        if homography is None:
            raise ValueError("the corners of the ChArUco board lie on no plane")
        return np.asarray(homography, np.float64)

    def _board(self) -> Any:
        markers = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_1000)
        return cv2.aruco.CharucoBoard((self.columns, self.rows), self.square_mm, self.marker_mm, markers)
