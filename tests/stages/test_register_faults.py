"""Sequences in which some photograph cannot be registered: it stays, by name, and the others do not suffer."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from polarization import facets, photographed
from scipy import ndimage

import pipeline.stages.align._edge_motions as edge_motions
from pipeline.data.photographs import PolarizerSequence
from pipeline.optics.coarse_registration import Start
from pipeline.optics.rigid import RigidMotion
from pipeline.stages.align.register import register

TWELVE = np.arange(12) * np.pi / 12
ORIENTATION, PERIOD = facets()
METHODS = ["edges", "ecc", "ecc_edges", "phase_correlation"]
BY_HAND = np.random.default_rng(0).normal(0, 0.5, (12, 2))
BY_HAND[0] = 0
STILL = photographed(ORIENTATION, PERIOD, TWELVE, electrons=1e5)


def shifted(**of_photo):
    """Shifts by hand, but for photographs that are given as ``p5=(0, 60)``."""
    shifts = BY_HAND.copy()
    for name, shift in of_photo.items():
        shifts[int(name[1:])] = shift
    return photographed(ORIENTATION, PERIOD, TWELVE, shifts_px=shifts, electrons=1e5)


def noise(shape, seed):
    return np.random.default_rng(seed).poisson(1000, shape).astype(np.float32) / 2000


def left_alone(caplog):
    """Photographs that a warning names, with its reason."""
    told = [r.getMessage() for r in caplog.records if "was left where it was" in r.getMessage()]
    return {int(message.split()[1]): message.partition("was left where it was: ")[2] for message in told}


def check_others(aligned, moved, bad):
    """All but the photographs ``bad`` lie where the still ones do, and those are as they were."""
    inside = aligned.valid & (ndimage.uniform_filter(aligned.valid.astype(float), 9) == 1)
    assert inside.mean() > 0.25
    for k in range(12):
        if k in bad:
            np.testing.assert_array_equal(aligned.images[k], moved.images[k])
        else:
            assert np.abs(aligned.images[k] - STILL.images[k])[inside].mean() < 0.004  # 0.02 where left unregistered


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("shape", [(1, 1), (1, 60), (60, 1), (2, 2), (7, 7), (20, 30)])
def test_pictures_too_small_to_tell_a_motion_stay(shape, method, caplog):
    photos = PolarizerSequence(noise((3, *shape), 0), TWELVE[:3], np.ones(shape, bool))
    for motion in ("auto", "shift", "rigid"):
        caplog.clear()
        assert register(photos, method=method, motion=motion) is photos
        assert set(left_alone(caplog)) == {1, 2}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("side", [60, 100, 160])
def test_noise_is_never_moved(side, method, caplog):
    for seed in range(4):
        caplog.clear()
        photos = PolarizerSequence(noise((4, side, side), seed), TWELVE[:4], np.ones((side, side), bool))
        assert register(photos, method=method) is photos
        assert set(left_alone(caplog)) == {1, 2, 3}


@pytest.mark.parametrize("method", METHODS)
def test_one_photograph_of_noise_stays(method, caplog):
    moved = shifted()
    moved.images[5] = noise((160, 160), 1)
    aligned = register(moved, method=method)
    assert "no better than those of an unrelated photo" in left_alone(caplog)[5]
    np.testing.assert_array_equal(aligned.images[5], moved.images[5])


def dark(images):
    images[5] = 0


def of_noise(images):
    images[[2, 5, 7, 8]] = noise((4, 160, 160), 1)


def turned_by_a_kick(images):
    images[5] = ndimage.rotate(images[5], 25, reshape=False, mode="nearest")


@pytest.mark.parametrize(("spoil", "bad"), [(dark, {5}), (of_noise, {2, 5, 7, 8}), (turned_by_a_kick, {5})])
def test_photographs_of_something_else_stay_and_the_others_are_registered(spoil, bad, caplog):
    moved = shifted()
    spoil(moved.images)
    aligned = register(moved)
    check_others(aligned, moved, bad)
    assert set(left_alone(caplog)) == bad


@pytest.mark.parametrize("shift", [(0, 60), (30, 50), (0, 100)])
def test_a_photograph_beyond_the_limit_stays_and_the_others_are_registered(shift, caplog):
    moved = shifted(p5=shift)
    check_others(register(moved), moved, {5})
    reason = f"a shift of about {np.hypot(*shift):.0f} px is not believed."
    assert left_alone(caplog) == {5: reason}


@pytest.mark.parametrize("far", [{"p5": (0, 60)}, {"p5": (-40, -70)}, {"p3": (0, 50), "p8": (0, -50)}])
def test_photographs_far_off_are_registered_where_the_limit_lets_them(far, caplog):
    moved = shifted(**far)
    check_others(register(moved, largest_shift_px=90.0), moved, set())
    assert not left_alone(caplog)


def test_of_two_photographs_that_share_nothing_one_is_registered(caplog):
    moved = shifted(p5=(60, 60), p6=(-60, -60))
    aligned = register(moved, largest_shift_px=90.0)
    assert left_alone(caplog) == {6: "a shift of about 85 px leaves too little in common."}
    check_others(aligned, moved, {6})


def test_the_first_photograph_of_something_else_moves_none(caplog):
    moved = shifted()
    moved.images[0] = noise((160, 160), 1)
    assert register(moved) is moved
    assert set(left_alone(caplog)) == set(range(1, 12))


def test_a_photograph_on_which_two_ways_of_comparing_it_differ_is_left_out(caplog, monkeypatch):
    original, seen = edge_motions.coarse_motion, []

    def wrong_for_the_fifth(reference, moved, **options):
        seen.append(moved)
        found = original(reference, moved, **options)
        return Start(RigidMotion(0.0, (14.0, 9.0)), found.rival) if len(seen) == 5 else found

    monkeypatch.setattr(edge_motions, "over_rows", lambda call, count, tile: call(0, count))
    monkeypatch.setattr(edge_motions, "coarse_motion", wrong_for_the_fifth)
    moved = shifted()
    check_others(register(moved, motion="shift"), moved, {5})
    assert "two ways of comparing its edges" in left_alone(caplog)[5]


def test_limits_are_the_user_s_for_opencv_too(caplog):
    pair = dataclasses.replace(STILL, images=STILL.images[:2].copy(), polarizer_rad=TWELVE[:2])
    pair.images[1] = np.roll(pair.images[0], 50, axis=1)
    register(pair, method="phase_correlation")
    assert left_alone(caplog) == {1: "a shift of about 50 px is not believed."}
