from __future__ import annotations

import dataclasses
import logging
import re

import numpy as np
import pytest
from scipy import ndimage

from pipeline.data.photographs import PolarizerSequence
from pipeline.errors import InputError, InputErrors
from pipeline.optics.angles import axial_difference, axial_median
from pipeline.optics.curve_search import rival_turn
from pipeline.optics.response_curve import (
    FilmedGrating,
    harmonic_design,
    orientation_bound,
    relative_stokes,
    response_curve,
)
from pipeline.stages.fit._cloud import curve_of
from pipeline.stages.fit._uncertainty import measured
from pipeline.stages.fit.cosine import cosine
from pipeline.stages.fit.jones import _read_off, jones

EQUAL = np.arange(12) * np.pi / 12
BUNCHED_DEG = (10, 20, 30, 40, 55, 60, 90)


def facets(size=210):
    """Seven stripes of bunched orientations, and a dark ground around them."""
    theta = np.full((size, size), np.nan)
    for i, stripe in enumerate(np.array_split(np.arange(20, size - 20), len(BUNCHED_DEG))):
        theta[20 : size - 20, stripe] = np.deg2rad(BUNCHED_DEG[i])
    return theta


def photographed(theta, r, zeta_deg, film_deg, axis_deg=0.0, *, polarizer_rad=EQUAL, electrons=10_000, shift_px=0.0):
    m, s1, s2 = relative_stokes(theta, FilmedGrating(r, *np.deg2rad([zeta_deg, film_deg, axis_deg])))
    rng = np.random.default_rng(5)
    images = []
    for _, c, s in harmonic_design(polarizer_rad):
        scene = np.where(np.isnan(theta), 0.02, m * (1 + s1 * c + s2 * s))
        moved = ndimage.shift(scene, rng.normal(0, shift_px, 2), order=1, mode="nearest") if shift_px else scene
        images.append(rng.poisson(electrons * moved) / (4 * electrons))
    return PolarizerSequence(np.array(images, np.float32), polarizer_rad, np.ones(theta.shape, bool), 0.02)


def mean_error_deg(found, theta, *, remove_offset):
    both = found.mask & np.isfinite(theta)
    turn = axial_difference(found.orientation_rad[both], theta[both])
    if remove_offset:
        turn = axial_difference(turn, axial_median(turn))
    return float(np.rad2deg(np.abs(turn)).mean())


def test_bunched_facets_under_a_film_are_found_with_their_offset():
    theta = facets()
    photos = photographed(theta, 1.08, 40, 8, shift_px=0.05)
    found = jones(photos)
    assert found.absolute
    assert mean_error_deg(found, theta, remove_offset=False) < 0.6
    assert mean_error_deg(cosine(photos, prenormalize=True), theta, remove_offset=True) > 10
    assert found.parameters["amplitude_ratio"] == pytest.approx(1.08, abs=0.01)
    assert found.parameters["phase_deg"] == pytest.approx(40, abs=0.5)
    assert found.parameters["retardation_deg"] == pytest.approx(8, abs=0.2)
    assert found.parameters["electrons_full_scale"] == pytest.approx(40_000, rel=0.1)
    assert (found.mask == np.isfinite(theta)).mean() > 0.98


def test_without_a_film_the_map_is_relative_and_says_so(caplog):
    theta = facets()
    with caplog.at_level(logging.INFO):
        found = jones(photographed(theta, 1.1, 45, 0))
    assert not found.absolute
    assert "stays relative" in caplog.text
    assert mean_error_deg(found, theta, remove_offset=True) < 0.4
    inside = ndimage.binary_erosion(np.isfinite(theta), iterations=3)
    bound = orientation_bound(response_curve(FilmedGrating(1.1, np.deg2rad(45)), 8), EQUAL, 10_000 * 1.105)
    assert np.median(found.standard_error_rad[inside]) == pytest.approx(bound[0], rel=0.15)


def test_the_film_s_axis_can_be_searched():
    theta = np.broadcast_to(np.linspace(0, np.pi, 300, endpoint=False), (60, 300)).copy()
    found = jones(photographed(theta, 1.08, 60, 15, 35), film_axis_deg=None, threshold=0.0)
    assert found.parameters["film_axis_deg"] == pytest.approx(35, abs=0.5)
    assert found.absolute
    assert mean_error_deg(found, theta, remove_offset=False) < 0.4


@pytest.mark.parametrize("theta", [facets(), np.broadcast_to(np.linspace(0, np.pi, 300), (60, 300))])
def test_a_film_whose_axis_is_another_than_the_one_given_makes_no_map_absolute(theta, caplog):
    found = jones(photographed(theta, 1.1, 45, 8, 25), threshold=0.1)
    assert not found.absolute
    (better_deg,) = re.findall(r"axis was given as 0.0 deg, and one at ([\d.]+) deg fits better", caplog.text)
    assert float(better_deg) == pytest.approx(25, abs=2)


def test_a_known_curve_is_not_searched_and_three_photographs_do():
    theta = facets()
    photos = photographed(theta, 1.08, 60, 20, polarizer_rad=EQUAL[::4])
    found = jones(photos, amplitude_ratio=1.08, phase_deg=60, retardation_deg=20)
    assert found.parameters["phase_deg"] == pytest.approx(60)
    assert mean_error_deg(found, theta, remove_offset=False) < 0.6
    assert found.parameters["electrons_full_scale"] == pytest.approx(40_000, rel=0.25)


def test_brightness_is_freed_of_the_orientation():
    theta = np.broadcast_to(np.linspace(0, np.pi, 300, endpoint=False), (60, 300)).copy()
    photos = photographed(theta, 1.3, 60, 30, electrons=200_000)
    found = jones(photos, threshold=0.0)
    plain = cosine(photos, prenormalize=False, threshold=0.0)
    across = [m.intensity.mean(axis=0).std() / m.intensity.mean() for m in (found, plain)]
    assert across[0] < 0.05 * across[1]


def test_photographs_of_something_else_are_noticed(caplog):
    rng = np.random.default_rng(0)
    degree = rng.uniform(0, 0.6, (80, 80))
    angle = rng.uniform(0, np.pi, (80, 80))
    images = [rng.poisson(5000 * (1 + degree * np.cos(2 * (psi - angle)))) / 20_000 for psi in EQUAL]
    photos = PolarizerSequence(np.array(images, np.float32), EQUAL, np.ones((80, 80), bool))
    with caplog.at_level(logging.WARNING):
        found = jones(photos)
    assert "not those of one kind of grating" in caplog.text
    assert found.parameters["curve_misfit"] > 3


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"amplitude_ratio": 3.0}, "amplitude_ratio is 3"),
        ({"phase_deg": -10.0}, "phase_deg is -10"),
        ({"retardation_deg": 120.0}, "retardation_deg is 120"),
        ({"points": 5}, "points is 5"),
        ({"absolute_within_deg": 0.0}, "absolute_within_deg is 0"),
        ({"threshold": -0.1}, "threshold is -0.1"),
    ],
)
def test_impossible_settings_are_refused(settings, message):
    with pytest.raises((InputError, InputErrors), match=message):
        jones(photographed(facets(80), 1.1, 45, 3), **settings)


@pytest.mark.parametrize(
    ("value", "deviation", "text"),
    [
        (39.99987, 0.00123, "39.9999 +- 0.0012"),
        (40.0, 0.0996, "40.00 +- 0.10"),
        (1.1, 12.4, "1 +- 12"),
        (164.2, 340.0, "164 +- 340"),
        (8.0, 0.0, "8 (given)"),
        (8.0, np.inf, "8 +- inf"),
    ],
)
def test_a_figure_has_as_many_digits_as_two_of_its_deviation(value, deviation, text):
    assert measured(value, deviation) == text


def test_nothing_that_diffracts_is_refused():
    with pytest.raises(InputError, match="no pixel is valid, modulated and brighter than 5"):
        jones(photographed(facets(80), 1.1, 45, 3), threshold=5.0)


def test_photographs_without_a_valid_pixel_are_not_blamed_on_the_threshold():
    photos = photographed(facets(80), 1.1, 45, 3)
    masked = dataclasses.replace(photos, valid=np.zeros_like(photos.valid))
    tiny = dataclasses.replace(photos, images=photos.images[:, 40:45, 40:45], valid=photos.valid[40:45, 40:45])
    for fit, few in ((jones, masked), (jones, tiny), (cosine, masked)):
        with pytest.raises(InputError, match=r"no pixel is valid and modulated\n") as caught:
            fit(few)
        assert "threshold" not in str(caught.value)


def test_light_of_the_other_handedness_shows_a_grating_turned_by_a_right_angle():
    theta = facets(100)
    found = jones(photographed(theta, 1.08, -40, -8))  # the conjugate of everything but the light
    assert found.absolute
    assert found.parameters["amplitude_ratio"] == pytest.approx(1 / 1.08, abs=0.01)
    assert found.parameters["retardation_deg"] == pytest.approx(-8, abs=0.2)
    both = found.mask & np.isfinite(theta)
    turn = np.abs(axial_difference(found.orientation_rad[both], theta[both]))
    assert np.rad2deg(np.median(turn)) == pytest.approx(90, abs=0.5)


@pytest.mark.parametrize("factor", [0.0, 0.5, 2.0])
def test_a_photograph_that_failed_is_told_and_left_out(factor, caplog):
    theta = facets()
    photos = photographed(theta, 1.08, 40, 8)
    images = photos.images.copy()
    images[4] *= factor
    found = jones(dataclasses.replace(photos, images=images))
    assert found.absolute
    assert mean_error_deg(found, theta, remove_offset=False) < 0.6
    assert re.findall(r"Photograph (\d+), at ([\d.]+) deg, is \d+ % as bright", caplog.text) == [("4", "60.0")]


def test_misread_angles_are_told_with_the_photograph(caplog):
    misread = EQUAL.copy()
    misread[7] += np.deg2rad(4)
    photos = photographed(facets(), 1.08, 40, 8)
    jones(photos)
    assert "look wrong" not in caplog.text
    jones(dataclasses.replace(photos, polarizer_rad=misread))
    assert re.findall(r"look wrong, by up to [\d.]+ deg at photograph (\d+) \(([\d.]+) deg\)", caplog.text) == [
        ("7", "109.0")
    ]


def test_one_orientation_that_vanishes_between_crossed_polarisers_is_no_failed_photograph(caplog):
    jones(photographed(np.where(np.isnan(facets()), np.nan, 0.3), 1.08, 88, 3))
    assert "Photograph" not in caplog.text


@pytest.mark.parametrize(("rival", "limit_deg", "absolute"), [((1.08, 44, 8), 5.0, True), ((1.08, 60, 4), 0.5, False)])
def test_where_another_curve_fits_as_well_the_error_is_the_turn_to_it(rival, limit_deg, absolute):
    """A map that stays relative does not mind by how much all orientations turn."""
    theta = np.broadcast_to(np.linspace(0, np.pi, 300, endpoint=False), (60, 300)).copy()
    photos = photographed(theta, 1.08, 40, 8, electrons=1e6)
    known = {"amplitude_ratio": 1.08, "phase_rad": np.deg2rad(40), "retardation_rad": np.deg2rad(8), "film_axis_rad": 0}
    points, found = curve_of(photos, known, 0.0, 4000)
    other = FilmedGrating(rival[0], *np.deg2rad(rival[1:]))
    limit_rad = float(np.deg2rad(limit_deg))
    alone, doubted = (
        _read_off(points, curve, limit_rad) for curve in (found, dataclasses.replace(found, rivals=(other,)))
    )
    assert doubted.absolute is absolute
    true = np.stack(relative_stokes(theta[0], found.grating)[1:], axis=1)
    turn = rival_turn(found, other, true)
    if not absolute:
        turn = turn - np.median(turn)
    expected = np.hypot(np.abs(turn), alone.standard_error_rad[30])
    assert np.rad2deg(np.abs(turn)).max() > 1
    # Both turns are read off curves of a sample every quarter of a degree.
    np.testing.assert_allclose(doubted.standard_error_rad[30], expected, atol=np.deg2rad(0.55))
    assert np.median(doubted.standard_error_rad[30]) == pytest.approx(np.median(expected), abs=np.deg2rad(0.3))
    assert np.median(doubted.standard_error_rad) > 2 * np.median(alone.standard_error_rad)
