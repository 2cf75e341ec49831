"""Boards whose corners tell which they are."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from pipeline.optics.charuco import Board

BOARD = Board(9, 7, 12.0, 9.0)


def test_the_way_from_board_to_photo_is_found_with_y_up() -> None:
    to_photo = np.array([[3.1, 0.2, 260.0], [0.1, -2.9, 190.0], [2e-4, -1e-4, 1.0]])
    drawn = BOARD.drawn(8)
    rows, columns = drawn.shape
    to_print = np.array([[8, 0, columns / 2 - 0.5], [0, -8, rows / 2 - 0.5], [0, 0, 1]])
    way = to_photo @ np.linalg.inv(to_print)
    photo = cv2.warpPerspective(cv2.GaussianBlur(drawn, (0, 0), 1.5), way, (520, 380), borderValue=160)
    found = BOARD.homography(photo)
    for x, y in ((-50, 38), (50, 38), (50, -38), (-50, -38)):
        seen, known = ((h @ (x, y, 1))[:2] / (h @ (x, y, 1))[2] for h in (found, to_photo))
        assert seen == pytest.approx(known, abs=0.15)


def test_a_board_that_is_not_there_is_not_found() -> None:
    with pytest.raises(ValueError, match="0 corners of the ChArUco board are seen, of at least 8"):
        BOARD.homography(np.full((200, 300), 128, np.uint8))


def test_the_board_ends_where_its_squares_do() -> None:
    assert BOARD.covers(np.array([[53.9, 41.9], [54.1, 0.0], [0.0, -42.1]])).tolist() == [True, False, False]
