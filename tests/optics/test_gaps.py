"""Gaps filled by a membrane: harmonic surfaces come back, known heights stay, tiles join across their border."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.data.height_fields import HeightField
from pipeline.optics.gaps import membrane
from pipeline.stages.align.filled import filled

ROW, COLUMN = np.mgrid[:30, :40].astype(float)


@pytest.mark.parametrize("harmonic", [0.3 + 0.01 * COLUMN - 0.02 * ROW, ROW * COLUMN, ROW**2 - COLUMN**2])
def test_a_harmonic_surface_comes_back(harmonic: np.ndarray) -> None:
    """The mean of four neighbours is exact for planes and for saddles."""
    holed = harmonic.copy()
    holed[10:20, 5:30] = np.nan
    holed[3, 35] = np.nan
    np.testing.assert_allclose(membrane(holed), harmonic, atol=1e-9)


def test_no_filled_height_is_beyond_the_rim_and_known_ones_stay() -> None:
    height = np.random.default_rng(0).normal(size=(30, 40))
    holed = height.copy()
    holed[:8, 20:] = np.nan  # reaches the border
    found = membrane(holed)
    known = np.isfinite(holed)
    np.testing.assert_array_equal(found[known], height[known])
    assert height[known].min() < found[~known].min() <= found[~known].max() < height[known].max()


def test_a_tile_that_repeats_joins_across_its_border() -> None:
    ramp = np.tile(np.abs(np.arange(-10.0, 10)), (20, 1))  # highest at the left border, next to it at the right
    ramp[:, 0] = np.nan
    assert membrane(ramp, periodic=True)[5, 0] == pytest.approx(9)
    assert membrane(-ramp, periodic=False)[5, 0] == pytest.approx(-9)
    step = np.tile(np.arange(20.0), (20, 1))
    step[:, 0] = np.nan
    assert membrane(step, periodic=True)[5, 0] == pytest.approx(10)  # between 1 and 19
    assert membrane(step, periodic=False)[5, 0] == pytest.approx(1)


def test_the_stage_says_how_much_it_filled(caplog: pytest.LogCaptureFixture) -> None:
    height = np.ones((10, 10), np.float32)
    height[2, 3:5] = np.nan
    found = filled(HeightField(height, 0.1))
    np.testing.assert_allclose(found.height_um, 1, atol=1e-6)
    assert found.height_um.dtype == np.float32
    assert "2 of 100 samples (2 percent) were not known and are filled" in caplog.text
