"""Levelling and despiking: what a scan added goes, what the surface is stays."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.data.height_fields import HeightField
from pipeline.errors import InputError
from pipeline.optics.levelling import plane, row_medians, row_polynomials, taper
from pipeline.stages.align.despiked import despiked
from pipeline.stages.align.level import level
from pipeline.stages.simulate.blaze import blaze
from pipeline.stages.simulate.bumps import bumps
from pipeline.stages.simulate.cd_tracks import cd_tracks
from pipeline.stages.simulate.scanned import scanned


def measured(orientation_deg: float = 0.0, **faults: float) -> tuple[HeightField, HeightField]:
    """A blaze of ten periods, as it is and as it is scanned."""
    truth = blaze(orientation_deg=orientation_deg, size_um=25, pitch_um=0.1, periodic=False)
    return truth, scanned(truth, **faults)


def off_nm(found: HeightField, truth: HeightField) -> float:
    """Root mean square difference, whatever the zero of either."""
    difference = found.height_um.astype(float) - truth.height_um
    return 1000 * float(np.std(difference))


def test_a_plane_is_found_as_it_is_also_where_some_is_not_known() -> None:
    y, x = np.mgrid[:30, :40] * 1.0
    tilted = 0.3 + 0.01 * x - 0.02 * y
    tilted[10:14, 5:9] = np.nan
    np.testing.assert_allclose(plane(tilted)[np.isfinite(tilted)], tilted[np.isfinite(tilted)], atol=1e-12)


def test_a_grating_tilts_a_plane_less_than_an_even_fit_would() -> None:
    """Ten periods of a sawtooth tilt an even fit by a tenth of its depth from edge to edge."""
    height = blaze(size_um=25, pitch_um=0.1, periodic=False).height_um.astype(float)
    x = np.arange(height.shape[1])
    even = np.polynomial.Polynomial.fit(x, height[0], 1).linspace(2)[1]
    assert np.ptp(even) == pytest.approx(0.0246, rel=0.05)
    assert np.ptp(plane(height)) < 0.0246 / 20


def test_a_weighted_median_has_half_of_the_weight_below() -> None:
    rng = np.random.default_rng(0)
    height = rng.normal(size=(5, 81))
    height[2, 10:30] = np.nan
    height[4] = np.nan
    for row, middle in zip(height[:4], row_medians(height)[:4], strict=True):
        weight = np.where(np.isfinite(row), taper(81), 0)
        assert np.sum(weight[row < middle]) <= weight.sum() / 2 <= np.sum(weight[row <= middle])
    assert row_medians(height)[4] == 0


def test_polynomials_along_rows_are_found_as_they_are() -> None:
    x = np.linspace(-1, 1, 50)
    height = np.stack([0.1 + 0.2 * x, 0.3 * x**2, np.full(50, np.nan), -0.1 * x**3])
    height[1, 20:25] = np.nan
    found = row_polynomials(height, 3)
    np.testing.assert_allclose(found[[0, 3]], height[[0, 3]], atol=1e-12)
    np.testing.assert_allclose(found[1], 0.3 * x**2, atol=1e-12)
    assert not found[2].any()


@settings(max_examples=12, deadline=None)
@given(
    lines=st.sampled_from(["auto", "none", "median", "polynomial"]),
    degree=st.integers(0, 3),
    tilt_deg=st.floats(0, 3),
    line_offset_um=st.sampled_from([0.0, 0.01]),
    orientation_deg=st.floats(0, 180),
)
def test_levelling_twice_is_levelling_once(
    lines: str, degree: int, tilt_deg: float, line_offset_um: float, orientation_deg: float
) -> None:
    _, scan = measured(orientation_deg, tilt_deg=tilt_deg, line_offset_um=line_offset_um, noise_um=0.002)
    once = level(scan, lines=lines, degree=degree)
    twice = level(once, lines=lines, degree=degree)
    np.testing.assert_allclose(twice.height_um, once.height_um, atol=2e-6)


@pytest.mark.parametrize("orientation_deg", [0.0, 20.0, 70.0, 90.0])
@pytest.mark.parametrize("direction_deg", [0.0, 90.0, 200.0])
def test_a_tilt_is_taken_from_a_blaze(orientation_deg: float, direction_deg: float) -> None:
    """One degree lifts the far edge by 0.44 um, nearly twice the depth; 2 nm are left of it."""
    truth, scan = measured(orientation_deg, tilt_deg=1.0, tilt_direction_deg=direction_deg)
    assert off_nm(scan, truth) > 100
    assert off_nm(level(scan), truth) < 2


@pytest.mark.parametrize("orientation_deg", [0.0, 20.0, 45.0])
def test_every_fault_of_a_scan_is_taken_from_a_blaze(orientation_deg: float, caplog: pytest.LogCaptureFixture) -> None:
    """Left are noise of 1 nm, which nobody can take away, and 4 nm of what the lines' medians took of the blaze."""
    caplog.set_level(logging.INFO)
    faults = {"tilt_deg": 1.0, "line_offset_um": 0.02, "spikes": 200, "spike_um": 0.4, "noise_um": 0.001, "bits": 12}
    truth, scan = measured(orientation_deg, **faults)
    cleaned = level(despiked(scan))
    assert off_nm(cleaned, truth) < 5
    assert "the median of each is taken away" in caplog.text


def test_lines_are_left_alone_where_they_do_not_jump(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    for orientation_deg in (0, 30, 60, 90, 120):
        caplog.clear()
        level(measured(orientation_deg, tilt_deg=0.5, noise_um=0.002)[1])
        assert "only a plane is taken away" in caplog.text


def test_lines_that_jump_along_a_structure_are_left_with_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    truth, scan = measured(90.0, tilt_deg=0.5, line_offset_um=0.01)
    flat = level(scan)
    assert "which levelling them would take away" in caplog.text
    assert off_nm(flat, truth) == pytest.approx(10, rel=0.2)
    assert off_nm(level(scan, lines="median"), truth) > 50


def test_a_tile_that_repeats_only_loses_its_mean() -> None:
    tile = blaze(size_um=2.5)
    flat = level(tile)
    np.testing.assert_allclose(flat.height_um, tile.height_um - tile.height_um.mean(dtype=float), atol=1e-7)
    assert flat.periodic


def test_what_is_not_known_stays_so() -> None:
    _, scan = measured(tilt_deg=1.0, line_offset_um=0.01, spikes=9, spike_um=0.5)
    height = scan.height_um.copy()
    height[40:50, 60:80] = np.nan
    for lines in ("auto", "none", "median", "polynomial"):
        flat = level(despiked(replace(scan, height_um=height)), lines=lines)
        np.testing.assert_array_equal(np.isnan(flat.height_um), np.isnan(height))


def test_spikes_are_found_one_by_one_and_counted(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    truth = blaze(size_um=25, pitch_um=0.1, periodic=False)
    height = truth.height_um + np.random.default_rng(0).normal(0, 0.001, truth.height_um.shape).astype(np.float32)
    dirty = height.copy()
    dirty[50, 60] += 0.5  # one sample
    dirty[100:102, 30:32] -= 0.5  # four together, a hole
    clean = despiked(replace(truth, height_um=dirty))
    changed = np.argwhere(clean.height_um != dirty).tolist()
    assert changed == [[50, 60], [100, 30], [100, 31], [101, 30], [101, 31]]
    assert np.abs(clean.height_um - height)[100:102, 30:32].max() < 0.03  # a slope's step of 10 nm or so a sample
    assert "5 of 62500 samples" in caplog.text


@pytest.mark.parametrize("stage", [blaze, bumps, cd_tracks])
def test_edges_and_corners_are_no_spikes(stage: Callable[..., HeightField]) -> None:
    surface = stage(size_um=16)
    np.testing.assert_array_equal(despiked(surface).height_um, surface.height_um)


def test_impossible_settings_are_refused() -> None:
    surface = blaze(size_um=5)
    with pytest.raises(InputError, match=r"degree is 6\s+where: +degree\s+expected: 0 to 5"):
        level(surface, degree=6)
    with pytest.raises(InputError, match=r"radius_px is 0\s+where: +radius_px\s+expected: 1 to 10"):
        despiked(surface, radius_px=0)
