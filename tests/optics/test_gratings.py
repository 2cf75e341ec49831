"""Order efficiencies, widths and geometry of sinusoidal gratings."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics.gratings import (
    highest_order,
    order_efficiency,
    order_efficiency_second_order,
    window_spread,
)


@given(st.floats(0, 20))
def test_orders_share_all_the_light(phase_depth: float) -> None:
    assert order_efficiency(np.arange(-60, 61), phase_depth).sum() == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("phase_depth", [0.3, 2.0, 5.0])
def test_orders_are_the_fourier_series_of_the_profile(phase_depth: float) -> None:
    t = np.arange(4096) / 4096
    height = (1 + np.cos(2 * np.pi * t)) / 2
    series = np.fft.fft(np.exp(1j * phase_depth * height)) / t.size
    expected = np.abs(series[:8]) ** 2
    np.testing.assert_allclose(order_efficiency(np.arange(8), phase_depth), expected, atol=1e-12)


def test_a_flat_grating_is_a_mirror() -> None:
    np.testing.assert_array_equal(order_efficiency([0, 1, 2], 0.0), [1, 0, 0])


def test_second_order_form_converges_to_the_exact_one() -> None:
    orders = np.arange(-2, 3)
    errors = [
        np.abs(order_efficiency_second_order(orders, q) - order_efficiency(orders, q)).max() for q in (0.8, 0.4, 0.2)
    ]
    assert errors[1] / errors[0] == pytest.approx(1 / 16, rel=0.15)
    assert errors[2] / errors[1] == pytest.approx(1 / 16, rel=0.15)
    assert order_efficiency_second_order(3, 0.5) == 0


def test_the_window_is_the_transform_of_its_gaussian() -> None:
    sigma_s, wavelength = 65 / 4, 0.53
    spread = window_spread(wavelength, 65.0)
    k = 2 * np.pi / wavelength
    assert np.exp(-0.5) == pytest.approx(np.exp(-(sigma_s**2) * (k * spread) ** 2))


def test_first_order_of_a_normal_incidence_grating_can_be_reached() -> None:
    assert highest_order(1.0, 0.5, 0.49) >= 1
    assert highest_order(1.0, 0.5, 1.9) >= 4
