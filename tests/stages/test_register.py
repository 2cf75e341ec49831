from __future__ import annotations

import dataclasses
import logging

import numpy as np
import OpenImageIO as oiio
import polanalyser
import pytest
from polarization import at_centres, facets, photographed

import pipeline.stages.align.register as module
from pipeline.data import PolarizerSequence
from pipeline.optics.angles import axial_difference, axial_median
from pipeline.stages.align.register import register
from pipeline.stages.fit.cosine import cosine

TWELVE = np.arange(12) * np.pi / 12
ORIENTATION, PERIOD = facets()


def by_hand(deviation_px, seed=0):
    shifts = np.random.default_rng(seed).normal(0, deviation_px, (12, 2))
    shifts[0] = 0
    return shifts


@pytest.fixture
def found(monkeypatch):
    """The shifts that the stage estimated."""
    kept = []
    original = module._believed
    monkeypatch.setattr(module, "_believed", lambda shifts, *rest: (kept.append(shifts), original(shifts, *rest))[1])
    return kept


def orientation_error_deg(photos):
    fit = cosine(photos, prenormalize=False)
    turn = axial_difference(fit.orientation_rad, at_centres(ORIENTATION))
    known = np.isfinite(turn)
    return np.rad2deg(np.mean(np.abs(axial_difference(turn[known], axial_median(turn[known])))))


def test_shifts_by_hand_are_found_to_a_fiftieth_of_a_pixel_and_undone(found):
    shifts = by_hand(0.5)
    moved = photographed(ORIENTATION, PERIOD, TWELVE, shifts_px=shifts, electrons=1e4)
    still = photographed(ORIENTATION, PERIOD, TWELVE, electrons=1e4)
    aligned = register(moved)
    assert np.sqrt(np.mean((found[0].shift_px - shifts)[1:] ** 2)) < 0.02
    assert np.abs(found[0].shift_px - shifts).max() < 5 * found[0].deviation_px.max() + 0.01
    assert orientation_error_deg(aligned) < orientation_error_deg(still) + 0.1
    assert orientation_error_deg(moved) > orientation_error_deg(still) + 0.3


def test_shifts_that_vary_like_the_signal_are_found_too(found):
    """A fitted cosine would take shifts in cos 2 psi for signal."""
    shifts = 0.4 * np.stack([np.cos(2 * TWELVE) - 1, np.sin(2 * TWELVE)], axis=1)
    register(photographed(ORIENTATION, PERIOD, TWELVE, shifts_px=shifts, electrons=1e4))
    assert np.abs(found[0].shift_px - shifts).max() < 0.03


def test_shifts_of_many_pixels_are_found(found):
    shifts = by_hand(6.0, seed=1)
    aligned = register(photographed(ORIENTATION, PERIOD, TWELVE, shifts_px=shifts, electrons=1e4))
    assert np.abs(found[0].shift_px - shifts).max() < 0.05
    rows, columns = np.nonzero(aligned.valid)
    lost_top, lost_left = max(0, np.ceil(-shifts[:, 0].min())), max(0, np.ceil(-shifts[:, 1].min()))
    assert rows.min() == pytest.approx(lost_top, abs=1)
    assert columns.min() == pytest.approx(lost_left, abs=1)


def test_a_shift_down_and_to_the_right_has_positive_sign(found):
    shifts = np.zeros((12, 2))
    shifts[4] = (1.5, 0.75)
    register(photographed(ORIENTATION, PERIOD, TWELVE, shifts_px=shifts))
    np.testing.assert_allclose(found[0].shift_px[4], (1.5, 0.75), atol=0.02)


def test_what_came_from_outside_the_picture_is_not_valid():
    shifts = np.zeros((12, 2))
    shifts[4] = (0.4, -0.3)  # less than half a pixel: no whole row or column is lost
    moved = photographed(ORIENTATION, PERIOD, TWELVE, shifts_px=shifts)
    valid = register(moved).valid
    assert not valid[-1].any()
    assert not valid[:, 0].any()
    assert valid[:-1, 1:].all()


def test_the_stated_deviation_is_that_of_the_shifts(found):
    errors, stated = [], []
    for seed in range(6):
        shifts = by_hand(0.5, seed)
        register(photographed(ORIENTATION, PERIOD, TWELVE, shifts_px=shifts, electrons=150, seed=seed))
        errors.append((found[-1].shift_px - shifts)[1:])
        stated.append(found[-1].deviation_px[1:])
    scatter = np.sqrt(np.mean(np.square(errors)))
    assert scatter / 3 < np.mean(stated) < 3 * scatter


def test_noisy_photographs_that_did_not_move_are_not_resampled(found):
    still = photographed(ORIENTATION, PERIOD, TWELVE, electrons=1000)
    aligned = register(still, least_shift_px=0.0)
    same = [np.array_equal(a, b) for a, b in zip(aligned.images, still.images, strict=True)]
    assert np.abs(found[0].shift_px[1:]).max() > 0
    assert np.mean(same) > 0.8


def test_photographs_that_did_not_move_come_back_as_they_were():
    still = photographed(ORIENTATION, PERIOD, TWELVE, electrons=1e4)
    aligned = register(still)
    np.testing.assert_array_equal(aligned.images, still.images)
    np.testing.assert_array_equal(aligned.valid, still.valid)


def test_it_is_a_function_of_its_input_alone_and_leaves_that_untouched():
    moved = photographed(ORIENTATION, PERIOD, TWELVE, shifts_px=by_hand(0.5), electrons=1e4)
    before = moved.images.copy()
    for method in ("edges", "phase_correlation", "ecc"):
        first, second = register(moved, method=method), register(moved, method=method)
        np.testing.assert_array_equal(first.images, second.images)
        np.testing.assert_array_equal(moved.images, before)


def test_opencv_on_the_intensities_does_worse(found):
    shifts = by_hand(0.5)
    moved = photographed(ORIENTATION, PERIOD, TWELVE, shifts_px=shifts, electrons=1e4)
    for method in ("edges", "ecc", "phase_correlation"):
        register(moved, method=method)
    ours, ecc, phase = (np.sqrt(np.mean((s.shift_px - shifts)[1:] ** 2)) for s in found)
    assert ours < 0.1 * ecc
    assert ours < 0.1 * phase


@pytest.mark.parametrize("method", ["ecc", "phase_correlation"])
def test_opencv_finds_the_shift_where_the_contrast_stays(method, found):
    one = photographed(ORIENTATION, PERIOD, TWELVE[:1], electrons=1e5)
    shifted = photographed(ORIENTATION, PERIOD, TWELVE[:1], shifts_px=[(3.0, -2.0)], electrons=1e5, seed=1)
    pair = dataclasses.replace(one, images=np.concatenate([one.images, shifted.images]), polarizer_rad=TWELVE[:2])
    register(pair, method=method)
    np.testing.assert_allclose(found[0].shift_px[1], (3.0, -2.0), atol=0.1)


def test_none_hands_the_photographs_on():
    photos = photographed(ORIENTATION, PERIOD, TWELVE[:3])
    assert register(photos, method="none") is photos


def test_an_empty_scene_is_left_alone_with_a_warning(caplog):
    noise = np.random.default_rng(0).poisson(1000, (4, 30, 30)).astype(np.float32) / 2000
    photos = PolarizerSequence(noise, TWELVE[:4], np.ones((30, 30), bool))
    np.testing.assert_array_equal(register(photos).images, noise)
    assert "was left where it was: too few edges" in caplog.text


def test_a_shift_beyond_the_limit_is_not_believed(caplog, found):
    shifts = np.zeros((12, 2))
    shifts[3] = (2.0, 0.0)
    moved = photographed(ORIENTATION, PERIOD, TWELVE, shifts_px=shifts)
    aligned = register(moved, largest_shift_px=1.0)
    np.testing.assert_array_equal(aligned.images[3], moved.images[3])
    assert "Photo 3 (45 deg) was left where it was: a shift of" in caplog.text


def test_an_invalid_pixel_moves_with_its_photograph_and_spoils_nothing_else(caplog):
    shifts = np.zeros((12, 2))
    shifts[5] = (3.0, -2.0)
    moved = photographed(ORIENTATION, PERIOD, TWELVE, shifts_px=shifts)
    images, valid = moved.images.copy(), moved.valid.copy()
    images[5, 80, 90] = np.nan
    valid[80, 90] = False
    with caplog.at_level(logging.INFO):
        aligned = register(dataclasses.replace(moved, images=images, valid=valid))
    assert "Moved: 5;" in caplog.text
    assert not aligned.valid[77, 92]
    assert not aligned.valid[80, 90]
    assert aligned.valid[70:75, 80:85].all()
    assert np.isfinite(aligned.images[:, aligned.valid]).all()
    clean = register(moved)
    inside = aligned.valid & clean.valid
    assert np.abs(aligned.images - clean.images)[:, inside].max() < 0.02


@pytest.mark.parametrize("scene", ["glass", "fabrics"])
def test_real_photographs_already_aligned_keep_their_angle(measurements, scene, found):
    angles = np.deg2rad([0, 45, 90, 135])
    folder = measurements / "polarization" / scene
    names = [f"NIR_filtre_nir_{a}_aligned.tif" for a in (0, 45, 90, 135)]
    images = np.stack([oiio.ImageBuf(str(folder / name)).get_pixels(oiio.FLOAT)[..., 0] for name in names])
    aligned = register(PolarizerSequence(images, angles, np.ones(images.shape[1:], bool)))
    assert np.abs(found[0].shift_px).max() < 0.25
    angle = cosine(aligned, prenormalize=False).orientation_rad
    oracle = polanalyser.cvtStokesToAoLP(polanalyser.calcStokes(images, angles))
    assert np.nanmedian(np.rad2deg(np.abs(axial_difference(angle, oracle)))) < 0.5
