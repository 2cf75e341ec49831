from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline.data.gratings import GratingSample, OrientationMap
from pipeline.data.photographs import PolarizerSequence
from pipeline.errors import InputError, InputErrors
from pipeline.optics.response_curve import FilmedGrating, orientation_bound, response_curve
from pipeline.stages.evaluate.bound import bound
from pipeline.stages.evaluate.confidence import confidence
from pipeline.stages.simulate.facets import facets
from pipeline.stages.simulate.misread_polarizer import misread_polarizer

PSI = np.arange(600) * np.pi / 600
SAMPLE = GratingSample(
    orientation_rad=np.full((6, 6), 0.5, np.float32),
    period_um=np.full((6, 6), 1.2, np.float32),
    pixel_mm=0.02,
    depth_um=0.1,
    amplitude_ratio=1.0,
    phase_rad=float(np.deg2rad(40)),
    retardation_rad=0.0,
    film_axis_rad=0.0,
    ground_reflectance=0.0,
    name="even",
)
PHOTOS = PolarizerSequence(np.zeros((600, 2, 2), np.float32), PSI, np.ones((2, 2), bool))


def test_the_bound_of_an_even_sample_is_the_closed_form():
    rho = np.sin(np.deg2rad(40))
    deviation = 0.5 / np.sqrt(600 * 50 * (1 - np.sqrt(1 - rho**2)))
    found = bound(PHOTOS, SAMPLE, electrons=50.0).metrics["bound_mean_deg"]
    assert found == pytest.approx(np.rad2deg(deviation) * np.sqrt(2 / np.pi), rel=2e-3)


def test_short_periods_are_dim_and_less_well_known():
    period = SAMPLE.period_um.copy()
    period[:, 3:] = 0.6
    both = bound(PHOTOS, dataclasses.replace(SAMPLE, period_um=period), electrons=50.0).metrics["bound_mean_deg"]
    one = bound(PHOTOS, SAMPLE, electrons=50.0).metrics["bound_mean_deg"]
    assert both == pytest.approx(1.5 * one, rel=1e-3)


def test_what_varies_has_no_one_bound():
    varying = dataclasses.replace(SAMPLE, retardation_rad=np.zeros((6, 6), np.float32))
    with pytest.raises(InputError, match="varies over it"):
        bound(PHOTOS, varying, electrons=50.0)


def test_photographs_without_light_are_refused():
    with pytest.raises((InputError, InputErrors), match="electrons is 0"):
        bound(PHOTOS, SAMPLE, electrons=0.0)


def test_facets_stand_from_left_to_right():
    sample = facets(width_mm=7.0, margin_mm=0.5, pixel_mm=0.1, orientations_deg=(10.0, 90.0))
    middle = sample.orientation_rad[40]
    assert np.isnan(middle[:5]).all()
    assert np.rad2deg(middle[20]) == pytest.approx(10)
    assert np.rad2deg(middle[60]) == pytest.approx(90)
    with pytest.raises((InputError, InputErrors), match="there is no stripe"):
        facets(orientations_deg=())


def test_misread_angles_leave_the_photographs_alone():
    photos = misread_polarizer(PHOTOS, stretch=1.02)
    np.testing.assert_allclose(photos.polarizer_rad, 1.02 * PSI)
    assert photos.images is PHOTOS.images
    scattered = misread_polarizer(PHOTOS, scatter_deg=2.0, seed=1).polarizer_rad - PSI
    assert np.rad2deg(scattered.std()) == pytest.approx(2, rel=0.1)
    with pytest.raises((InputError, InputErrors), match="scatter_deg is -1"):
        misread_polarizer(PHOTOS, scatter_deg=-1.0)


def test_a_map_is_asked_whether_it_knows_its_errors():
    estimate = map_of(error_deg=np.array([[0.1, 3.0], [0.2, 4.0]]), stated_deg=np.array([[0.1, 2.0], [2.0, 0.1]]))
    found = confidence(estimate, SAMPLE).metrics
    assert found["bad_percent"] == 50
    assert found["bad_flagged_percent"] == 50
    assert found["good_flagged_percent"] == 50
    with pytest.raises((InputError, InputErrors), match="bad_deg is 0"):
        confidence(estimate, SAMPLE, bad_deg=0.0)


def map_of(error_deg, stated_deg):
    shape = error_deg.shape
    return OrientationMap(
        (0.5 + np.deg2rad(error_deg)).astype(np.float32),
        np.ones(shape, np.float32),
        np.ones(shape, np.float32),
        np.ones(shape, bool),
        absolute=True,
        standard_error_rad=np.deg2rad(stated_deg).astype(np.float32),
    )


def test_the_bound_knows_that_the_brightness_is_not_known():
    """At angles close together a turn looks much like a change of brightness; by the inverse of the whole matrix."""
    psi = np.deg2rad([0.0, 10, 20, 35])
    curve = response_curve(FilmedGrating(1.1, 0.8, 0.3), 16)
    deviation = orientation_bound(curve, psi, 500.0)
    for (s1, s2), (d1, d2), found in zip(curve.stokes, curve.slope, deviation, strict=True):
        c, s = np.cos(2 * psi), np.sin(2 * psi)
        light = 1 + s1 * c + s2 * s
        by_unknown = np.stack([light, 500 * (d1 * c + d2 * s)])
        information = by_unknown / (500 * light) @ by_unknown.T
        assert found == pytest.approx(np.sqrt(np.linalg.inv(information)[1, 1]), rel=1e-6)
