from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import circmean

from pipeline.optics.angles import axial_difference, axial_mean, axial_median, wrap_axial

angles = st.floats(-20, 20, allow_nan=False)


def test_a_difference_across_the_wrap_is_small_and_signed():
    assert axial_difference(np.deg2rad(2), np.deg2rad(179)) == pytest.approx(np.deg2rad(3))
    assert axial_difference(np.deg2rad(179), np.deg2rad(2)) == pytest.approx(np.deg2rad(-3))


@given(angles, angles)
def test_the_difference_turns_one_line_onto_the_other(left, right):
    turn = float(axial_difference(left, right))
    assert -np.pi / 2 <= turn < np.pi / 2
    assert np.sin(right + turn - left) == pytest.approx(0, abs=1e-9)


@given(angles)
def test_wrapping_stays_below_pi(angle):
    wrapped = float(wrap_axial(angle))
    assert 0 <= wrapped < np.pi
    assert np.sin(wrapped - angle) == pytest.approx(0, abs=1e-9)


def test_the_mean_is_that_of_scipy():
    sample = np.random.default_rng(0).normal(3.1, 0.3, 500)
    assert axial_mean(sample) == pytest.approx(circmean(sample, high=np.pi, low=0), abs=1e-12)


def test_the_median_ignores_a_third_of_outliers_beyond_the_wrap():
    sample = np.concatenate([np.deg2rad([178, 179, 180, 181, 182] * 20), np.full(50, np.deg2rad(60)), [np.nan]])
    assert abs(axial_difference(axial_median(sample), 0)) <= np.deg2rad(1) + 1e-9
    assert abs(axial_difference(axial_mean(sample), 0)) > np.deg2rad(5)


@given(st.lists(angles, min_size=3, max_size=15))
def test_no_other_angle_has_a_smaller_mean_absolute_difference(sample):
    def cost(centre):
        return np.mean(np.abs(axial_difference(np.array(sample), centre)))

    found = cost(axial_median(sample))
    assert found <= min(cost(a) for a in sample) + np.deg2rad(12)
    assert found <= cost(axial_mean(sample)) + 1e-9


def test_nothing_to_average_is_nan():
    assert np.isnan(axial_mean([np.nan]))
    assert np.isnan(axial_median([]))
