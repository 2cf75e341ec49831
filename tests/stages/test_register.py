from __future__ import annotations

import dataclasses
import logging
import re

import cv2
import numpy as np
import OpenImageIO as oiio
import polanalyser
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from polarization import at_centres, facets, photographed, spiral

import pipeline.stages.align.register as module
from pipeline.data.photographs import SIMULTANEOUS, PolarizerSequence
from pipeline.devices.simulated import Camera, Panel, PolarizationBench
from pipeline.errors import InputError, InputErrors
from pipeline.optics.angles import axial_difference, axial_median
from pipeline.optics.rigid import corner_px
from pipeline.stages.align.register import register
from pipeline.stages.capture.polarizer_sequence import polarizer_sequence
from pipeline.stages.fit.cosine import cosine
from pipeline.stages.simulate.facets import facets as simulate_facets
from pipeline.stages.simulate.gradient_stars import gradient_stars
from pipeline.stages.simulate.kinematic_tile import kinematic_tile

TWELVE = np.arange(12) * np.pi / 12
ORIENTATION, PERIOD = facets()


CORNER_PX = corner_px((160, 160))


def by_hand(deviation_px, seed=0):
    shifts = np.random.default_rng(seed).normal(0, deviation_px, (12, 2))
    shifts[0] = 0
    return shifts


def turned_by_hand(deviation_deg, seed=0):
    turns = np.random.default_rng([seed, 1]).normal(0, np.deg2rad(deviation_deg), 12)
    turns[0] = 0
    return turns


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


def test_turns_by_hand_are_found_and_undone(found):
    shifts, turns = by_hand(0.5), turned_by_hand(1.5)
    moved = photographed(ORIENTATION, PERIOD, TWELVE, shifts_px=shifts, turns_rad=turns, electrons=1e4)
    still = photographed(ORIENTATION, PERIOD, TWELVE, electrons=1e4)
    aligned = register(moved)
    assert np.sqrt(np.mean((found[0].shift_px - shifts)[1:] ** 2)) < 0.01
    assert np.sqrt(np.mean((found[0].turn_rad - turns)[1:] ** 2)) * CORNER_PX < 0.12
    assert (np.abs(found[0].turn_rad - turns)[1:] < 4 * found[0].deviation_rad[1:]).all()
    assert orientation_error_deg(aligned) < orientation_error_deg(still) + 0.1
    assert orientation_error_deg(register(moved, motion="shift")) > orientation_error_deg(still) + 0.3


def test_a_photograph_turned_back_is_the_one_that_was_not_turned():
    shifts, turns = by_hand(0.5), turned_by_hand(0.4)
    moved = photographed(ORIENTATION, PERIOD, TWELVE, shifts_px=shifts, turns_rad=turns)
    still = photographed(ORIENTATION, PERIOD, TWELVE)
    aligned = register(moved)
    inside = cv2.erode(aligned.valid.astype(np.uint8), np.ones((7, 7))).astype(bool)
    assert np.abs(aligned.images - still.images)[:, inside].max() < 0.01
    assert np.abs(moved.images - still.images)[:, inside].max() > 0.1


@settings(deadline=None, max_examples=4, derandomize=True, phases=[Phase.generate])
@given(st.floats(-3, 3), st.floats(-8, 8), st.floats(-8, 8), st.integers(0, 9))
def test_any_motion_of_one_photograph_is_found_within_its_stated_deviation(turn_deg, down, right, seed):
    shifts, turns = np.zeros((6, 2)), np.zeros(6)
    shifts[3], turns[3] = (down, right), np.deg2rad(turn_deg)
    six = TWELVE[::2]
    moved = photographed(ORIENTATION, PERIOD, six, shifts_px=shifts, turns_rad=turns, electrons=1e4, seed=seed)
    with pytest.MonkeyPatch.context() as patch:
        kept = []
        original = module._believed
        patch.setattr(module, "_believed", lambda motions, *rest: (kept.append(motions), original(motions, *rest))[1])
        register(moved, motion="rigid")
    error = np.column_stack([kept[0].shift_px - shifts, (kept[0].turn_rad - turns)])[1:]
    deviation = np.sqrt(np.diagonal(kept[0].covariance, axis1=1, axis2=2))[1:]
    assert np.abs(error / deviation).max() < 6
    assert (deviation < [0.01, 0.01, 0.15 / CORNER_PX]).all()


def test_the_stated_deviation_is_that_of_the_turns(found):
    errors, stated = [], []
    for seed in range(3):
        turns = turned_by_hand(0.4, seed)
        moved = photographed(ORIENTATION, PERIOD, TWELVE, turns_rad=turns, electrons=1000, seed=seed)
        register(moved, motion="rigid")
        errors.append((found[-1].turn_rad - turns)[1:])
        stated.append(found[-1].deviation_rad[1:])
    scatter = np.sqrt(np.mean(np.square(errors)))
    assert scatter / 3 < np.mean(stated) < 3 * scatter


def test_a_positive_turn_runs_anticlockwise(found):
    turns = np.zeros(12)
    turns[4] = np.deg2rad(1.0)
    register(photographed(ORIENTATION, PERIOD, TWELVE, turns_rad=turns))
    assert np.rad2deg(found[0].turn_rad[4]) == pytest.approx(1.0, abs=0.01)


def test_turns_are_not_modelled_where_there_are_none(found, caplog):
    moved = photographed(ORIENTATION, PERIOD, TWELVE, shifts_px=by_hand(0.5), electrons=1e4)
    with caplog.at_level(logging.INFO):
        register(moved)
    assert not found[0].turn_rad.any()
    assert "Turns" not in caplog.text


@pytest.mark.parametrize("seed", range(2))
def test_a_spiral_does_not_seem_to_turn_with_the_polariser(seed, found):
    """Each photograph is nearly the one before it, turned by 15 degrees; only the outline says that nothing turned."""
    shifts = by_hand(0.5, seed)
    moved = photographed(*spiral(), TWELVE, shifts_px=shifts, electrons=1e4, seed=seed)
    register(moved)
    assert not found[0].turn_rad.any()
    assert np.sqrt(np.mean((found[0].shift_px - shifts)[1:] ** 2)) < 0.03
    register(moved, motion="rigid")
    assert np.abs(found[1].turn_rad).max() * CORNER_PX < 0.3


def test_turns_that_a_spiral_hides_are_warned_of(found, caplog):
    shifts = by_hand(0.5)
    moved = photographed(*spiral(), TWELVE, shifts_px=shifts, turns_rad=turned_by_hand(1.0), electrons=1e4)
    register(moved)
    assert "Turns of the photographs cannot be told" in caplog.text
    assert np.abs(found[0].shift_px - shifts).max() < 0.1


def test_a_spiral_without_an_outline_is_left_alone_with_a_warning(caplog):
    moved = photographed(*spiral(fills_the_picture=True), TWELVE, shifts_px=by_hand(0.5), electrons=1e4)
    np.testing.assert_array_equal(register(moved).images, moved.images)
    assert "was left where it was: in 6 of the photos the edges agree as well many pixels away" in caplog.text


class Mount:
    """A polariser that stands where it is told, at once."""

    stops_rad = None
    shaft_rad = 0.0

    def move_to(self, angle_rad):
        self.shaft_rad = angle_rad
        return angle_rad


@pytest.mark.parametrize("turn_deg", [0.0, 0.5])
@pytest.mark.parametrize(
    ("draw", "pixel_mm", "shift_px", "tells_turns"),
    [(simulate_facets, 0.02, 0.06, True), (gradient_stars, 0.03, 0.06, True), (kinematic_tile, 0.03, 0.06, False)],
)
def test_coarse_pixels_mislead_nobody(draw, pixel_mm, shift_px, tells_turns, turn_deg, found, caplog):
    """Pixels three times as large as in the experiments: stripes of a few pixels, wheels that turn by a pixel."""
    camera = Camera(pixel_mm=3 * pixel_mm, blur_mm=0.6 * pixel_mm, turn_deg=turn_deg)
    bench = PolarizationBench(camera=camera, mount=Mount(), light=Panel())
    photos = polarizer_sequence(draw(pixel_mm=pixel_mm), rig=bench, count=12, step_deg=15.0)
    register(photos)
    assert np.abs(found[0].shift_px - camera.shifts_px).max() < shift_px
    turn_px = np.abs(found[0].turn_rad - camera.turns_rad) * corner_px(photos.valid.shape)
    if turn_deg and not tells_turns:
        assert "Turns of the photographs cannot be told" in caplog.text
    else:
        assert turn_px.max() < 0.1


def test_stripes_without_an_end_are_left_alone(caplog):
    orientation = np.tile(np.repeat(np.linspace(0.2, 2.8, 10), 80), (800, 1))
    moved = photographed(orientation, np.full_like(orientation, 1.4), TWELVE, shifts_px=by_hand(0.5), electrons=1e4)
    np.testing.assert_array_equal(register(moved).images, moved.images)
    assert "edges agree as well" in caplog.text


def test_a_turn_beyond_the_limit_is_not_believed(caplog):
    turns = np.zeros(12)
    turns[3] = np.deg2rad(1.4)
    moved = photographed(ORIENTATION, PERIOD, TWELVE, turns_rad=turns)
    aligned = register(moved, largest_turn_deg=1.0)
    np.testing.assert_array_equal(aligned.images[3], moved.images[3])
    assert re.search(r"Photo 3 \(45 deg\) was left where it was: a turn of 1\.(39|40) degrees", caplog.text)


@pytest.mark.parametrize("motion", ["auto", "shift", "rigid"])
def test_photographs_of_one_exposure_are_not_touched(motion):
    moved = photographed(ORIENTATION, PERIOD, TWELVE[:4], shifts_px=by_hand(0.5)[:4], turns_rad=turned_by_hand(0.5)[:4])
    mosaic = dataclasses.replace(moved, metadata={SIMULTANEOUS: "yes"})
    assert register(mosaic, motion=motion) is mosaic


def test_limits_that_nobody_means_are_refused():
    photos = photographed(ORIENTATION, PERIOD, TWELVE[:3])
    with pytest.raises(InputError, match=r"largest_turn_deg is -1[\s\S]*a number above 0"):
        register(photos, largest_turn_deg=-1.0)
    with pytest.raises(InputErrors, match=r"largest_shift_px is 0[\s\S]*least_shift_px is -0.1"):
        register(photos, largest_shift_px=0.0, least_shift_px=-0.1)


def test_opencv_on_the_intensities_does_worse(found):
    shifts = by_hand(0.5)
    moved = photographed(ORIENTATION, PERIOD, TWELVE, shifts_px=shifts, electrons=1e4)
    for method in ("edges", "ecc", "phase_correlation"):
        register(moved, method=method)
    ours, ecc, phase = (np.sqrt(np.mean((s.shift_px - shifts)[1:] ** 2)) for s in found)
    assert ours < 0.1 * ecc
    assert ours < 0.1 * phase


@pytest.mark.parametrize(
    ("method", "shift_px", "turn_deg"),
    [("ecc", 0.01, 0.02), ("ecc_edges", 0.05, 0.05), ("phase_correlation", 0.2, 0.3)],
)
def test_opencv_finds_the_turn_where_the_contrast_stays(method, shift_px, turn_deg, found):
    one = photographed(ORIENTATION, PERIOD, TWELVE[:1], electrons=1e5)
    still = {"electrons": 1e5, "seed": 1}
    turned = photographed(
        ORIENTATION, PERIOD, TWELVE[:1], shifts_px=[(3.0, -2.0)], turns_rad=[np.deg2rad(1.5)], **still
    )
    pair = dataclasses.replace(one, images=np.concatenate([one.images, turned.images]), polarizer_rad=TWELVE[:2])
    register(pair, method=method, motion="rigid")
    np.testing.assert_allclose(found[0].shift_px[1], (3.0, -2.0), atol=shift_px)
    assert np.rad2deg(found[0].turn_rad[1]) == pytest.approx(1.5, abs=turn_deg)


@pytest.mark.parametrize("method", ["ecc", "ecc_edges", "phase_correlation"])
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
    assert np.abs(found[0].shift_px).max() < 0.3  # of an alignment whose accuracy is not known
    angle = cosine(aligned, prenormalize=False).orientation_rad
    oracle = polanalyser.cvtStokesToAoLP(polanalyser.calcStokes(images, angles))
    assert np.nanmedian(np.rad2deg(np.abs(axial_difference(angle, oracle)))) < 0.5
