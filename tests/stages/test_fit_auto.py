from __future__ import annotations

import logging

import numpy as np
import pytest
from test_fit_jones import EQUAL, facets, mean_error_deg, photographed

from pipeline.errors import InputError, InputErrors
from pipeline.stages.fit.auto import auto
from pipeline.stages.fit.cosine import cosine
from pipeline.stages.fit.jones import jones

ALL = np.broadcast_to(np.linspace(0, np.pi, 300, endpoint=False), (60, 300)).copy()


def taken(photos, caplog, **settings):
    caplog.clear()
    with caplog.at_level(logging.INFO):
        found = auto(photos, **settings)
    said = next(record.message for record in caplog.records if record.message.startswith("Taken: "))
    return found, said.removeprefix("Taken: ").partition(".")[0]


def test_the_simplest_method_that_is_accurate_enough_is_taken(caplog):
    theta = facets()
    cases = [(0, "cosine"), (30, "the whole forward model")]
    for film_deg, method in cases:
        photos = photographed(theta, 1.08, 60, film_deg)
        found, name = taken(photos, caplog)
        assert name == method
        assert mean_error_deg(found, theta, remove_offset=True) < 1.0


def test_pre_normalisation_is_taken_where_it_helps_enough(caplog):
    photos = photographed(ALL, 1.001, 172, 3, electrons=100_000)
    found, name = taken(photos, caplog, threshold=0.0)
    assert name == "cosine, pre-normalised"
    assert mean_error_deg(found, ALL, remove_offset=True) < 1.0
    assert mean_error_deg(cosine(photos, prenormalize=False, threshold=0.0), ALL, remove_offset=True) > 5


def test_more_is_asked_for_and_more_is_modelled(caplog):
    theta = facets()
    photos = photographed(theta, 1.08, 60, 8)
    assert taken(photos, caplog)[1] == "cosine"
    found, name = taken(photos, caplog, accuracy_deg=0.3)
    assert name == "the whole forward model"
    assert mean_error_deg(found, theta, remove_offset=True) < 0.3


def test_what_each_would_have_cost_is_told_and_true(caplog):
    theta = facets()
    photos = photographed(theta, 1.08, 40, 8, electrons=1e6)
    found, _ = taken(photos, caplog)
    for name, prenormalize in (("cosine_bias_deg", False), ("prenormalized_bias_deg", True)):
        other = cosine(photos, prenormalize=prenormalize)
        assert found.parameters[name] == pytest.approx(mean_error_deg(other, theta, remove_offset=True), rel=0.15)


def test_as_many_photographs_as_it_says_are_enough(caplog):
    many = np.arange(24) * np.pi / 24
    found, _ = taken(photographed(ALL, 1.08, 60, 0, polarizer_rad=many, electrons=400), caplog, threshold=0.0)
    enough = int(found.parameters["photographs_enough"])
    assert 4 <= enough < 24

    def error_with(count):
        photos = photographed(ALL, 1.08, 60, 0, polarizer_rad=np.arange(count) * np.pi / count, electrons=400)
        return mean_error_deg(cosine(photos, prenormalize=False, threshold=0.0), ALL, remove_offset=True)

    assert error_with(enough) < 1.05
    assert enough == 4 or error_with(max(enough - 2, 3)) > 0.95


def test_a_curve_that_does_not_tell_the_offset_leaves_the_map_relative():
    theta = np.where(np.isnan(facets(120)), np.nan, np.deg2rad(np.where(np.arange(120) < 60, 20, 60)))
    photos = photographed(theta, 1.08, 150, 8)  # two orientations do not make a curve
    found, asked_for = auto(photos), jones(photos)
    assert mean_error_deg(found, theta, remove_offset=False) > 10
    assert not found.absolute
    assert found.parameters["offset_std_deg"] == asked_for.parameters["offset_std_deg"] == 90
    np.testing.assert_array_equal(found.standard_error_rad, asked_for.standard_error_rad)
    np.testing.assert_array_equal(found.orientation_rad, asked_for.orientation_rad)


def test_the_offset_is_claimed_as_far_as_it_is_asked_for():
    photos = photographed(facets(120), 1.08, 40, 30)
    assert auto(photos).absolute
    assert not auto(photos, absolute_within_deg=1e-3).absolute


def test_pixels_of_no_one_curve_are_told(caplog):
    half = ALL.shape[1] // 2
    left = photographed(ALL[:, :half], 1.05, 165, 5)
    right = photographed(ALL[:, half:], 1.2, 100, -25)
    photos = left.__class__(
        np.concatenate([left.images, right.images], axis=2), EQUAL, np.ones(ALL.shape, bool), left.pixel_mm
    )
    caplog.clear()
    with caplog.at_level(logging.INFO):
        auto(photos, threshold=0.0)
    assert "no forward model of one film holds" in caplog.text


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"accuracy_deg": 0.0}, "accuracy_deg is 0"),
        ({"points": 3}, "points is 3"),
        ({"absolute_within_deg": 0.0}, "absolute_within_deg is 0"),
        ({"threshold": -0.1}, "threshold is -0.1"),
    ],
)
def test_impossible_settings_are_refused(settings, message):
    with pytest.raises((InputError, InputErrors), match=message):
        auto(photographed(facets(80), 1.1, 45, 3), **settings)
