"""The forward model of polarisation imaging."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics.jones import (
    CIRCULAR,
    grating,
    offset_without_film,
    polarizer_response,
    retarder,
    rotation,
    stokes_parameters,
)

ANGLES = st.floats(-7, 7)
RATIOS = st.floats(0.2, 3)
SETTINGS = {"amplitude_ratio": 1.1, "phase_rad": np.pi / 4}


@given(ANGLES, ANGLES, RATIOS, ANGLES)
def test_without_a_film_it_is_equation_9(polarizer: float, orientation: float, r: float, zeta: float) -> None:
    psi = polarizer - orientation
    expected = 1 + (r**2 - 1) * (1 - np.cos(2 * psi)) / 2 - r * np.sin(zeta) * np.sin(2 * psi)
    found = polarizer_response(polarizer, orientation, amplitude_ratio=r, phase_rad=zeta)
    assert found == pytest.approx(expected, abs=1e-9)


@given(ANGLES, ANGLES, ANGLES, ANGLES, ANGLES)
def test_turning_everything_together_changes_nothing(
    psi: float, theta: float, film: float, delta: float, turn: float
) -> None:
    settings = {**SETTINGS, "retardation_rad": delta}
    still = polarizer_response(psi, theta, film_axis_rad=film, **settings)
    turned = polarizer_response(psi + turn, theta + turn, film_axis_rad=film + turn, **settings)
    assert turned == pytest.approx(still, abs=1e-9)


@given(ANGLES, ANGLES, ANGLES)
def test_period_is_half_a_turn_of_polarizer_and_of_grating(psi: float, theta: float, delta: float) -> None:
    one = polarizer_response(psi, theta, retardation_rad=delta, **SETTINGS)
    assert polarizer_response(psi + np.pi, theta, retardation_rad=delta, **SETTINGS) == pytest.approx(one, abs=1e-9)
    assert polarizer_response(psi, theta - np.pi, retardation_rad=delta, **SETTINGS) == pytest.approx(one, abs=1e-9)


@given(ANGLES, ANGLES)
def test_energy_of_a_lossless_grating_is_kept(theta: float, delta: float) -> None:
    crossed = [
        polarizer_response(psi, theta, amplitude_ratio=1.0, phase_rad=0.7, retardation_rad=delta)
        for psi in (0.3, 0.3 + np.pi / 2)
    ]
    assert sum(crossed) == pytest.approx(np.vdot(CIRCULAR, CIRCULAR).real, abs=1e-9)


def test_matrices_are_unitary_and_reciprocal() -> None:
    film = retarder(0.4, 0.9)
    np.testing.assert_allclose(film @ film.conj().T, np.eye(2), atol=1e-12)
    mirror = grating(0.6, 1.1, 0.3)
    np.testing.assert_allclose(mirror, mirror.T, atol=1e-12)
    np.testing.assert_allclose(rotation(0.2) @ rotation(0.5), rotation(0.7), atol=1e-12)


def test_rotation_is_anticlockwise() -> None:
    np.testing.assert_allclose(rotation(np.pi / 2) @ [0, 1], [1, 0], atol=1e-12)


def test_batch_equals_loop() -> None:
    psi = np.linspace(0, np.pi, 5)[:, None]
    theta = np.linspace(0, 3, 7)[None, :]
    settings = {**SETTINGS, "retardation_rad": 0.2, "film_axis_rad": 0.3}
    batch = polarizer_response(psi, theta, **settings)
    loop = [[polarizer_response(p, t, **settings) for t in theta[0]] for p in psi[:, 0]]
    np.testing.assert_allclose(batch, loop, rtol=1e-12)


def test_the_maximum_follows_the_grating_anticlockwise() -> None:
    psi = np.linspace(0, np.pi, 1800, endpoint=False)
    brightest = [psi[np.argmax(polarizer_response(psi, theta, **SETTINGS))] for theta in (0.2, 0.7)]
    assert (brightest[1] - brightest[0]) % np.pi == pytest.approx(0.5, abs=2e-3)


PSI = np.pi * np.arange(24) / 24
THETA = np.pi * np.arange(240)[:, None] / 240


@given(st.floats(0.2, 3), st.floats(-3, 3), ANGLES)
def test_without_a_film_the_brightest_angle_is_ahead_by_half_the_phase_of_equation_9(
    r: float, zeta: float, theta: float
) -> None:
    offset = offset_without_film(r, zeta)
    assert offset is not None
    settings = {"amplitude_ratio": r, "phase_rad": zeta}
    brightest = polarizer_response(theta + offset, theta, **settings)
    assert np.all(polarizer_response(PSI, theta, **settings) <= brightest + 1e-12)


@pytest.mark.parametrize("phase_rad", [0.0, np.pi])
def test_a_ratio_of_one_or_minus_one_has_no_brightest_angle(phase_rad: float) -> None:
    assert offset_without_film(1.0, phase_rad) is None
    assert np.ptp(polarizer_response(PSI, THETA, amplitude_ratio=1.0, phase_rad=phase_rad)) < 1e-12


@given(st.floats(0, 1.5))
def test_a_film_over_ratio_one_has_its_closed_form(delta: float) -> None:
    """The grating then is a half-wave plate: S1 = 2 sin(d) sin(4 t), S2 = -sin(2 d) (1 + cos(4 t))."""
    s1 = 2 * np.sin(delta) * np.sin(4 * THETA)
    s2 = -np.sin(2 * delta) * (1 + np.cos(4 * THETA))
    found = polarizer_response(PSI, THETA, amplitude_ratio=1.0, phase_rad=0.0, retardation_rad=delta)
    np.testing.assert_allclose(found, 1 + (s1 * np.cos(2 * PSI) + s2 * np.sin(2 * PSI)) / 2, atol=1e-12)


@given(st.floats(0, 1.5))
def test_a_film_over_ratio_minus_one_hides_how_the_mirror_is_turned(delta: float) -> None:
    """The field passes the film twice, and a mirror changes nothing: S2 = 2 sin(2 d)."""
    found = polarizer_response(PSI, THETA, amplitude_ratio=1.0, phase_rad=np.pi, retardation_rad=delta)
    expected = np.broadcast_to(1 + np.sin(2 * delta) * np.sin(2 * PSI), found.shape)
    np.testing.assert_allclose(found, expected, atol=1e-12)


@given(st.floats(0.5, 1.5), st.floats(-3, 3), st.floats(0, 1), st.floats(0, 3))
def test_the_map_mirrored_in_the_films_axis_is_that_of_the_opposite_handedness(
    r: float, zeta: float, delta: float, theta: float
) -> None:
    """Mirroring psi and theta swaps left and right circular light, which conjugation of R and the film swaps back."""
    one = polarizer_response(PSI, theta, amplitude_ratio=r, phase_rad=zeta, retardation_rad=delta)
    other = polarizer_response(-PSI, -theta, amplitude_ratio=r, phase_rad=-zeta, retardation_rad=-delta)
    np.testing.assert_allclose(other, one, atol=1e-12)


@given(ANGLES, ANGLES, RATIOS, ANGLES, ANGLES, ANGLES)
def test_stokes_parameters_give_the_light_behind_the_polarizer(
    psi: float, theta: float, r: float, zeta: float, delta: float, film: float
) -> None:
    settings = {"amplitude_ratio": r, "phase_rad": zeta, "retardation_rad": delta, "film_axis_rad": film}
    s0, s1, s2 = stokes_parameters(theta, **settings)
    expected = polarizer_response(psi, theta, **settings)
    assert (s0 + s1 * np.cos(2 * psi) + s2 * np.sin(2 * psi)) / 2 == pytest.approx(expected, abs=1e-9)


def test_stokes_parameters_of_maps_are_those_of_their_points() -> None:
    rng = np.random.default_rng(0)
    names = ("amplitude_ratio", "phase_rad", "retardation_rad", "film_axis_rad")
    theta, maps = rng.uniform(0, 3, (4, 5)), {name: rng.uniform(0.2, 2, (4, 5)) for name in names}
    whole = np.array(stokes_parameters(theta, **maps))
    assert whole.shape == (3, 4, 5)
    for place in np.ndindex(4, 5):
        one = stokes_parameters(theta[place], **{name: values[place] for name, values in maps.items()})
        np.testing.assert_allclose(whole[(slice(None), *place)], one, rtol=1e-12)


def test_light_is_never_more_than_wholly_polarised() -> None:
    theta = np.linspace(0, np.pi, 50)
    s0, s1, s2 = stokes_parameters(theta, amplitude_ratio=1.3, phase_rad=1.2, retardation_rad=0.4, film_axis_rad=0.3)
    assert (np.hypot(s1, s2) <= s0).all()
    assert np.hypot(s1, s2).max() > 0.5 * s0.min()
