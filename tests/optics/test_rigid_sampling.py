from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from pipeline.optics.rigid import RigidMotion
from pipeline.optics.rigid_sampling import resampled, sample_rigid
from pipeline.optics.spline import quintic_coefficients

IMAGE = ndimage.gaussian_filter(np.random.default_rng(0).random((60, 81)), 1.5).astype(np.float32)
COEFFICIENTS = quintic_coefficients(IMAGE)
SHIFTS = st.tuples(st.floats(-6, 6), st.floats(-6, 6))
TURNS = st.floats(-0.2, 0.2)
SCALES = st.one_of(st.just(1.0), st.floats(0.8, 1.2))


@settings(deadline=None, max_examples=20)
@given(st.builds(RigidMotion, TURNS, SHIFTS, SCALES))
def test_moving_matches_scipy_to_the_border(motion):
    places = motion.apply(np.indices(IMAGE.shape).reshape(2, -1), IMAGE.shape, IMAGE.shape).reshape(2, *IMAGE.shape)
    expected = ndimage.map_coordinates(IMAGE.astype(np.float64), places, order=5, mode="mirror")
    np.testing.assert_allclose(sample_rigid(COEFFICIENTS, motion), expected, atol=3e-6)


@settings(deadline=None, max_examples=10)
@given(SHIFTS)
def test_a_turn_that_vanishes_goes_over_into_a_translation(shift):
    vanishing = sample_rigid(COEFFICIENTS, RigidMotion(1e-9, shift))
    np.testing.assert_allclose(vanishing, sample_rigid(COEFFICIENTS, RigidMotion(0.0, shift)), atol=1e-6)


@settings(deadline=None, max_examples=10)
@given(st.builds(RigidMotion, st.floats(-0.1, 0.1), st.tuples(st.floats(-2, 2), st.floats(-2, 2))))
def test_a_motion_and_its_inverse_give_a_smooth_picture_back(motion):
    there = sample_rigid(COEFFICIENTS, motion)
    back = sample_rigid(quintic_coefficients(there), motion.inverse)
    np.testing.assert_allclose(back[16:-16, 16:-16], IMAGE[16:-16, 16:-16], atol=1e-3)


def test_what_the_inverse_samples_lies_where_the_motion_takes_it():
    spot = np.zeros((41, 41), np.float32)
    spot[20, 30] = 1  # ten pixels right of the centre
    moved = sample_rigid(quintic_coefficients(spot), RigidMotion(np.pi / 2, (2.0, -1.0)).inverse)
    assert np.unravel_index(moved.argmax(), moved.shape) == (12, 19)


def test_a_mask_moves_with_its_picture_and_ends_at_the_border():
    mask = np.ones((41, 41))
    mask[20, 30] = 0
    moved = resampled(mask, RigidMotion(np.pi / 2, (2.0, -1.0)).inverse, mask.shape, order=0, outside=0.0)
    assert not moved[12, 19]
    assert moved[12, 18]
    assert not moved[:2].any()  # came from beyond the border
    assert not moved[:, -1].any()
