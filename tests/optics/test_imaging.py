"""Lens and sensor."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from pipeline.optics.imaging import area_average, seen_by_lens, sensor_signal


def centroid(image: np.ndarray) -> np.ndarray:
    rows, columns = np.indices(image.shape)
    return np.array([(image * rows).sum(), (image * columns).sum()]) / image.sum()


@given(st.floats(-4, 4), st.floats(-4, 4), st.sampled_from([0.0, 1.0, 2.5]))
def test_a_scene_moves_down_and_right_by_its_shift(down: float, right: float, blur: float) -> None:
    scene = np.zeros((61, 61), np.float32)
    scene[28:33, 30] = 1
    seen = seen_by_lens(scene, blur_px=blur, shift_px=(down, right))
    np.testing.assert_allclose(centroid(seen) - centroid(scene), [down, right], atol=2e-3)
    assert seen.sum() == pytest.approx(scene.sum(), rel=1e-4)


@settings(deadline=None)
@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-0.3, 0.3), st.sampled_from([1.0, 2.5]))
def test_a_scene_turns_anticlockwise_about_its_centre_and_then_moves(
    down: float, right: float, turn: float, blur: float
) -> None:
    scene = np.zeros((81, 81), np.float32)
    scene[38:43, 60] = 1  # 20 pixels to the right of the centre
    seen = seen_by_lens(scene, blur_px=blur, shift_px=(down, right), turn_rad=turn)
    expected = [40 - 20 * np.sin(turn) + down, 40 + 20 * np.cos(turn) + right]
    np.testing.assert_allclose(centroid(seen), expected, atol=5e-3)
    assert seen.sum() == pytest.approx(scene.sum(), rel=1e-2)


def test_a_turn_adds_no_blur() -> None:
    spot = np.zeros((81, 81), np.float32)
    spot[40, 60] = 1
    rows, columns = np.indices(spot.shape)
    for turn in (0.0, 0.01, 0.3):
        seen = seen_by_lens(spot, blur_px=1.8, turn_rad=turn).astype(np.float64)
        row, column = centroid(seen)
        spread = (seen * ((rows - row) ** 2 + (columns - column) ** 2)).sum() / seen.sum()
        assert spread == pytest.approx(2 * 1.8**2, rel=5e-3)


def test_a_sharp_scene_does_not_ring_when_it_turns() -> None:
    scene = np.zeros((60, 60), np.float32)
    scene[20:40, 20:40] = 1
    seen = seen_by_lens(scene, blur_px=0.0, turn_rad=0.1)
    assert seen.min() >= 0
    assert seen.max() <= 1


def test_light_from_beyond_the_border_goes_on_as_it_ended() -> None:
    even = np.full((40, 60), 0.7, np.float32)
    seen = seen_by_lens(even, blur_px=1.5, shift_px=(3.0, -2.0), turn_rad=0.2)
    np.testing.assert_allclose(seen, 0.7, rtol=1e-5)


def test_blur_is_the_gaussian_of_scipy() -> None:
    scene = np.random.default_rng(0).random((40, 50)).astype(np.float32)
    expected = ndimage.gaussian_filter(scene.astype(np.float64), 1.8, mode="nearest", truncate=5)
    np.testing.assert_allclose(seen_by_lens(scene, blur_px=1.8), expected, atol=1e-4)


def test_area_average_collects_whole_pixels() -> None:
    fine = np.random.default_rng(0).random((9, 13)).astype(np.float32)
    expected = fine[:9, :12].reshape(3, 3, 4, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(area_average(fine, 3), expected, rtol=1e-5)


def test_shot_noise_has_the_variance_of_its_electrons() -> None:
    light = np.full((400, 400), 0.4, np.float32)
    signal, saturated = sensor_signal(
        light,
        full_well_electrons=10_000,
        read_noise_electrons=20,
        shot_noise=True,
        bits=None,
        rng=np.random.default_rng(1),
    )
    electrons = signal.astype(np.float64) * 10_000
    assert electrons.mean() == pytest.approx(4000, rel=1e-3)
    assert electrons.var() == pytest.approx(4000 + 20**2, rel=0.02)
    assert not saturated.any()


def test_without_noise_the_converter_rounds_and_saturates() -> None:
    light = np.array([[0.0, 0.5, 0.9999, 1.5]], np.float32)
    signal, saturated = sensor_signal(
        light,
        full_well_electrons=1000,
        read_noise_electrons=0,
        shot_noise=False,
        bits=2,
        rng=np.random.default_rng(0),
    )
    np.testing.assert_allclose(signal, [[0, 2 / 3, 1, 1]], rtol=1e-6)
    np.testing.assert_array_equal(saturated, [[False, False, True, True]])
