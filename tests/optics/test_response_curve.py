from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics.jones import polarizer_response
from pipeline.optics.response_curve import (
    FilmedGrating,
    StokesNoise,
    harmonic_design,
    orientation_bound,
    relative_stokes,
    response_curve,
)

EQUAL = np.arange(12) * np.pi / 12
angles = st.floats(-np.pi, np.pi)


@given(angles, angles, st.floats(0.5, 2), angles, angles, angles)
def test_the_three_numbers_are_the_intensity_behind_the_polariser(psi, theta, r, zeta, film, axis):
    m, s1, s2 = relative_stokes(theta, FilmedGrating(r, zeta, film, axis))
    expected = polarizer_response(
        psi, theta, amplitude_ratio=r, phase_rad=zeta, retardation_rad=film, film_axis_rad=axis
    )
    assert m * (1 + s1 * np.cos(2 * psi) + s2 * np.sin(2 * psi)) == pytest.approx(expected, abs=1e-12)
    assert np.hypot(s1, s2) <= 1 + 1e-12


@given(angles, st.floats(0.5, 2), angles, angles, angles)
def test_a_grating_with_its_axes_exchanged_lies_across(theta, r, zeta, film, axis):
    _, *here = relative_stokes(theta, FilmedGrating(r, zeta, film, axis))
    _, *across = relative_stokes(theta + np.pi / 2, FilmedGrating(1 / r, -zeta, film, axis))
    np.testing.assert_allclose(here, across, atol=1e-9)


@given(angles, st.floats(0.5, 2), angles, angles, angles, angles)
def test_turning_sample_and_film_turns_the_curve_by_twice_as_much(theta, r, zeta, film, axis, turn):
    m, s1, s2 = relative_stokes(theta, FilmedGrating(r, zeta, film, axis))
    turned = relative_stokes(theta + turn, FilmedGrating(r, zeta, film, axis + turn))
    assert turned[0] == pytest.approx(m)
    assert turned[1] + 1j * turned[2] == pytest.approx((s1 + 1j * s2) * np.exp(2j * turn), abs=1e-9)


def test_without_a_film_the_curve_is_the_circle_of_equation_9():
    r, zeta = 1.1, np.deg2rad(45)
    curve = response_curve(FilmedGrating(r, zeta))
    radius = np.hypot((1 - r**2) / 2, r * np.sin(zeta)) / ((1 + r**2) / 2)
    np.testing.assert_allclose(np.hypot(*curve.stokes.T), radius, rtol=1e-12)
    np.testing.assert_allclose(curve.brightness, (1 + r**2) / 2)
    angle = np.unwrap(np.arctan2(*curve.stokes.T[::-1]))
    np.testing.assert_allclose(np.diff(angle), 2 * np.pi / len(angle), rtol=1e-9)


def test_slopes_are_derivatives():
    curve = response_curve(FilmedGrating(1.2, 0.8, 0.4, 0.3), 4096)
    numeric = np.gradient(curve.stokes, np.pi / 4096, axis=0)[1:-1]
    np.testing.assert_allclose(curve.slope[1:-1], numeric, atol=2e-5)


@pytest.mark.parametrize("weights", [np.ones(7), np.array([1, 2, 0.5, 1, 1, 3, 1])])
def test_noise_of_the_stokes_parameters_is_that_of_repeated_photographs(weights):
    psi = np.deg2rad([0, 20, 47, 80, 101, 140, 165])
    stokes, electrons = np.array([[0.5, -0.4]]), 4000
    design = harmonic_design(psi)
    expected = electrons * (1 + stokes @ design[:, 1:].T)[0]
    rng = np.random.default_rng(0)
    photos = rng.poisson(expected, (60_000, 7))
    root = np.sqrt(weights)[:, None]
    sums = photos @ (np.linalg.pinv(design * root) * root.T).T
    noise = StokesNoise(psi, weights)
    covariance = np.cov((sums[:, 1:] / sums[:, :1]).T) * electrons
    np.testing.assert_allclose(covariance, noise.covariance(stokes)[0], rtol=0.04, atol=0.01)
    left = ((photos - sums @ design.T) ** 2 @ weights).mean() / electrons
    assert left == pytest.approx(noise.residual(stokes)[0], rel=0.03)


def test_the_bound_of_a_circle_is_the_closed_form():
    """Of a phase in ``1 + rho cos(2 psi - x)`` over many photographs: ``1 / (K m (1 - sqrt(1 - rho^2)))``."""
    psi = np.arange(600) * np.pi / 600
    curve = response_curve(FilmedGrating(1.0, np.deg2rad(40)), 16)
    rho = np.sin(np.deg2rad(40))
    bound = orientation_bound(curve, psi, 50.0)
    np.testing.assert_allclose(bound, 0.5 / np.sqrt(600 * 50 * (1 - np.sqrt(1 - rho**2))), rtol=1e-3)


def test_no_curve_no_bound():
    bound = orientation_bound(response_curve(FilmedGrating(1.0, np.pi), 4), EQUAL, 1e4)
    assert bound.min() > 1e3
