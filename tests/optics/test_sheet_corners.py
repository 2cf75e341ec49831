"""Corners of a sheet from its outline."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.optics.sheet_corners import ordered, outlined_corners

CORNERS = np.array([[31.3, 22.8], [270.6, 14.1], [283.9, 190.4], [25.2, 201.7]])


def photo(corners: NDArray, paint: NDArray | None = None) -> NDArray[np.float32]:
    """A sheet at known corners, drawn sixteen times as fine and averaged."""
    fine = np.full((220 * 4, 310 * 4), 0.05, np.float32)
    texture = np.full((176, 240), 0.6, np.float32) if paint is None else paint
    there = np.array([[0, 0], [texture.shape[1], 0], [texture.shape[1], texture.shape[0]], [0, texture.shape[0]]])
    homography = cv2.findHomography(there - 0.5, (corners + 0.5) * 4 - 0.5)[0]
    size, flags = fine.shape[::-1], cv2.INTER_NEAREST
    cv2.warpPerspective(texture, homography, size, fine, flags, borderMode=cv2.BORDER_TRANSPARENT)
    return cv2.GaussianBlur(cv2.resize(fine, (310, 220), interpolation=cv2.INTER_AREA), (0, 0), 0.6)


def test_corners_of_an_even_sheet_are_found_to_a_tenth_of_a_pixel() -> None:
    found, residual = outlined_corners(photo(CORNERS))
    assert found == pytest.approx(CORNERS, abs=0.1)
    assert residual < 0.1


def test_a_pattern_on_the_sheet_does_not_lead_astray() -> None:
    blocks = np.random.default_rng(1).uniform(0.25, 1.0, (11, 15)).astype(np.float32)
    found, _ = outlined_corners(photo(CORNERS, np.kron(blocks, np.ones((16, 16), np.float32))))
    assert found == pytest.approx(CORNERS, abs=0.3)


def test_a_dark_facet_in_a_corner_does_not_cut_it_off() -> None:
    paint = np.full((176, 240), 0.6, np.float32)
    cv2.fillConvexPoly(paint, np.array([[239, 175], [239, 125], [189, 175]]), 0.12)
    found, residual = outlined_corners(photo(CORNERS, paint))
    assert found == pytest.approx(CORNERS, abs=0.3)
    assert residual < 0.2


def test_noise_moves_corners_little() -> None:
    noisy = photo(CORNERS) + np.random.default_rng(2).normal(0, 0.02, (220, 310)).astype(np.float32)
    found, _ = outlined_corners(noisy.astype(np.float32))
    assert found == pytest.approx(CORNERS, abs=0.2)


def test_corners_run_clockwise_from_the_top_left_one() -> None:
    for turn in range(4):
        assert (ordered(np.roll(CORNERS, turn, axis=0)) == CORNERS).all()
    assert (ordered(CORNERS[::-1]) == CORNERS).all()


def test_without_a_sheet_there_are_no_corners() -> None:
    spot = np.zeros((200, 300), np.float32)
    cv2.circle(spot, (150, 100), 12, 1.0, -1)
    with pytest.raises(ValueError, match="nothing that fills a good part of the photograph"):
        outlined_corners(spot)
