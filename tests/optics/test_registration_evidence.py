from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from pipeline.optics.coarse_registration import edge_image, edge_images
from pipeline.optics.registration import too_small
from pipeline.optics.registration_evidence import Agreement, agreement, judged
from pipeline.optics.rigid import RigidMotion
from pipeline.optics.rigid_sampling import resampled

SEARCH = {"largest_px": 30, "largest_rad": 0.1}


def texture(seed: int, shape: tuple[int, int] = (200, 240), blur_px: float = 2.0) -> np.ndarray:
    white = np.random.default_rng(seed).normal(size=shape)
    return (0.5 + 0.1 * ndimage.gaussian_filter(white, blur_px) / 0.14).astype(np.float32)


def by_chance(one: np.ndarray, other: np.ndarray) -> bool:
    return Agreement(significance=agreement(one, other)[1]).by_chance


@settings(deadline=None, max_examples=20)
@given(st.integers(-120, 120), st.integers(-120, 120), st.booleans())
def test_shared_edges_are_told_wherever_they_lie_and_whatever_their_sign(down, right, negative):
    scene = texture(0, (500, 500))
    first = scene[130:330, 130:370]
    second = scene[130 - down : 330 - down, 130 - right : 370 - right]
    shift, significance = agreement(edge_image(first), edge_image(1 - second if negative else second))
    assert not Agreement(significance=significance).by_chance
    np.testing.assert_allclose(shift, (down, right), atol=1)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10**6), st.floats(0.0, 6.0), st.sampled_from([(40, 40), (60, 200), (160, 160)]))
def test_two_textures_of_one_kind_agree_by_chance(seed, blur_px, shape):
    one, other = (edge_image(texture(s, shape, blur_px)) for s in (seed, seed + 10**6 + 1))
    assert by_chance(one, other)


def test_chance_is_what_normal_deviates_reach():
    """Of so many independent shifts the largest is near the root of twice the logarithm of their number."""
    found = [agreement(*(edge_image(texture(s, (300, 300), 0.0)) for s in (seed, seed + 100)))[1] for seed in range(8)]
    expected = np.sqrt(2 * np.log(450**2 / 4))  # edges are a few pixels wide
    assert np.mean(found) == pytest.approx(expected, rel=0.3)


@pytest.mark.parametrize("value", [0.0, 0.5])
def test_a_picture_without_edges_agrees_with_nothing(value):
    even = np.full((200, 240), value, np.float32)
    assert by_chance(edge_image(even), edge_image(texture(0)))
    assert by_chance(edge_image(even), edge_image(even))


def test_a_turn_does_not_hide_what_is_shared():
    first = texture(0)
    second = resampled(first, RigidMotion(0.08), first.shape, order=3, outside=0.5)
    levels = edge_images(first), edge_images(second)
    assert by_chance(levels[0][-1], levels[1][-1])
    for known_rad in (-0.08, 0.0):
        found = judged(*levels, turn_rad=known_rad, **SEARCH)
        assert not found.by_chance
        assert found.motion.turn_rad == pytest.approx(-0.08, abs=0.01)


def test_detail_that_averaging_pixels_loses_is_looked_for_in_the_pixels():
    fine, lost = edge_image(texture(0, (200, 240))), [edge_image(texture(s, (100, 120), 0.0)) for s in (1, 2)]
    found = judged([lost[0], fine], [lost[1], np.roll(fine, 7, axis=1)], turn_rad=0.0, **SEARCH)
    assert not found.by_chance
    assert found.motion.shift_px == (0, 7)


def test_distances_are_in_the_photograph_s_pixels():
    scene = texture(0, (640, 640), 4.0)
    levels = edge_images(scene[50:590, 40:580]), edge_images(scene[50:590, 80:620])
    assert levels[0][1].shape == (270, 270)
    assert levels[0][2].shape == (540, 540)
    found = judged(*levels, turn_rad=0.0, **SEARCH)
    assert found.step_px == 2
    np.testing.assert_allclose(found.motion.shift_px, (0, -40), atol=2)


@pytest.mark.parametrize(("shape", "small"), [((41, 52), False), ((40, 52), True), ((41, 51), True), ((1, 1), True)])
def test_twelve_patches_and_their_margin_are_the_least(shape, small):
    assert too_small(shape) is small
