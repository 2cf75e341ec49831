"""Places of orders: the grating equation both ways, and lines whose middles are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pipeline.optics.diffraction.order_peaks import (
    order_angle,
    order_peaks,
    order_period,
    plane_of_incidence,
    strongest_ridge,
)
from pipeline.optics.diffraction.patch import frequency_sigma

LIGHT = float(np.deg2rad(75))
WAVELENGTH = np.arange(0.38, 0.781, 0.02)
VIEW = np.deg2rad(np.linspace(-89.5, 89.5, 1791))
SIGMA = frequency_sigma(65)


def lines(period_um: float, *, steep: float = 0.0, light: float = LIGHT) -> NDArray[np.float64]:
    """A Gaussian line at every order, its brightness ``exp(steep w / lambda)``."""
    frequency = (np.sin(VIEW) + np.sin(light)) / WAVELENGTH[:, None]
    away = (frequency * period_um - np.rint(frequency * period_um)) / period_um
    per_um = -(np.cos(light) + np.cos(VIEW)) / WAVELENGTH[:, None]
    return np.exp(-((away / SIGMA) ** 2) + steep * per_um)


def test_the_sources_grating_equation() -> None:
    """Algorithm 3.1: ``asin(lambda / d - sin(75 degrees))``, and first orders of an echelle by hand."""
    assert np.rad2deg(order_angle(2.5, 0.5, 1, LIGHT)) == pytest.approx(-49.9894, abs=1e-4)
    assert order_angle(1.2, [0.6], 1, 0.0) == pytest.approx(np.deg2rad([30.0]))
    assert order_angle(1.2, [0.6], -1, 0.0) == pytest.approx(np.deg2rad([-30.0]))
    assert np.isnan(order_angle(0.3, 0.6, 1, 0.0))


@given(
    period_um=st.floats(0.5, 20),
    wavelength_um=st.floats(0.38, 0.78),
    order=st.sampled_from([-2, -1, 1, 2, 3]),
    light_deg=st.floats(0, 85),
)
def test_the_grating_equation_goes_both_ways(
    period_um: float, wavelength_um: float, order: int, light_deg: float
) -> None:
    light = np.deg2rad(light_deg)
    angle = order_angle(period_um, wavelength_um, order, light)
    if np.isfinite(angle):
        assert order_period(angle, wavelength_um, order, light) == pytest.approx(period_um, rel=1e-6)


def test_orders_stand_where_stams_uvw_put_them() -> None:
    """``(u, v) / lambda`` is a whole number of the lattice's frequencies, seen from the other end."""
    azimuth = 0.7
    u, v, w = plane_of_incidence(LIGHT, azimuth, order_angle(1.6, WAVELENGTH, 2, LIGHT)).uvw
    frequency = np.stack([u, v])[..., 0] / WAVELENGTH
    assert frequency == pytest.approx(-2 / 1.6 * np.stack([[np.cos(azimuth)], [np.sin(azimuth)]]) + 0 * frequency)
    assert (w < -np.cos(LIGHT)).all()


@settings(max_examples=30, deadline=None)
@given(period_um=st.floats(0.9, 4), steep=st.floats(-3, 3), off=st.floats(0.88, 1.12))
def test_the_middle_of_a_line_is_found_whatever_its_brightness(period_um: float, steep: float, off: float) -> None:
    peak, middle = order_peaks(
        lines(period_um, steep=steep),
        VIEW,
        WAVELENGTH,
        order=1,
        light_rad=LIGHT,
        near_um=period_um * off,
        share=0.2,
        contrast=4,
        least=1e-6,
    )
    assert order_period(middle, WAVELENGTH, 1, LIGHT) == pytest.approx(period_um, rel=2e-5)
    if steep:
        assert (np.sign(peak - middle) == np.sign(steep * middle)).mean() > 0.9 or abs(steep) < 0.1


def test_the_brightest_angle_lies_beside_the_middle_by_slope_over_curvature() -> None:
    steep, period = 3.0, 2.5
    peak, middle = order_peaks(
        lines(period, steep=steep),
        VIEW,
        WAVELENGTH,
        order=1,
        light_rad=LIGHT,
        near_um=2.5,
        share=0.2,
        contrast=4,
        least=1e-6,
    )
    slope = steep * np.tan(middle) / WAVELENGTH
    expected = slope * (WAVELENGTH * SIGMA) ** 2 / 2
    assert np.sin(peak) - np.sin(middle) == pytest.approx(expected, rel=0.02)
    assert np.abs(order_period(peak, WAVELENGTH, 1, LIGHT) - period).max() > 1e-3


@pytest.mark.parametrize("order", [-2, -1, 1, 2])
def test_orders_are_told_apart_by_sign_and_number(order: int) -> None:
    light = np.deg2rad(10)
    _, middle = order_peaks(
        lines(2.5, light=light),
        VIEW,
        WAVELENGTH,
        order=order,
        light_rad=light,
        near_um=2.4,
        share=0.2,
        contrast=4,
        least=1e-6,
    )
    assert middle == pytest.approx(order_angle(2.5, WAVELENGTH, order, light), abs=1e-6)


@pytest.mark.parametrize(
    ("response", "near_um"),
    [(np.ones((len(WAVELENGTH), len(VIEW))), 2.5), (lines(2.5), 1.9), (lines(2.5) + 0.5, 2.5), (lines(2.5), np.nan)],
)
def test_no_peak_is_made_up(response: NDArray[np.float64], near_um: float) -> None:
    """Nothing but one brightness, a line outside the range, a line of three times what lies around it, no range."""
    peak, middle = order_peaks(
        response,
        VIEW,
        WAVELENGTH,
        order=1,
        light_rad=LIGHT,
        near_um=near_um,
        share=0.2,
        contrast=4,
        least=1e-6,
    )
    assert np.isnan(peak).all()
    assert np.isnan(middle).all()


def test_the_strongest_ridge_is_the_line_that_stands_out() -> None:
    frequency = (np.sin(VIEW) + np.sin(LIGHT)) / WAVELENGTH[:, None]
    slope = np.exp(-3 * np.abs(frequency))
    ridge = slope * (1 + 20 * np.exp(-(((frequency - 1 / 1.3) / SIGMA) ** 2)))
    asked = {"light_rad": LIGHT, "share": 0.2, "least": 1e-6, "sigma_per_um": SIGMA}
    assert strongest_ridge(ridge, VIEW, WAVELENGTH, order=1, **asked) == pytest.approx(1.3, rel=0.01)
    assert strongest_ridge(ridge, VIEW, WAVELENGTH, order=2, **asked) == pytest.approx(2.6, rel=0.01)
    assert np.isnan(strongest_ridge(ridge, VIEW, WAVELENGTH, order=-1, **asked))
    assert np.isnan(strongest_ridge(np.zeros_like(ridge), VIEW, WAVELENGTH, order=1, **asked))
