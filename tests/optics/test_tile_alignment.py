"""Tiles brought onto one of them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.optics.tile_alignment import aligned, corners_of, cut, likeness, of_one_sheet, shift_left, translation

SHAPE = (60, 80)


@pytest.fixture(scope="module")
def texture() -> NDArray[np.float32]:
    noise = np.random.default_rng(3).normal(size=(160, 200)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 2.5)
    return smooth / smooth.std()


def test_a_tile_is_brought_onto_the_reference_to_a_fifth_of_a_pixel(texture: NDArray) -> None:
    start = translation(50.0, 40.0)
    true = np.array([[1.004, 0.01, 53.3], [-0.008, 0.997, 37.6], [2e-5, -1e-5, 1.0]])
    reference = np.nan_to_num(cut(texture, true, SHAPE))
    found = aligned(texture, reference, start)
    assert corners_of(found, SHAPE) == pytest.approx(corners_of(true, SHAPE), abs=0.2)
    assert likeness(texture, reference, found) > 0.999
    assert shift_left(texture, reference, found) < 0.02


def test_what_is_left_is_measured(texture: NDArray) -> None:
    reference = np.nan_to_num(cut(texture, translation(50.0, 40.0), SHAPE))
    assert shift_left(texture, reference, translation(50.6, 40.8)) == pytest.approx(1.0, abs=0.05)


def test_a_tile_that_looks_different_stays_where_it_was(texture: NDArray) -> None:
    reference = np.random.default_rng(4).normal(size=SHAPE).astype(np.float32)
    start = translation(50.0, 40.0)
    assert (aligned(texture, reference, start) == start).all()


def test_a_tile_beyond_the_sheet_is_not_known_there(texture: NDArray) -> None:
    tile = cut(texture, translation(-10.0, 5.0), SHAPE)
    assert np.isnan(tile[:, :10]).all()
    assert np.isfinite(tile[:, 10:]).all()


def test_one_sheet_tells_true_positions_from_noisy_tiles() -> None:
    rng = np.random.default_rng(7)
    numbers = np.stack(np.meshgrid(np.arange(6), np.arange(4)), axis=-1).reshape(-1, 2)
    sheet = np.array([[1.002, 0.003, 0.0], [-0.002, 0.999, 0.0], [2e-5, -3e-5, 1.0]])
    steps = np.array([[83.1, 0.2], [-0.3, 62.4]])
    reference = 8
    own = translation(120.0, 70.0)
    away = (numbers - numbers[reference]) @ steps
    true = np.stack([sheet @ translation(*step) @ np.linalg.inv(sheet) @ own for step in away])
    noisy = np.stack([translation(*rng.normal(0, 0.4, 2)) @ homography for homography in true])
    noisy[reference] = own
    noisy[3] = translation(9.0, -7.0) @ noisy[3]  # one that went wrong
    found, residual = of_one_sheet(noisy, numbers, np.diag([84.0, 62.0]), SHAPE, reference)
    away = [
        np.linalg.norm(corners_of(a, SHAPE) - corners_of(b, SHAPE), axis=1) for a, b in zip(found, true, strict=True)
    ]
    assert np.sqrt(np.mean(np.square(away))) < 0.2
    assert found[reference] == pytest.approx(own, abs=1e-9)
    assert 0.1 < residual < 0.8
