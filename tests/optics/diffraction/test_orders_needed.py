"""How many terms a tolerance needs, and what geometry and Fresnel reflection make of a response."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import chebyshev as polynomials

from pipeline.optics.diffraction.chebyshev import chebyshev_response, degree_for
from pipeline.optics.diffraction.directions import Directions, disc_of_views, relative_gain, schlick, unit_vector
from pipeline.optics.diffraction.evaluators import (
    Evaluator,
    Recipe,
    prepared,
    terms_and_error,
    wavelength_step_nm,
)
from pipeline.optics.diffraction.patch import Patch, frequency_sigma
from pipeline.optics.diffraction.taylor import taylor_error, taylor_terms


@given(st.floats(0, 40), st.sampled_from([1e-2, 1e-4, 1e-6, 1e-9]))
def test_polynomials_hold_their_tolerance_and_few_are_wasted(phase: float, tolerance: float) -> None:
    def error(count: int) -> float:
        nodes = polynomials.chebpts1(count) if count > 1 else np.zeros(1)
        found = np.linalg.solve(polynomials.chebvander(nodes, count - 1), np.exp(1j * phase * nodes))
        t = np.linspace(-1, 1, 801)
        return float(np.abs(polynomials.chebval(t, found) - np.exp(1j * phase * t)).max())

    count = degree_for(phase, tolerance)
    assert error(count) < tolerance + 1e-12
    if count > 3:
        assert error(count - 3) > tolerance


@given(st.floats(0, 30), st.sampled_from([1e-2, 1e-4, 1e-8]))
def test_taylor_terms_hold_their_tolerance(phase: float, tolerance: float) -> None:
    count = taylor_terms(phase, tolerance)
    left = sum((1j * phase) ** n / math.factorial(n) for n in range(count, min(count + 60, 165)))
    assert abs(left) <= tolerance * 1.001


@pytest.mark.parametrize("phase", [5.0, 20.0, 40.0])
def test_taylor_terms_that_cancel_err_within_the_bound_and_not_far_below(phase: float) -> None:
    total, term = 0j, 1 + 0j
    for n in range(1, 300):
        total, term = total + term, term * 1j * phase / n
    error = abs(total - np.exp(1j * phase))
    assert taylor_error(phase, 299) / 1e3 < error < taylor_error(phase, 299)


@pytest.mark.parametrize(("terms", "published"), [(20, 2.9950e-4), (25, 8.8150e-8), (30, 1.0050e-11)])
def test_the_published_bound_for_a_bump_of_stam_is_met_by_those_terms(terms: int, published: float) -> None:
    """Single 2014, below equation 1.51: ``exp(x) x^(N + 1) / (N + 1)!`` at 1.5 pi."""
    x = 1.5 * np.pi
    assert np.exp(x) * x ** (terms + 1) / math.factorial(terms + 1) == pytest.approx(published, rel=2e-3)
    assert taylor_terms(x, published) <= terms + 1


@settings(max_examples=30, deadline=None)
@given(st.floats(0.01, 20), st.sampled_from(["chebyshev", "flss"]))
def test_no_error_below_single_precision_is_promised(relief_um: float, evaluator: Evaluator) -> None:
    directions, lam = disc_of_views(unit_vector(0.4), 8), np.array([0.4, 0.6])
    patch = Patch(np.array([[0.0, relief_um]]), 0.1)
    found = terms_and_error(Recipe(evaluator, tolerance=1e-9), patch, directions, lam)
    assert found is not None
    assert found[1] > 1e-7


@pytest.mark.parametrize("relief_um", [0.3, 4.0, 40.0])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 1e-9])
def test_the_error_that_is_stated_is_held(relief_um: float, tolerance: float) -> None:
    """Of two levels, whose phases round alike, beside a dark place, where the amplitude is small."""
    directions, lam = disc_of_views(unit_vector(0.4, 0.5), 8), np.array([0.4, 0.6])
    patch = Patch(np.tile([0.0, 0.0, relief_um], (2, 3)), 0.2)
    recipe = Recipe("chebyshev", 3.0, tolerance)
    terms, bound = terms_and_error(recipe, patch, directions, lam) or (0, np.nan)
    amplitudes = []
    for one in (recipe, Recipe("direct", 3.0)):
        out = np.empty((2, 8, 8), np.float32)
        prepared(one, patch, directions, lam).rows(directions.uvw, lam, np.eye(2), out)(0, 8)
        amplitudes.append(np.sqrt(out))
    assert np.abs(amplitudes[0] - amplitudes[1]).max() < 2 * max(bound, tolerance) + 1e-6
    assert (bound > tolerance) == (tolerance < 1e-6 or (tolerance < 1e-4 and relief_um > 30))
    table = chebyshev_response(patch, directions.uvw, lam, coherence_um=3.0, tolerance=tolerance).table
    assert table.shape[1] == terms


def test_wavelengths_are_a_trapezoid_rule_apart_that_holds_the_tolerance() -> None:
    """An order and the finest fringes of a relief, summed with any offset of the steps."""
    directions = Directions(unit_vector(0.9)[None, None], unit_vector(np.array([[0.3, 0.6]])))
    u = float(np.abs(directions.uvw[0]).max())
    sigma = 0.38**2 * frequency_sigma(20.0) / np.sqrt(2) / u * 1000
    step = wavelength_step_nm(directions, 20.0, 0.0, 1e-2, 380.0)
    for part, least, most in ((1.0, 0.008, 0.011), (0.5, 0, 1e-6)):
        sums = [
            np.exp(-0.5 * ((np.arange(-99, 100) + at) * part * step / sigma) ** 2).sum()
            * part
            * step
            / (sigma * np.sqrt(2 * np.pi))
            for at in np.linspace(0, 1, 9)
        ]
        assert least <= np.abs(np.array(sums) - 1).max() < most
    deep = wavelength_step_nm(directions, 1e-6, 7.0, 1e-2, 380.0)
    w = float(np.abs(directions.uvw[2]).max())
    assert 380 / deep == pytest.approx(w * 7.0 / 0.38, rel=1e-3)


def test_a_quarter_as_many_polynomials_as_taylor_terms_do() -> None:
    phase = 2 * np.pi * 2 / 0.38 * 0.8187
    assert degree_for(phase / 4, 1e-4) * 4 < taylor_terms(phase, 1e-4)


def test_a_mirror_at_normal_incidence_has_gain_one_and_grazing_views_stay_finite() -> None:
    straight = Directions(unit_vector(0.0)[None, None], unit_vector(np.zeros((1, 1))))
    assert relative_gain(straight)[0, 0] == pytest.approx(1)
    disc = disc_of_views(unit_vector(0.3), 200)
    gain = relative_gain(disc)
    assert np.isnan(gain[0, 0])
    assert np.nanmax(gain) < np.nanmax(relative_gain(disc, shadowed=False))


def test_a_mirror_at_any_angle_has_its_reflectance_once() -> None:
    """At its direction ``(1 + cos 2 t)^2 / (4 cos^3 t) = cos t``, times Schlick's reflectance over its own at 0."""
    theta = np.deg2rad([[0.0, 30.0, 60.0, 80.0]])
    mirrored = Directions(unit_vector(theta), unit_vector(theta, np.pi))
    reflectance = 0.04 + 0.96 * (1 - np.cos(theta)) ** 5
    np.testing.assert_allclose(relative_gain(mirrored, shadowed=False), np.cos(theta) * reflectance / 0.04)


@settings(deadline=None)
@given(st.tuples(*[st.floats(0, 1.4), st.floats(-3, 3)] * 2))
def test_a_brdf_is_the_same_with_light_and_viewer_exchanged(angles: tuple[float, float, float, float]) -> None:
    light, view = unit_vector(angles[0], angles[1])[None, None], unit_vector(angles[2], angles[3])[None, None]
    there = relative_gain(Directions(light, view)) / light[..., 2]
    back = relative_gain(Directions(view, light)) / view[..., 2]
    np.testing.assert_allclose(there, back, rtol=1e-9)


def test_schlick_is_the_normal_reflectance_head_on_and_one_at_grazing() -> None:
    theta = np.array([[0.0, np.pi / 2 - 1e-9]])
    mirrored = Directions(unit_vector(theta), unit_vector(theta, np.pi))
    np.testing.assert_allclose(schlick(mirrored, 1.5)[0], [0.04, 1.0], atol=1e-6)


def test_the_disc_looks_right_along_x_and_up_along_y() -> None:
    view = disc_of_views(unit_vector(0.0), 9).view
    assert view[4, 8, 0] > 0.8
    assert view[0, 4, 1] > 0.8
    np.testing.assert_allclose(np.linalg.norm(view[4, 4]), 1)
