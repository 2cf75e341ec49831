from __future__ import annotations

import numpy as np
import polanalyser
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.optics.angles import axial_difference
from pipeline.optics.harmonic import empty_maps, fit_rows, fit_second_harmonic, harmonic_fit, mask_rows, sum_rows

EQUAL = np.arange(12) * np.pi / 12
UNEQUAL = np.deg2rad([0, 13, 26.5, 41, 52, 64, 79, 90, 104, 117, 131, 143])


def cosines(angles, shape=(40, 70), seed=0):
    rng = np.random.default_rng(seed)
    phase, contrast, level = rng.random((3, *shape))
    contrast = 0.2 + 0.8 * contrast
    level = 0.2 + level
    images = level * (1 + contrast * np.cos(2 * (np.asarray(angles)[:, None, None] - np.pi * phase)))
    return images, np.pi * phase, level


@pytest.mark.parametrize("angles", [EQUAL, UNEQUAL, UNEQUAL[:3], UNEQUAL[:4], EQUAL[:6]])
def test_a_noiseless_cosine_is_recovered(angles):
    images, phase, level = cosines(angles)
    orientation, correlation, mean = fit_second_harmonic(images, angles)
    gain = harmonic_fit(angles).condition  # of float32 rounding
    assert np.abs(axial_difference(orientation, phase)).max() < 2e-6 * gain
    assert correlation.min() > 1 - 1e-6 * gain
    np.testing.assert_allclose(mean, level, rtol=1e-6 * gain)


def test_the_arc_tangent_is_good_to_half_a_microradian_everywhere():
    phase = np.linspace(0, np.pi, 4_000_001)[None]
    images = np.stack([np.cos(2 * phase), np.sin(2 * phase), -np.cos(2 * phase)]).astype(np.float32)
    orientation, _, _ = fit_second_harmonic(images, [0, np.pi / 4, np.pi / 2])
    cosine = (images[0].astype(np.float64) - images[2]) / 2
    sine = images[1].astype(np.float64) - (images[0].astype(np.float64) + images[2]) / 2
    error = np.abs(axial_difference(orientation, np.arctan2(sine, cosine) / 2))
    assert error.max() < 5e-7
    assert orientation.min() >= 0
    assert orientation.max() < np.pi


@pytest.mark.parametrize("angles", [EQUAL, UNEQUAL, EQUAL[:4]])
@pytest.mark.parametrize("dtype", [np.float32, np.uint16])
def test_random_photographs_match_polanalyser_and_a_loop_of_least_squares(angles, dtype):
    rng = np.random.default_rng(1)
    images = rng.random((len(angles), 30, 41))
    images = (images * 65535).astype(dtype) if dtype is np.uint16 else images.astype(dtype)
    orientation, correlation, mean = fit_second_harmonic(images, angles)
    stokes = polanalyser.calcStokes(images.astype(np.float64), angles)
    gain = harmonic_fit(angles).condition
    design = np.stack([np.ones(len(angles)), np.cos(2 * angles), np.sin(2 * angles)], axis=1)
    for row, column in np.ndindex(images.shape[1:]):
        data = images[:, row, column].astype(np.float64)
        (level, c, s), *_ = np.linalg.lstsq(design, data, rcond=None)
        amplitude = np.hypot(c, s) / np.ptp(data)
        assert abs(axial_difference(orientation[row, column], np.arctan2(s, c) / 2)) < 1e-6 / amplitude
        assert correlation[row, column] == pytest.approx(np.corrcoef(data, design @ [level, c, s])[0, 1], abs=2e-5)
        assert mean[row, column] == pytest.approx(level, abs=1e-6 * gain * data.max())
    strong = polanalyser.cvtStokesToDoLP(stokes) > 0.05
    difference = axial_difference(orientation, polanalyser.cvtStokesToAoLP(stokes))
    assert np.abs(difference[strong]).max() < 1e-5


def test_integers_and_floats_of_the_same_value_give_the_same():
    images = np.random.default_rng(2).integers(0, 65536, (7, 20, 33)).astype(np.uint16)
    integers = fit_second_harmonic(images, UNEQUAL[:7])
    floats = fit_second_harmonic(images.astype(np.float32), UNEQUAL[:7])
    for exact, converted in zip(integers, floats, strict=True):
        np.testing.assert_array_equal(exact, converted)


@settings(max_examples=25, deadline=None)
@given(st.floats(-7, 7))
def test_turning_the_polariser_scale_turns_the_map(turn):
    images, _, _ = cosines(UNEQUAL, shape=(5, 20))
    straight, correlation, mean = fit_second_harmonic(images, UNEQUAL)
    turned, same_correlation, same_mean = fit_second_harmonic(images, UNEQUAL + turn)
    assert np.abs(axial_difference(turned, straight + turn)).max() < 3e-5
    np.testing.assert_allclose(same_correlation, correlation, atol=1e-5)
    np.testing.assert_allclose(same_mean, mean, rtol=1e-5)


def test_a_weak_modulation_on_a_bright_level_keeps_its_phase():
    images, phase, _ = cosines(EQUAL)
    weak = (1 + 1e-3 * images).astype(np.float32)
    orientation, correlation, _ = fit_second_harmonic(weak, EQUAL)
    assert np.abs(axial_difference(orientation, phase)).max() < 1e-3
    assert correlation.min() > 0.999


def test_a_reference_is_subtracted_before_the_fit():
    rng = np.random.default_rng(3)
    images, reference = rng.random((12, 9, 14)), rng.random(12)
    with_reference = fit_second_harmonic(images, UNEQUAL, reference=reference)
    subtracted = fit_second_harmonic(images - reference[:, None, None], UNEQUAL)
    assert np.abs(axial_difference(with_reference[0], subtracted[0])).max() < 1e-4
    np.testing.assert_allclose(with_reference[1], subtracted[1], atol=1e-5)
    np.testing.assert_allclose(with_reference[2], fit_second_harmonic(images, UNEQUAL)[2], rtol=1e-5)


def test_what_has_no_phase_is_nan():
    images = np.ones((4, 1, 3), np.float32)
    images[:, 0, 1] = [0, 1, 2, 1]
    images[2, 0, 2] = np.nan
    orientation, correlation, mean = fit_second_harmonic(images, EQUAL[::3])
    assert np.isnan(orientation[0, [0, 2]]).all()
    assert np.isnan(correlation[0, [0, 2]]).all()
    assert np.isfinite(orientation[0, 1])
    assert mean[0, 0] == pytest.approx(1)


def test_rows_can_be_shared_out():
    images, _, _ = cosines(EQUAL, shape=(50, 2100))
    whole = fit_second_harmonic(images, EQUAL)
    maps = empty_maps(50, 2100)
    rows = fit_rows(images, harmonic_fit(EQUAL), None, maps)
    rows(17, 50)
    rows(0, 17)
    for part, full in zip(maps, whole, strict=True):
        np.testing.assert_array_equal(part, full)


def test_pixels_that_are_left_out_are_nan_and_masked():
    rng = np.random.default_rng(0)
    maps = tuple(rng.random((3, 30, 1100), np.float32))
    maps[0][rng.random(maps[0].shape) > 0.9] = np.nan
    before = [part.copy() for part in maps]
    valid = rng.random(maps[0].shape) > 0.2
    mask = np.empty_like(valid)
    rows = mask_rows(maps, valid, 0.25, mask)
    rows(11, 30)
    rows(0, 11)
    np.testing.assert_array_equal(mask, valid & np.isfinite(before[0]) & (before[2] >= 0.25))
    for part, was in zip(maps[:2], before[:2], strict=True):
        np.testing.assert_array_equal(part, np.where(mask, was, np.nan))
    np.testing.assert_array_equal(maps[2], before[2])


@pytest.mark.parametrize("dtype", [np.float32, np.uint16])
def test_sums_over_the_mask_are_those_of_numpy_whatever_lies_outside(dtype):
    rng = np.random.default_rng(0)
    images = (60000 * rng.random((5, 50, 70))).astype(dtype)
    mask = rng.random((50, 70)) > 0.4
    if dtype is np.float32:
        images[:, ~mask] = np.nan
    sums = np.zeros((3, 5))
    rows = sum_rows(images, mask, sums, 20)
    for start in (40, 0, 20):
        rows(start, min(start + 20, 50))
    np.testing.assert_allclose(sums.sum(axis=0), images.sum(axis=(1, 2), where=mask, dtype=np.float64), rtol=1e-14)


@pytest.mark.parametrize("angles", [[0, 1], [0, 1, 1 + np.pi], [0.5] * 12])
def test_two_distinct_angles_are_refused(angles):
    with pytest.raises(ValueError, match="three or more polariser angles distinct modulo 180 degrees"):
        harmonic_fit(angles)
