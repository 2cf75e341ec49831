from __future__ import annotations

import dataclasses
import logging

import numpy as np
import pytest
from polarization import at_centres, facets, photographed

from pipeline.data.gratings import OrientationMap
from pipeline.errors import InputError
from pipeline.optics.angles import axial_difference, axial_median
from pipeline.stages.extract.bilateral import bilateral
from pipeline.stages.fit.cosine import cosine


def orientation_map(theta, mask=None, correlation=None):
    theta = np.asarray(theta, np.float32)
    mask = np.ones(theta.shape, bool) if mask is None else mask
    correlation = np.ones(theta.shape, np.float32) if correlation is None else correlation.astype(np.float32)
    return OrientationMap(np.where(mask, theta, np.float32(np.nan)), correlation, np.ones_like(theta), mask)


def noisy(theta, deviation_deg, seed=0):
    noise = np.random.default_rng(seed).normal(0, np.deg2rad(deviation_deg), np.shape(theta))
    return np.mod(theta + noise, np.pi).astype(np.float32)


@pytest.mark.parametrize("angle_deg", [0.0, 0.01, 45.0, 90.0, 179.99])
@pytest.mark.parametrize("adaptive", [True, False])
def test_a_constant_field_stays(angle_deg, adaptive):
    field = orientation_map(np.full((30, 40), np.deg2rad(angle_deg)))
    smooth = bilateral(field, adaptive=adaptive).orientation_rad
    assert np.abs(axial_difference(smooth, np.deg2rad(angle_deg))).max() < 1e-6
    assert smooth.min() >= 0
    assert smooth.max() < np.pi


@pytest.mark.parametrize("centre_deg", [0.0, 30.0, 90.0])
@pytest.mark.parametrize("adaptive", [True, False])
def test_noise_falls_and_the_wrap_is_no_edge(centre_deg, adaptive):
    centre = np.deg2rad(centre_deg)
    smooth = bilateral(orientation_map(noisy(np.full((80, 80), centre), 5)), adaptive=adaptive).orientation_rad
    error = np.rad2deg(axial_difference(smooth, centre))
    # The spatial Gaussian alone leaves sigma / (2 sqrt(pi) 3 px) = 0.47 degrees after one of the ten iterations.
    assert error[10:-10, 10:-10].std() < 0.5
    assert abs(error.mean()) < 0.2


@pytest.mark.parametrize("adaptive", [True, False])
def test_an_edge_of_40_degrees_does_not_bleed(adaptive):
    edge = np.where(np.arange(60) < 30, np.deg2rad(20), np.deg2rad(60.2)) * np.ones((50, 1))
    smooth = bilateral(orientation_map(edge), adaptive=adaptive, iterations=50).orientation_rad
    assert np.rad2deg(np.abs(axial_difference(smooth, edge))).max() < 0.01


def test_an_edge_of_10_degrees_survives_where_the_map_is_clean():
    edge = np.where(np.arange(60) < 30, np.deg2rad(175), np.deg2rad(5)) * np.ones((50, 1))
    noisy_edge = orientation_map(noisy(edge, 0.5))
    adapted = np.rad2deg(np.abs(axial_difference(bilateral(noisy_edge).orientation_rad, edge)))
    wide = np.rad2deg(np.abs(axial_difference(bilateral(noisy_edge, adaptive=False).orientation_rad, edge)))
    assert adapted[:, 28:32].max() < 0.5
    assert wide[:, 28:32].mean() > 2


def test_pixels_that_mix_two_facets_snap_to_one_of_them():
    left, right = np.deg2rad(10), np.deg2rad(80)
    share = np.clip((np.arange(60) - 28) / 4, 0, 1)
    vector = (1 - share) * np.exp(2j * left) + share * np.exp(2j * right)
    mixed = np.mod(np.angle(vector) / 2, np.pi) * np.ones((40, 1))
    smooth = bilateral(orientation_map(mixed)).orientation_rad
    to_nearer = np.minimum(np.abs(axial_difference(smooth, left)), np.abs(axial_difference(smooth, right)))
    before = np.minimum(np.abs(axial_difference(mixed, left)), np.abs(axial_difference(mixed, right)))
    assert np.rad2deg(before).max() > 30
    assert np.rad2deg(to_nearer).max() < 1


def test_masked_pixels_stay_masked_and_pull_nothing():
    rng = np.random.default_rng(0)
    mask = rng.random((50, 50)) > 0.4
    theta = np.where(mask, np.deg2rad(30), np.deg2rad(32)).astype(np.float32)
    field = orientation_map(theta, mask)
    smooth = bilateral(field)
    assert np.isnan(smooth.orientation_rad[~mask]).all()
    assert np.abs(axial_difference(smooth.orientation_rad[mask], np.deg2rad(30))).max() < 1e-6
    np.testing.assert_array_equal(smooth.mask, mask)
    np.testing.assert_array_equal(smooth.correlation, field.correlation)


def test_badly_fitted_neighbours_weigh_less():
    columns = np.arange(60) % 2
    theta = np.where(columns == 0, np.deg2rad(30), np.deg2rad(36)) * np.ones((40, 1))
    trusted = np.where(columns == 0, 1.0, 0.2) * np.ones((40, 1))
    smooth = bilateral(orientation_map(theta, correlation=trusted), adaptive=False).orientation_rad
    assert np.rad2deg(np.abs(axial_difference(smooth, np.deg2rad(30)))[5:-5, 5:-5]).max() < 0.5


def test_turning_the_scene_turns_the_result():
    def smoothed(theta):
        field = orientation_map(np.mod(theta, np.pi))
        return bilateral(field, adaptive=False, iterations=2).orientation_rad

    theta = noisy(np.linspace(0, 3, 47)[None] * np.ones((31, 1)), 4)
    straight = smoothed(theta)
    turned = axial_difference(smoothed(theta + 1.0), straight + 1.0)
    quarter = axial_difference(np.rot90(smoothed(np.rot90(theta + np.pi / 2)), -1), straight + np.pi / 2)
    for difference in np.abs([turned, quarter]):
        # Where two samples of a window are supported alike, rounding decides which is the pivot.
        assert np.mean(difference < 1e-5) > 0.99
        assert np.rad2deg(difference.max()) < 0.5


def test_no_iteration_changes_nothing():
    theta = noisy(np.ones((9, 9)), 4)
    np.testing.assert_allclose(bilateral(orientation_map(theta), iterations=0).orientation_rad, theta, atol=1e-6)


def test_a_fitted_scene_comes_closer_to_the_truth(caplog):
    orientation, period = facets()
    fit = cosine(photographed(orientation, period, np.arange(12) * np.pi / 12, electrons=2e3), prenormalize=False)
    with caplog.at_level(logging.INFO):
        smooth = bilateral(fit)
    errors = []
    for found in (fit, smooth):
        turn = axial_difference(found.orientation_rad, at_centres(orientation))
        turn = turn[np.isfinite(turn)]
        errors.append(np.rad2deg(np.mean(np.abs(axial_difference(turn, axial_median(turn))))))
    assert errors[1] < 0.8 * errors[0]
    assert "angular width used" in caplog.text


def test_a_map_of_unknown_correlation_is_smoothed_as_one_of_equal_correlation():
    theta = np.random.default_rng(0).normal(1.0, 0.05, (30, 40)).astype(np.float32)
    equal = orientation_map(theta)
    unknown = dataclasses.replace(equal, correlation=np.full_like(theta, np.nan))
    smooth = bilateral(unknown).orientation_rad
    assert np.std(smooth) < 0.2 * np.std(theta)
    np.testing.assert_array_equal(
        smooth, bilateral(dataclasses.replace(equal, correlation=np.ones_like(theta))).orientation_rad
    )


@pytest.mark.parametrize("setting", ["sigma_pixel", "sigma_theta_deg", "iterations", "pivot_radius"])
def test_widths_below_zero_are_refused(setting):
    with pytest.raises(InputError, match=rf"{setting} is -1\s+where: +{setting}\s+expected: "):
        bilateral(orientation_map(np.ones((3, 3))), **{setting: -1})
