"""Two maps of one product laid on each other."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.optics.imaging import area_average
from pipeline.optics.rigid import RigidMotion
from pipeline.optics.rigid_sampling import resampled
from pipeline.optics.superposition import channels_of, superpose

SIZE = 160
OVER = 3


def scene(motion: RigidMotion, *, noise: float = 0.003, seed: int = 0, hole: bool = False):
    """Brightness and orientation of a made-up product, whose pixels show what lies where ``motion`` leads."""
    place = (np.arange(OVER * SIZE) + 0.5) / OVER - 0.5
    rows, columns = np.meshgrid(place, place, indexing="ij")
    there = motion.apply(np.stack([rows.ravel(), columns.ravel()]), (SIZE, SIZE), (SIZE, SIZE))
    down, right = (there - (SIZE - 1) / 2).reshape(2, OVER * SIZE, OVER * SIZE)
    radius, angle = np.hypot(down, right), np.arctan2(-down, right)
    sector = np.floor((angle + 0.2 * (radius > 30) + 0.1) / (2 * np.pi) * 7).astype(int) % 7
    printed = (radius < 60) & ~(hole & (np.abs(down + 25) < 15) & (np.abs(right) < 18))
    bright = np.where(printed, np.array([0.5, 1.0, 0.7, 1.0, 0.5, 0.8, 0.7])[sector], 0.03)
    theta = np.array([0.1, 0.5, 1.0, 1.4, 2.0, 2.3, 2.9])[sector] - motion.turn_rad
    stokes = [bright, printed * bright * np.cos(2 * theta), printed * bright * np.sin(2 * theta)]
    random = np.random.default_rng(seed)
    seen = [
        area_average(cv2.GaussianBlur(s.astype(np.float32), (0, 0), 0.7 * OVER), OVER)
        + random.normal(0, noise, (SIZE, SIZE))
        for s in stokes
    ]
    orientation = np.mod(np.arctan2(seen[2], seen[1]) / 2, np.pi)
    return seen[0].astype(np.float32), np.where(seen[0] > 0.25, orientation, np.nan)


def test_a_turn_is_anticlockwise_and_a_shift_is_down_and_right() -> None:
    quarter = RigidMotion(np.pi / 2, (3.0, -2.0))
    right_of_centre = np.array([[10.0], [14.0]])
    moved = quarter.apply(right_of_centre, (21, 21), (21, 21))
    np.testing.assert_allclose(moved[:, 0], [10 - 4 + 3, 10 - 2], atol=1e-12)


def test_after_is_one_motion_after_another() -> None:
    first_turn, first_shift = 0.3, np.array([2.0, -5.0])
    motion = RigidMotion(-0.8, (4.0, 1.0), 1.3)
    place = np.random.default_rng(0).uniform(0, 40, (2, 9))
    between = RigidMotion(first_turn, (2.0, -5.0)).apply(place, (41, 41), (41, 41))
    one_by_one = motion.apply(between, (41, 41), (41, 41))
    np.testing.assert_allclose(motion.after(first_turn, first_shift).apply(place, (41, 41), (41, 41)), one_by_one)


def test_resampling_reads_where_the_motion_leads() -> None:
    rows, columns = np.mgrid[:30, :40].astype(np.float32)
    motion = RigidMotion(0.2, (1.5, -0.7))
    place = np.array([[15.0, 12.0], [20.0, 22.0]])
    expected = motion.apply(place, (30, 40), (30, 40))
    for image, want in ((rows, expected[0]), (columns, expected[1])):
        read = resampled(image, motion, (30, 40))
        np.testing.assert_allclose(read[place[0].astype(int), place[1].astype(int)], want, atol=1e-3)


@settings(max_examples=5, deadline=None)
@given(st.floats(-25, 25), st.floats(-9, 9), st.floats(-9, 9), st.floats(0, 3))
def test_any_turn_shift_and_offset_is_found(turn_deg: float, down: float, right: float, offset: float) -> None:
    back = RigidMotion(np.deg2rad(-turn_deg)).after(0.0, np.array([-down, -right]))
    reference, other = scene(RigidMotion()), scene(back, seed=1)
    found = superpose(
        channels_of(*reference), channels_of(other[0], other[1] + offset), scale=1.0, largest_turn_rad=0.6
    )
    assert np.rad2deg(found.motion.turn_rad) == pytest.approx(turn_deg, abs=0.02)
    np.testing.assert_allclose(found.motion.shift_px, [down, right], atol=0.02)
    assert found.agreement > 0.97


def test_it_agrees_with_opencv_where_brightness_is_enough() -> None:
    back = RigidMotion(np.deg2rad(-2.0)).after(0.0, np.array([1.3, -0.6]))
    reference, other = scene(RigidMotion()), scene(back, seed=1)
    found = superpose(channels_of(*reference), channels_of(*other), scale=1.0, largest_turn_rad=0.2).motion
    warp = np.eye(2, 3, dtype=np.float32)
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-8)
    _, warp = cv2.findTransformECC(reference[0], other[0], warp, cv2.MOTION_EUCLIDEAN, stop, None, 5)
    for row, column in ((30, 40), (120, 60), (80, 130)):
        theirs = warp @ [column, row, 1]
        ours = found.apply(np.array([[row], [column]], float), (SIZE, SIZE), (SIZE, SIZE))[::-1, 0]
        np.testing.assert_allclose(ours, theirs, atol=0.03)


def test_a_large_defect_does_not_pull() -> None:
    back = RigidMotion(np.deg2rad(3.0)).after(0.0, np.array([2.4, 1.1]))
    other = scene(back, seed=1)
    whole, damaged = (
        superpose(channels_of(*scene(RigidMotion(), hole=hole)), channels_of(*other), scale=1.0, largest_turn_rad=0.2)
        for hole in (False, True)
    )
    assert damaged.motion.turn_rad == pytest.approx(whole.motion.turn_rad, abs=np.deg2rad(0.05))
    np.testing.assert_allclose(damaged.motion.shift_px, whole.motion.shift_px, atol=0.05)


def test_a_camera_of_another_pitch_is_allowed_for() -> None:
    bright, theta = scene(RigidMotion())
    coarse = cv2.resize(bright, (80, 80), interpolation=cv2.INTER_AREA)
    found = superpose(channels_of(bright, theta), channels_of(coarse, theta[::2, ::2]), scale=0.5, largest_turn_rad=0.1)
    assert abs(found.motion.turn_rad) < np.deg2rad(0.5)
    np.testing.assert_allclose(found.motion.shift_px, [0, 0], atol=0.3)


def test_what_does_not_agree_says_so() -> None:
    reference = channels_of(*scene(RigidMotion()))
    random = np.random.default_rng(0)
    other = channels_of(random.uniform(0, 1, (SIZE, SIZE)), random.uniform(0, np.pi, (SIZE, SIZE)))
    assert superpose(reference, other, scale=1.0, largest_turn_rad=0.1).agreement < 0.2
