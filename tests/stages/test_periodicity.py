"""Periods of surfaces, found with their errors, or not found."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from pipeline.data.height_fields import HeightField, Periodicity
from pipeline.errors import InputError
from pipeline.stages.capture.published_height_map import published_height_map
from pipeline.stages.fit.periodicity import periodicity
from pipeline.stages.simulate.blaze import blaze
from pipeline.stages.simulate.bumps import bumps
from pipeline.stages.simulate.cd_tracks import cd_tracks
from pipeline.stages.simulate.cosine_grating import cosine_grating
from pipeline.stages.simulate.scanned import scanned


def turn_deg(found_rad: float, true_deg: float) -> float:
    """Difference of two directions that are the same half a turn further."""
    return (np.rad2deg(found_rad) - true_deg + 90) % 180 - 90


@settings(max_examples=25, deadline=None)
@given(
    stage=st.sampled_from([blaze, cosine_grating]),
    period_um=st.floats(0.8, 3.0),
    orientation_deg=st.floats(-180, 180),
    tilt_deg=st.floats(0, 2),
)
def test_any_period_in_any_direction_is_found(stage, period_um: float, orientation_deg: float, tilt_deg: float) -> None:
    """Points on a sawtooth fold its high multiples back, the 20th with a 20th of the height right beside the first."""
    made = stage(period_um=period_um, orientation_deg=orientation_deg, size_um=24, pitch_um=0.1, periodic=False)
    found = periodicity(scanned(made, tilt_deg=tilt_deg, noise_um=0.01), count=1)
    assert found.period_um.tolist() == pytest.approx([period_um], rel=6e-3 if stage is blaze else 3e-4)
    assert abs(turn_deg(found.direction_rad[0], orientation_deg)) < (0.4 if stage is blaze else 0.05)
    assert found.metrics["period_1_um"] == found.period_um[0]


def test_the_height_of_what_repeats_is_found() -> None:
    """A cosine of full height H has the root mean square H / sqrt 8."""
    made = cosine_grating(period_um=2.1, depth_um=0.3, orientation_deg=25, size_um=24, pitch_um=0.1, periodic=False)
    assert periodicity(made).rms_um[0] == pytest.approx(0.3 / np.sqrt(8), rel=1e-4)


def test_the_error_of_a_wave_in_noise_is_what_estimates_scatter_by() -> None:
    made = cosine_grating(period_um=2.0, depth_um=0.1, orientation_deg=30, size_um=16, pitch_um=0.1, periodic=False)
    all_found = [periodicity(scanned(made, noise_um=0.1, seed=seed)) for seed in range(60)]
    for off, stated in (
        ([f.period_um[0] - 2 for f in all_found], [f.period_error_um[0] for f in all_found]),
        (
            [turn_deg(f.direction_rad[0], 30) for f in all_found],
            [np.rad2deg(f.direction_error_rad[0]) for f in all_found],
        ),
    ):
        ratio = np.sqrt(np.mean(np.square(off))) / np.mean(stated)
        assert 0.73 < ratio < 1.27  # three standard errors of the scatter of 60
        assert np.std(stated) < 0.2 * np.mean(stated)


def wandering(seed: int, period_um: float = 1.5, side: int = 300, pitch_um: float = 0.1) -> HeightField:
    """A grating along x whose phase is a random field, smooth over 2 um: its period varies from place to place."""
    rng = np.random.default_rng(seed)
    phase = ndimage.gaussian_filter(rng.normal(size=(side, side)), 20, mode="wrap")
    x = np.arange(side) * pitch_um
    return HeightField(0.05 * np.cos(2 * np.pi * x / period_um + phase / phase.std()), pitch_um)


def test_a_period_that_varies_has_a_spread_and_an_honest_error() -> None:
    all_found = [periodicity(wandering(seed), count=1) for seed in range(30)]
    off = np.array([f.period_um[0] - 1.5 for f in all_found])
    stated = np.array([f.period_error_um[0] for f in all_found])
    assert min(f.spread[0] for f in all_found) > 0.01
    assert abs(off.mean()) < 3 * off.std() / np.sqrt(len(off))
    assert 0.6 < np.sqrt(np.mean(off**2)) / stated.mean() < 1.5


def test_both_periods_of_a_lattice_are_found() -> None:
    exact = periodicity(bumps(size_um=20, pitch_um=0.05))
    assert exact.period_um.tolist() == pytest.approx([2.5, 2.0], rel=1e-9)
    assert np.rad2deg(exact.direction_rad).tolist() == pytest.approx([0, 90], abs=1e-6)
    assert exact.period_error_um.tolist() == [0, 0]
    turned = periodicity(bumps(size_um=20, pitch_um=0.05, orientation_deg=20, periodic=False))
    assert turned.period_um.tolist() == pytest.approx([2.5, 2.0], rel=1e-4)
    assert np.rad2deg(turned.direction_rad).tolist() == pytest.approx([20, 110], abs=0.01)


@pytest.mark.parametrize("written", [True, False])
def test_tracks_of_a_disc_are_1600_nm_apart(written: bool) -> None:
    found = periodicity(cd_tracks(written=written, size_um=32, pitch_um=0.05), count=1)
    assert found.period_um[0] == pytest.approx(1.6, rel=1e-9)
    assert turn_deg(found.direction_rad[0], 0) == pytest.approx(0, abs=1e-6)


def filtered(gain, seed: int, side: int = 300) -> HeightField:
    """A random surface with an isotropic spectrum."""
    white = np.random.default_rng(seed).normal(size=(side, side))
    frequency = np.hypot(np.fft.fftfreq(side)[:, None], np.fft.fftfreq(side))
    frequency[0, 0] = 1 / side
    return HeightField(np.fft.ifft2(np.fft.fft2(white) * gain(frequency)).real, 0.1)


@pytest.mark.parametrize(
    "gain",
    [
        np.ones_like,
        lambda f: f**-1.5,
        lambda f: np.exp(-((f / 0.05) ** 2)),
        lambda f: np.exp(-(((f - 0.1) / 0.01) ** 2)),
    ],
    ids=["white", "fractal", "smooth", "ring"],
)
def test_what_has_no_period_in_a_direction_is_said_to_have_none(gain, caplog: pytest.LogCaptureFixture) -> None:
    for seed in range(8):
        caplog.clear()
        found = periodicity(filtered(gain, seed))
        assert found.metrics == {"periods": 0}
        assert found.period_um.shape == (0,)
        assert "No period stands out in any direction" in caplog.text


def test_lines_that_jump_are_no_period() -> None:
    flat = HeightField(np.zeros((300, 300)), 0.1)
    for seed in range(8):
        assert not periodicity(scanned(flat, line_offset_um=0.1, noise_um=0.02, seed=seed)).period_um.size


def test_what_is_not_known_takes_no_part() -> None:
    made = cosine_grating(period_um=1.7, orientation_deg=70, size_um=24, pitch_um=0.1, periodic=False)
    height = made.height_um.copy()
    height[100:130, 40:90] = np.nan
    found = periodicity(HeightField(height, made.pitch_um))
    assert found.period_um.tolist() == pytest.approx([1.7], rel=2e-3)


def test_the_spectrum_is_kept_around_zero_with_y_up() -> None:
    found = periodicity(cosine_grating(period_um=2.0, orientation_deg=60, size_um=24, pitch_um=0.1, periodic=False))
    power, (step_x, step_y) = found.power_um2, found.step_per_um
    assert all(side % 2 for side in power.shape)
    row, column = np.unravel_index(power.argmax(), power.shape)
    x, y = (column - power.shape[1] // 2) * step_x, -(row - power.shape[0] // 2) * step_y
    if y < 0:
        x, y = -x, -y
    assert np.hypot(x, y) == pytest.approx(0.5, abs=step_x)
    assert np.rad2deg(np.arctan2(y, x)) == pytest.approx(60, abs=5)
    assert 2 * power.astype(float).sum() == pytest.approx(2 * 0.246**2 / 8, rel=0.05)


def real(measurements, monkeypatch: pytest.MonkeyPatch, name: str) -> Periodicity:
    monkeypatch.setenv("OPTIBENCH_DATA", str(measurements / "afm"))
    return periodicity(published_height_map(name=name))


def test_the_periods_of_xenopeltis(measurements, monkeypatch: pytest.MonkeyPatch) -> None:
    """From its spectrum by hand: 0.55 um from finger to finger along x, and 1.50 um from row to row along y."""
    found = real(measurements, monkeypatch, "xenopeltis")
    assert found.period_um.tolist() == pytest.approx([0.55, 1.50], rel=0.01)
    assert abs(turn_deg(found.direction_rad[0], 0)) < 6
    assert abs(turn_deg(found.direction_rad[1], 90)) < 2


def test_the_period_of_elaphe(measurements, monkeypatch: pytest.MonkeyPatch) -> None:
    """From its spectrum by hand, at the highest point of a skew peak: 1.02 um across the fingers, which run along y."""
    found = real(measurements, monkeypatch, "elaphe")
    assert found.period_um.tolist() == pytest.approx([1.02], rel=0.05)
    assert abs(found.period_um[0] - 1.02) < 3 * found.period_error_um[0]
    assert abs(turn_deg(found.direction_rad[0], 0)) < 1


@pytest.mark.parametrize(("name", "period_um"), [("elaphe_crop", 1.144), ("blaze_tile", 2.5), ("cosine_tile", 2.5)])
def test_the_periods_of_the_patches(measurements, monkeypatch: pytest.MonkeyPatch, name: str, period_um: float) -> None:
    """Single 2014, chapter 3: 1144.262 nm (Elaphe, by FLSS) and 2499.997 nm (blaze)."""
    found = real(measurements, monkeypatch, name)
    assert found.period_um[0] == pytest.approx(period_um, rel=0.02)


def test_too_small_a_map_and_impossible_settings_are_refused() -> None:
    with pytest.raises(InputError, match=r"a map of 20 x 10 samples\s+expected: at least 16 a side"):
        periodicity(HeightField(np.zeros((10, 20)), 0.1))
    with pytest.raises(InputError, match=r"count is 7\s+where: +count\s+expected: 1 to 6"):
        periodicity(blaze(), count=7)
    with pytest.raises(InputError, match=r"contrast is 2\s+where: +contrast\s+expected: at least 3, below which noise"):
        periodicity(blaze(), contrast=2)
