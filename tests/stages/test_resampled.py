"""Height maps at another pitch."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.data.height_fields import HeightField
from pipeline.errors import InputError
from pipeline.stages.extract.resampled import resampled
from pipeline.stages.simulate.cosine_grating import cosine_grating


def wave(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.sin(2 * np.pi * x / 2.0 + 0.3) * np.cos(2 * np.pi * y / 3.0)


def sampled(pitch_um: float, side: int) -> HeightField:
    x = np.arange(side) * pitch_um
    return HeightField(wave(x, x[:, None]), pitch_um)


@pytest.mark.parametrize("pitch_um", [0.03, 0.05, 0.0371])
def test_a_smooth_map_comes_back_at_a_finer_pitch(pitch_um: float) -> None:
    found = resampled(sampled(0.1, 61), pitch_um=pitch_um)
    x = np.arange(found.height_um.shape[1]) * pitch_um
    assert 6.0 - pitch_um < x[-1] <= 6.0 + 1e-9
    np.testing.assert_allclose(found.height_um, wave(x, x[:, None]), atol=3e-4)
    assert found.pitch_um == pitch_um


def test_the_same_pitch_changes_nothing() -> None:
    np.testing.assert_allclose(resampled(sampled(0.1, 40), pitch_um=0.1).height_um, sampled(0.1, 40).height_um)


def test_what_a_coarser_pitch_cannot_hold_is_taken_away() -> None:
    """A cosine of 5 old samples would fold onto one of 5 new ones: 5 percent of it are left, and 99 of a long one."""
    x = np.arange(400.0)
    short, long = np.cos(2 * np.pi * x / 5), np.cos(2 * np.pi * x / 100)
    height = np.broadcast_to(short + long, (60, 400))
    found = resampled(HeightField(height, 1.0), pitch_um=4.0).height_um
    left = {period: np.exp(-2 * np.pi**2 * (4**2 - 1) / 4 / period**2) for period in (5, 100)}
    assert (left[5], left[100]) == (pytest.approx(0.052, abs=1e-3), pytest.approx(0.993, abs=1e-3))
    expected = left[100] * long[::4] + left[5] * short[::4]
    np.testing.assert_allclose(found[4:-4, 4:-4], np.broadcast_to(expected[4:-4], (7, 92)), atol=2e-4)


def test_a_tile_keeps_its_series_and_goes_on_repeating() -> None:
    tile = cosine_grating(period_um=2.0, orientation_deg=30, size_um=12, pitch_um=0.1)
    finer = resampled(tile, pitch_um=0.04)
    assert finer.periodic
    assert [n * finer.pitch_um for n in finer.height_um.shape] == pytest.approx(
        [n * tile.pitch_um for n in tile.height_um.shape]
    )
    for height in (tile.height_um, finer.height_um):
        spectrum = np.abs(np.fft.fft2(height)) / height.size
        assert np.sort(spectrum.ravel())[-3:] == pytest.approx([0.0615, 0.0615, 0.123], rel=1e-5)
        assert np.sort(spectrum.ravel())[-4] < 1e-7


def test_what_is_not_known_stays_so() -> None:
    field = sampled(0.1, 40)
    height = field.height_um.copy()
    height[10:20, 10:20] = np.nan
    for pitch_um in (0.05, 0.25):
        found = resampled(HeightField(height, 0.1), pitch_um=pitch_um).height_um
        assert np.mean(np.isnan(found)) == pytest.approx(100 / 1600, rel=0.25)
        middle = round(1.45 / pitch_um)
        assert np.isnan(found[middle, middle])


def test_a_pitch_that_leaves_nothing_is_refused() -> None:
    with pytest.raises(InputError, match=r"pitch_um is 2\s+where: +pitch_um\s+expected: .* to 1, for 4 samples"):
        resampled(sampled(0.1, 40), pitch_um=2.0)
