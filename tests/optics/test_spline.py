from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from pipeline.optics.spline import quintic_slope_taps, quintic_taps

QUINTIC = BSpline.basis_element(np.arange(-3.0, 4.0), extrapolate=False)


@settings(deadline=None)
@given(st.floats(0, 0.999999))
def test_the_taps_are_those_of_the_basis_spline_and_the_slopes_of_its_derivative(fraction):
    distance = fraction - np.arange(-2.0, 4.0)
    np.testing.assert_allclose(quintic_taps(fraction), np.nan_to_num(QUINTIC(distance)), atol=1e-14)
    np.testing.assert_allclose(quintic_slope_taps(fraction), np.nan_to_num(QUINTIC.derivative()(distance)), atol=1e-14)


@settings(deadline=None)
@given(st.floats(0, 0.999999))
def test_the_weights_sum_to_one_and_the_slopes_to_zero(fraction):
    assert sum(quintic_taps(fraction)) == pytest.approx(1, abs=1e-12)
    assert sum(quintic_slope_taps(fraction)) == pytest.approx(0, abs=1e-12)
