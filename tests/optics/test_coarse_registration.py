from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pipeline.optics.coarse_registration import coarse_motion, coarse_turn, edge_images
from pipeline.optics.imaging import seen_by_lens
from pipeline.optics.rigid import RigidMotion, corner_px

SIZE = (200, 240)
ROWS, COLUMNS = np.indices(SIZE)
STRIPES = (COLUMNS // 12 % 2).astype(np.float32)


ROW_CUTS, COLUMN_CUTS = [44, 57, 80, 96, 127, 141], [37, 62, 74, 103, 119, 150, 158, 191]


def blocks(seed: int) -> np.ndarray:
    """Blocks of random brightness on dark ground, always the same blocks."""
    bright = np.random.default_rng(seed).uniform(0.2, 1, (7, 9))
    bright = bright[np.digitize(ROWS, ROW_CUTS), np.digitize(COLUMNS, COLUMN_CUTS)]
    inside = (ROWS > 30) & (ROWS < 165) & (COLUMNS > 25) & (COLUMNS < 210)
    return np.where(inside, bright, 0.05).astype(np.float32)


def photo(scene: np.ndarray, motion: RigidMotion) -> list[np.ndarray]:
    return edge_images(seen_by_lens(scene, blur_px=1.0, shift_px=motion.shift_px, turn_rad=motion.turn_rad))


REFERENCE = photo(blocks(0), RigidMotion())


@settings(deadline=None, max_examples=20)
@given(st.floats(-0.08, 0.08), st.tuples(st.floats(-15, 15), st.floats(-15, 15)), st.integers(1, 5))
@example(0.0, (-15.0, 15.0), 1)
@example(0.08, (12.0, 3.0), 1)
def test_a_motion_is_found_to_a_pixel_although_every_block_changes_its_brightness(turn_rad, shift_px, seed):
    moved = photo(blocks(seed), RigidMotion(turn_rad, shift_px))
    found = coarse_turn(REFERENCE, moved, largest_px=20, largest_rad=0.1)
    assert abs(found - turn_rad) * corner_px(SIZE) < 2
    start = coarse_motion(REFERENCE[-1], moved[-1], largest_px=20, turn_rad=found)
    np.testing.assert_allclose(start.motion.shift_px, shift_px, atol=1.5)
    assert not start.ambiguous


def test_small_turns_are_left_to_the_patches():
    moved = photo(blocks(1), RigidMotion(0.4 / corner_px(SIZE)))
    assert coarse_turn(REFERENCE, moved, largest_px=20, largest_rad=0.1) == 0


def test_shifts_beyond_the_limit_are_not_looked_for():
    moved = photo(blocks(1), RigidMotion(0.0, (0.0, 15.0)))
    found = coarse_motion(REFERENCE[-1], moved[-1], largest_px=6).motion
    assert np.abs(found.shift_px).max() <= 6


@pytest.mark.parametrize(("scene", "ambiguous"), [(STRIPES, True), (STRIPES * (np.abs(ROWS - 100) < 60), False)])
def test_stripes_are_ambiguous_unless_they_end(scene, ambiguous):
    first, second = photo(scene, RigidMotion()), photo(scene, RigidMotion(0.0, (2.0, 1.0)))
    assert coarse_motion(first[-1], second[-1], largest_px=9).ambiguous is ambiguous


def test_photographs_without_edges_are_ambiguous():
    even = edge_images(np.full(SIZE, 0.5, np.float32))
    assert coarse_motion(even[-1], even[-1], largest_px=9).ambiguous
