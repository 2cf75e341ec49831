from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from pipeline.optics.spline import quintic_coefficients
from pipeline.optics.translation import sample_translated

IMAGE = ndimage.gaussian_filter(np.random.default_rng(0).random((60, 80)), 1.0).astype(np.float32)


@settings(deadline=None, max_examples=20)
@given(st.floats(-9, 9), st.floats(-9, 9))
def test_moving_matches_scipy_to_the_border(down, right):
    found = sample_translated(quintic_coefficients(IMAGE), (down, right))
    expected = ndimage.shift(IMAGE.astype(np.float64), (-down, -right), order=5, mode="mirror")
    np.testing.assert_allclose(found, expected, atol=2e-6)


def test_no_shift_gives_the_image_back():
    np.testing.assert_allclose(sample_translated(quintic_coefficients(IMAGE), (0.0, 0.0)), IMAGE, atol=1e-6)


def test_a_positive_shift_reads_from_further_down_and_right():
    ramp = (np.arange(40.0)[:, None] * 2 + np.arange(50.0)).astype(np.float32)
    moved = sample_translated(quintic_coefficients(ramp), (0.25, 0.5))
    np.testing.assert_allclose((moved - ramp)[15:-15, 15:-15], 1.0, atol=1e-3)
