from __future__ import annotations

import dataclasses
import logging

import numpy as np
import pytest
from polarization import OVER, at_centres, facets

from pipeline.data.gratings import GratingSample, OrientationMap, PeriodMap
from pipeline.data.pictures import PictureSeries
from pipeline.errors import InputError
from pipeline.optics.angles import axial_difference
from pipeline.stages.capture.point_light import point_light
from pipeline.stages.fit.offset import offset

ORIENTATION, PERIOD = facets()
LIGHTS = [[200.0, 0.0, 300.0], [120.0, 170.0, 300.0]]


@pytest.fixture(scope="module")
def photos():
    sample = GratingSample(
        ORIENTATION.astype(np.float32), PERIOD.astype(np.float32), 0.02, 0.12, 1.1, 0.8, 0.05, 0.0, 0.03, "facets"
    )
    return point_light(sample, lights_mm=LIGHTS, pixel_mm=0.02 * OVER, blur_mm=0.05)


def maps(turn_rad):
    theta = at_centres(ORIENTATION)
    mask = np.isfinite(theta)
    turned = np.mod(theta + turn_rad, np.pi).astype(np.float32)
    period = PeriodMap(at_centres(PERIOD).astype(np.float32), mask, 0.1)
    return OrientationMap(turned, np.ones_like(turned), np.ones_like(turned), mask, 0.1), period


@pytest.mark.parametrize("turn_deg", [0.0, 48.5, 131.5, 179.0])
def test_a_turned_map_is_turned_back(photos, turn_deg, caplog):
    with caplog.at_level(logging.INFO):
        found = offset(*maps(np.deg2rad(turn_deg)), photos)
    error = np.rad2deg(axial_difference(found.orientation_rad, at_centres(ORIENTATION)))
    assert np.nanmax(np.abs(error)) < 1.0
    assert found.absolute
    assert "made absolute" in caplog.text


@pytest.mark.parametrize("known_deg", [-48.5, 131.5, 311.5])
def test_a_known_offset_is_added_and_makes_the_map_absolute(known_deg):
    orientation, period = maps(np.deg2rad(48.5))
    found = offset(orientation, period, known_deg=known_deg)
    assert found.absolute
    assert np.nanmax(np.abs(axial_difference(found.orientation_rad, at_centres(ORIENTATION)))) < 1e-6
    assert np.nanmin(found.orientation_rad) >= 0
    assert np.nanmax(found.orientation_rad) < np.pi


def test_a_known_offset_counts_for_more_than_photographs(photos):
    assert np.array_equal(
        offset(*maps(0.2), photos, known_deg=7.0).orientation_rad,
        offset(*maps(0.2), known_deg=7.0).orientation_rad,
        equal_nan=True,
    )


def test_without_photographs_or_a_known_offset_the_map_stays_as_it_is():
    orientation, period = maps(0.2)
    assert offset(orientation, period) is orientation


def test_a_tangent_along_x_shines_under_a_light_on_the_x_axis():
    """A light on +x lights the strip whose tangent is x; the map is 50 degrees off."""
    theta = np.repeat(np.deg2rad([0.0, 45.0, 90.0, 135.0]), 20)[:, None] * np.ones((1, 80))
    bright = np.where(theta == 0, 1.0, 0.0)[None, ..., None] * np.ones(3)
    series = PictureSeries(bright, np.array([[300.0, 0.0, 300.0]]), np.array([0.0, 0.0, 500.0]), 0.1)
    turned = np.mod(theta + np.deg2rad(50), np.pi).astype(np.float32)
    ones = np.ones_like(turned)
    orientation = OrientationMap(turned, ones, ones, ones > 0, 0.1)
    found = offset(orientation, PeriodMap(0.8 * ones, ones > 0, 0.1), series)
    assert np.rad2deg(np.abs(axial_difference(found.orientation_rad, theta))).max() < 1.5


def test_photographs_that_say_nothing_leave_the_map_relative(photos, caplog):
    noise = np.random.default_rng(0).random(photos.rgb.shape).astype(np.float32)
    found = offset(*maps(0.5), dataclasses.replace(photos, rgb=noise))
    assert not found.absolute
    assert "ambiguous" in caplog.text


def test_two_offsets_that_fit_alike_leave_the_map_relative(caplog):
    theta = np.repeat(np.deg2rad([0.0, 45.0, 90.0, 135.0]), 20)[:, None] * np.ones((1, 80))
    bright = np.where((theta == 0) | (theta == np.pi / 2), 1.0, 0.0)[None, ..., None] * np.ones(3)
    series = PictureSeries(bright, np.array([[300.0, 0.0, 300.0]]), np.array([0.0, 0.0, 500.0]), 0.1)
    ones = np.ones(theta.shape, np.float32)
    orientation = OrientationMap(theta.astype(np.float32), ones, ones, ones > 0, 0.1)
    assert not offset(orientation, PeriodMap(0.8 * ones, ones > 0, 0.1), series).absolute
    assert "ambiguous" in caplog.text


def test_maps_and_photographs_of_different_shape_are_refused(photos):
    cropped = dataclasses.replace(photos, rgb=photos.rgb[:, 1:])
    with pytest.raises(InputError, match="differ in shape"):
        offset(*maps(0.0), cropped)


def test_black_photographs_are_refused(photos):
    with pytest.raises(InputError, match="nothing that depends on the orientation"):
        offset(*maps(0.0), dataclasses.replace(photos, rgb=np.zeros_like(photos.rgb)))
