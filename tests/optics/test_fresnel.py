"""Fresnel coefficients: published reflectances, closed forms, another library, signs, energy."""

from __future__ import annotations

import cmath

import numpy as np
import pytest
import tmm
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics.fresnel import reflection, refracted_cosine, zeroth_order_ratio

ANGLES = st.floats(0, 1.5)
REAL = st.floats(1, 4)
METALLIC = st.builds(complex, st.floats(0.05, 4), st.floats(0.01, 9))


@pytest.mark.parametrize(
    ("index", "reflectance"),
    [(1.5, 0.04), (0.20 + 3.44j, 0.94), (0.47 + 2.83j, 0.82), (0.62 + 2.57j, 0.73), (2.63 + 3.54j, 0.59)],
    ids=["crown glass", "silver", "gold", "copper", "platinum"],
)
def test_published_reflectances_at_normal_incidence(index: complex, reflectance: float) -> None:
    """Born and Wolf, Principles of Optics, table 14.1, at 589.3 nm to two digits; glass by its closed form."""
    r_p, r_s = reflection(1.0, index, 0.0)
    assert abs(r_s) ** 2 == pytest.approx(reflectance, abs=0.006)
    assert abs(r_p) ** 2 == pytest.approx(reflectance, abs=0.006)


@given(METALLIC, REAL)
def test_normal_incidence_is_its_closed_form_with_p_turned_round(index: complex, before: float) -> None:
    r_p, r_s = reflection(before, index, 0.0)
    assert r_s == pytest.approx((before - index) / (before + index))
    assert r_p == pytest.approx(-r_s)


@given(REAL, REAL)
def test_at_brewsters_angle_no_p_light_comes_back(before: float, behind: float) -> None:
    r_p, r_s = reflection(before, behind, np.arctan2(behind, before))
    assert abs(r_p) < 1e-12
    assert abs(r_s) == pytest.approx(abs(before**2 - behind**2) / (before**2 + behind**2), abs=1e-12)


def test_grazing_light_is_reflected_whole_and_reversed() -> None:
    r_p, r_s = reflection(1.0, 1.4 + 2j, np.pi / 2)
    assert (r_p, r_s) == (pytest.approx(-1), pytest.approx(-1))


@given(METALLIC, REAL, ANGLES)
def test_it_is_what_tmm_has(index: complex, before: float, angle: float) -> None:
    r_p, r_s = reflection(before, index, angle)
    inside = tmm.snell(before, index, angle)
    assert r_p == pytest.approx(tmm.interface_r("p", before, index, angle, inside), abs=1e-9)
    assert r_s == pytest.approx(tmm.interface_r("s", before, index, angle, inside), abs=1e-9)


@given(REAL, REAL, ANGLES)
def test_energy_and_continuity(before: float, behind: float, angle: float) -> None:
    """The fields along the surface are continuous, and what is not reflected goes through."""
    r_p, r_s = reflection(before, behind, angle)
    t_s, t_p = 1 + r_s, (1 + r_p) * before / behind
    through = np.real(behind * refracted_cosine(before, behind, angle)) / (before * np.cos(angle))
    assert abs(r_s) ** 2 + through * abs(t_s) ** 2 == pytest.approx(1, abs=1e-9)
    assert abs(r_p) ** 2 + through * abs(t_p) ** 2 == pytest.approx(1, abs=1e-9)


@given(METALLIC, REAL, ANGLES)
def test_what_absorbs_sends_back_no_more_than_it_gets_and_the_wave_in_it_decays(
    index: complex, before: float, angle: float
) -> None:
    assert all(abs(r) <= 1 + 1e-12 for r in reflection(before, index, angle))
    assert np.imag(index * refracted_cosine(before, index, angle)) >= 0


def test_one_reflection_in_fresnels_rhomb_shifts_p_against_s_by_45_degrees() -> None:
    """Born and Wolf, section 1.5.4: in glass of index 1.51 at 54 degrees 37 minutes."""
    r_p, r_s = reflection(1.51, 1.0, np.deg2rad(54 + 37 / 60))
    assert abs(r_p) == pytest.approx(1)
    assert abs(r_s) == pytest.approx(1)
    assert abs(np.rad2deg(cmath.phase(r_p / r_s))) == pytest.approx(45, abs=0.01)


def test_batch_equals_loop() -> None:
    angles = np.linspace(0, 1.4, 7)
    batch = reflection(1.0, 0.5 + 2j, angles)
    loop = np.transpose([reflection(1.0, 0.5 + 2j, angle) for angle in angles])
    np.testing.assert_allclose(batch, loop, rtol=1e-14)


@given(METALLIC, REAL)
def test_a_flat_metal_has_ratio_one_at_normal_incidence_and_minus_one_where_axes_are_kept(
    index: complex, film: float
) -> None:
    at_normal = {"incidence_rad": 0.0, "film_index": film}
    assert zeroth_order_ratio(index, **at_normal) == pytest.approx(1)
    assert zeroth_order_ratio(index, **at_normal, p_axis="kept") == pytest.approx(-1)


@given(METALLIC, REAL, st.floats(0.01, 1.4))
def test_the_ratio_is_that_of_two_cosines(index: complex, film: float, incidence: float) -> None:
    inside = cmath.asin(np.sin(incidence) / film)
    refracted = cmath.asin(np.sin(incidence) / index)
    expected = cmath.cos(inside - refracted) / cmath.cos(inside + refracted)
    assert zeroth_order_ratio(index, incidence_rad=incidence, film_index=film) == pytest.approx(expected, rel=1e-6)


def test_near_the_normal_the_ratio_leaves_one_with_the_square_of_the_angle() -> None:
    aluminium, film = 0.8946 + 6.188j, 1.468
    for incidence in np.deg2rad([0.5, 1.0, 2.0]):
        found = zeroth_order_ratio(aluminium, incidence_rad=incidence, film_index=film) - 1
        assert found == pytest.approx(2 * incidence**2 / (film * aluminium), rel=2e-3)
