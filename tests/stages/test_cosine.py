from __future__ import annotations

import dataclasses
import logging

import numpy as np
import OpenImageIO as oiio
import polanalyser
import pytest

import pipeline
from pipeline.data.photographs import PolarizerSequence
from pipeline.errors import InputError, InputErrors
from pipeline.optics.angles import axial_difference, axial_mean, axial_median
from pipeline.optics.jones import polarizer_response
from pipeline.stages.fit.cosine import cosine

TWELVE = np.arange(12) * np.pi / 12


def sequence(images, angles):
    images = np.asarray(images, np.float32)
    return PolarizerSequence(images, np.asarray(angles, np.float64), np.ones(images.shape[1:], bool))


def response(theta, angles, r, zeta_deg, film_deg=0.0):
    return polarizer_response(
        np.asarray(angles)[:, None, None],
        theta,
        amplitude_ratio=r,
        phase_rad=np.deg2rad(zeta_deg),
        retardation_rad=np.deg2rad(film_deg),
    )


def test_without_a_film_the_orientation_is_exact_but_for_the_offset_of_equation_9():
    # Eq. 9: I = 1 + (r^2 - 1)(1 - cos 2 psi)/2 - r sin(zeta) sin 2 psi is largest where tan 2 psi =
    # 2 r sin(zeta) / (r^2 - 1) with both negative.
    r, zeta = 1.1, np.deg2rad(45)
    theta = np.linspace(0, np.pi, 200, endpoint=False)[None]
    found = cosine(sequence(response(theta, TWELVE, r, 45) / 3, TWELVE), prenormalize=False, threshold=0.0)
    offset = np.arctan2(-r * np.sin(zeta), -(r**2 - 1) / 2) / 2
    assert np.abs(axial_difference(found.orientation_rad, theta + offset)).max() < 1e-5
    assert found.correlation.min() > 1 - 1e-6
    assert not found.absolute


def test_turning_the_grating_anticlockwise_raises_the_angle():
    theta = np.deg2rad([[20.0, 30.0]])
    found = cosine(sequence(response(theta, TWELVE, 1.1, 45) / 3, TWELVE), prenormalize=False, threshold=0.0)
    assert axial_difference(*found.orientation_rad[0, ::-1]) == pytest.approx(np.deg2rad(10), abs=1e-5)


@pytest.mark.parametrize(
    ("r", "zeta_deg", "film_deg", "with_deg", "without_deg"),
    [
        (1.1, 45, 3, 1.1, 0.5),
        (1.1, 45, 30, 17, 23),
        (1.05, 10, 3, 5.3, 3.8),
        (1.05, 10, 10, 22, 29),
        (1.001, 164, 3, 0.4, 6.9),
        (1.001, 176, 3, 1.4, 32),
        (1.001, 176, 30, 5.2, 43),
    ],
)
def test_the_known_edges_of_the_estimator(r, zeta_deg, film_deg, with_deg, without_deg):
    """Mean error on uniform orientations, 12 photographs, shot noise of 10,000 electrons, offset removed."""
    rng = np.random.default_rng(0)
    theta = np.linspace(0, np.pi, 40000, endpoint=False).reshape(200, 200)
    signal = response(theta, TWELVE, r, zeta_deg, film_deg)
    photos = sequence(rng.poisson(1e4 * signal) / 4e4, TWELVE)
    for prenormalize, expected in ((True, with_deg), (False, without_deg)):
        found = cosine(photos, prenormalize=prenormalize, threshold=0.0)
        turn = axial_difference(found.orientation_rad, theta)
        error = np.rad2deg(np.mean(np.abs(axial_difference(turn, axial_mean(turn)))))
        assert error == pytest.approx(expected, rel=0.07, abs=0.1)


def test_prenormalising_subtracts_the_same_vector_from_every_cosine():
    theta = np.random.default_rng(0).uniform(0.2, 1.4, (30, 40))
    signal = response(theta, TWELVE, 1.1, 45) / 3
    double = 2 * TWELVE
    c, s = (np.einsum("k,kij->ij", f(double), signal) / 6 for f in (np.cos, np.sin))
    found = cosine(sequence(signal, TWELVE), prenormalize=True, threshold=0.0)
    expected = np.arctan2(s - s.mean(), c - c.mean()) / 2
    assert np.abs(axial_difference(found.orientation_rad, expected)).max() < 1e-3
    np.testing.assert_allclose(found.intensity, signal.mean(axis=0), rtol=1e-5)


def test_a_dark_ground_is_masked_and_takes_no_part_in_prenormalising(caplog):
    rng = np.random.default_rng(0)
    theta = np.linspace(0, np.pi, 60 * 50, endpoint=False).reshape(60, 50)
    signal = np.concatenate([response(theta, TWELVE, 1.1, 45) / 3, np.full((12, 60, 70), 0.01)], axis=2)
    photos = sequence(rng.poisson(2e4 * signal) / 2e4, TWELVE)
    with caplog.at_level(logging.INFO):
        found = cosine(photos)
    np.testing.assert_array_equal(found.mask, np.arange(120) < 50 + np.zeros((60, 1)))
    assert np.isnan(found.orientation_rad[~found.mask]).all()
    assert "two distinct modes" in caplog.text
    alone = cosine(sequence(photos.images[:, :, :50], TWELVE), threshold=0.0)
    np.testing.assert_allclose(found.orientation_rad[:, :50], alone.orientation_rad, atol=1e-5)


@pytest.mark.parametrize("valid_share", [1.0, 0.002])
def test_the_threshold_of_a_large_photograph_lies_between_ground_and_print(valid_share):
    """From a part of the pixels, but not so few that a small region of interest has none."""
    rng = np.random.default_rng(0)
    prints = np.zeros((900, 1200), bool)
    prints[:, :400] = True
    level = np.where(prints, 0.3, 0.02) * rng.uniform(0.9, 1.1, prints.shape)
    photos = sequence(level * (1 + 0.2 * np.cos(2 * TWELVE - 1))[:, None, None], TWELVE)
    valid = rng.random(prints.shape) < valid_share
    found = cosine(dataclasses.replace(photos, valid=valid), prenormalize=False)
    np.testing.assert_array_equal(found.mask, prints & valid)


def test_a_scene_of_one_broad_mode_keeps_all_its_pixels(caplog):
    level = np.exp(np.random.default_rng(0).normal(-2, 0.8, (100, 100)))
    signal = np.minimum(level, 0.9) * (1 + 0.1 * np.cos(2 * TWELVE - 1))[:, None, None]
    with caplog.at_level(logging.INFO):
        found = cosine(sequence(signal, TWELVE), prenormalize=False)
    assert found.mask.all()
    assert "no two distinct modes" in caplog.text


def test_a_given_threshold_is_used_as_it_is():
    level = np.linspace(0.01, 1, 50) * np.ones((4, 1))
    signal = level * (1 + 0.1 * np.cos(2 * TWELVE))[:, None, None]
    found = cosine(sequence(signal, TWELVE), prenormalize=False, threshold=0.5)
    np.testing.assert_array_equal(found.mask, level >= 0.5)


def test_invalid_and_nan_pixels_are_masked_and_change_nothing_else():
    theta = np.linspace(0, np.pi, 400, endpoint=False).reshape(20, 20)
    photos = sequence(response(theta, TWELVE, 1.1, 45) / 3, TWELVE)
    images = photos.images.copy()
    images[3, 5, 6] = np.nan
    images[7, 8, 9] = 1.0
    valid = photos.valid.copy()
    valid[5, 6] = valid[8, 9] = False
    found = cosine(dataclasses.replace(photos, images=images, valid=valid), threshold=0.0)
    level = np.array([image[valid].mean(dtype=np.float64) for image in images])
    assert np.isnan(found.orientation_rad[[5, 8], [6, 9]]).all()
    assert found.mask.sum() == 398
    assert np.isfinite(level).all()
    whole = cosine(photos, threshold=0.0)
    assert np.abs(axial_difference(found.orientation_rad, whole.orientation_rad))[valid].max() < 0.01


def test_unequal_steps_do_not_bend_the_map():
    angles = np.deg2rad([0, 13, 26.5, 41, 52, 64, 79, 90, 104, 117, 131, 143])
    theta = np.linspace(0, np.pi, 300, endpoint=False)[None]
    equal = cosine(sequence(response(theta, TWELVE, 1.1, 45) / 3, TWELVE), prenormalize=False, threshold=0.0)
    unequal = cosine(sequence(response(theta, angles, 1.1, 45) / 3, angles), prenormalize=False, threshold=0.0)
    assert np.abs(axial_difference(equal.orientation_rad, unequal.orientation_rad)).max() < 1e-5
    np.testing.assert_allclose(equal.intensity, unequal.intensity, rtol=1e-5)


def test_angles_that_hardly_differ_are_warned_of(caplog):
    cosine(sequence(np.random.default_rng(0).random((3, 4, 4)), np.deg2rad([0, 4, 8])), threshold=0.0)
    assert "badly determined" in caplog.text


def test_three_photographs_leave_nothing_to_correlate(caplog):
    rng = np.random.default_rng(0)
    three = cosine(sequence(rng.random((3, 6, 7)), np.deg2rad([0, 60, 120])), threshold=0.0)
    assert np.isnan(three.correlation).all()
    assert np.isfinite(three.orientation_rad).all()
    assert [r.getMessage()[:47] for r in caplog.records if r.levelno == logging.WARNING] == [
        "A cosine goes exactly through three photographs"
    ]
    caplog.clear()
    four = cosine(sequence(rng.random((4, 6, 7)), np.deg2rad([0, 45, 90, 135])), threshold=0.0)
    assert np.isfinite(four.correlation).all()
    assert not [r for r in caplog.records if r.levelno == logging.WARNING]


def test_two_distinct_angles_are_refused():
    with pytest.raises(InputError, match="three or more polariser angles"):
        cosine(sequence(np.random.default_rng(0).random((4, 3, 3)), np.deg2rad([0, 90, 180, 270])))


def test_a_threshold_above_everything_is_refused():
    with pytest.raises(InputError, match="no pixel is valid, modulated and brighter than 2"):
        cosine(sequence(np.random.default_rng(0).random((4, 3, 3)), TWELVE[::3]), threshold=2.0)


def test_a_threshold_below_nought_is_refused():
    with pytest.raises(InputError, match="threshold is -1"):
        cosine(sequence(np.random.default_rng(0).random((4, 3, 3)), TWELVE[::3]), threshold=-1.0)


@pytest.mark.parametrize("stage", ["cosine", "jones", "auto"])
def test_a_threshold_below_nought_is_refused_before_anything_runs(stage, tmp_path):
    words = [f"graph.fit.stage=fit.{stage}", "graph.fit.threshold=-1", f"paths.runs={tmp_path}"]
    with pytest.raises(InputErrors, match=r"threshold is -1\n  where: +graph.fit: threshold\n  expected: 0 or more"):
        pipeline.run("polarization_logo", words)
    assert not list(tmp_path.rglob("manifest.json"))


@pytest.mark.parametrize("scene", ["glass", "fabrics"])
def test_real_photographs_give_the_angle_of_linear_polarisation_of_polanalyser(measurements, scene):
    angles = np.deg2rad([0, 45, 90, 135])
    folder = measurements / "polarization" / scene
    names = [f"NIR_filtre_nir_{a}_aligned.tif" for a in (0, 45, 90, 135)]
    images = np.stack([oiio.ImageBuf(str(folder / name)).get_pixels(oiio.FLOAT)[..., 0] for name in names])
    found = cosine(sequence(images, angles), prenormalize=False)
    stokes = polanalyser.calcStokes(images, angles)
    oracle = polanalyser.cvtStokesToAoLP(stokes)
    difference = np.rad2deg(np.abs(axial_difference(found.orientation_rad, oracle)))
    assert np.nanmedian(difference) < 1e-4
    assert found.mask.mean() > 0.99
    assert axial_median(axial_difference(found.orientation_rad, oracle)[found.mask]) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("count", [4, 12])
def test_a_map_of_noise_is_warned_of(count, caplog):
    angles = np.arange(count) * np.pi / count
    rng = np.random.default_rng(0)
    noise = 0.4 + 0.01 * rng.standard_normal((count, 60, 60))
    cosine(sequence(noise, angles), prenormalize=False)
    assert "the orientations may mean nothing" in caplog.text
    caplog.clear()
    theta = np.linspace(0, np.pi, 60, endpoint=False)[None] * np.ones((60, 1))
    cosine(sequence(response(theta, angles, 1.1, 45) / 3 + 0.01 * noise, angles), prenormalize=False)
    assert "may mean nothing" not in caplog.text
