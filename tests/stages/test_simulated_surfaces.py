"""Surfaces as stages make them, and what scanning does to them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from pipeline.data.height_fields import HeightField
from pipeline.errors import InputError, InputErrors
from pipeline.stages.simulate.blaze import blaze
from pipeline.stages.simulate.bumps import bumps
from pipeline.stages.simulate.cd_tracks import cd_tracks
from pipeline.stages.simulate.cosine_grating import cosine_grating
from pipeline.stages.simulate.scanned import scanned


def published(path: Path) -> np.ndarray:
    source = oiio.ImageInput.open(str(path))
    grey = source.read_image(0, 0, 0, 1, "uint8")[..., 0]
    source.close()
    return grey.astype(float)


def test_the_cosine_is_the_published_one(measurements: Path) -> None:
    """Single's tile runs along y and has its trough at the top; his grey levels are rounded."""
    height = cosine_grating(period_um=2.5, depth_um=0.246, orientation_deg=90, size_um=2.5, pitch_um=0.025).height_um
    expected = published(measurements / "afm" / "CosineBump.bmp")
    assert np.abs(np.roll(height, 51, axis=0) * 255 / 0.246 - expected).max() <= 0.51


def test_the_blaze_is_the_published_one(measurements: Path) -> None:
    """Single's tile takes 98 samples for its rise of 255 levels, and the last for the fall; ours rises 255 in 100."""
    height = blaze(period_um=2.5, depth_um=0.246, size_um=2.5, pitch_um=0.025).height_um
    expected = published(measurements / "afm" / "BlazingBump.bmp")[:, :99]
    assert np.abs(height[:, :99] * 255 / 0.246 * 100 / 98 - expected).max() <= 0.51


@pytest.mark.parametrize("stage", [blaze, cosine_grating])
def test_a_grating_states_the_direction_that_its_tile_has(stage) -> None:
    made = stage(period_um=1.7, orientation_deg=33.0, size_um=12, pitch_um=0.1)
    stated = float(made.caption.rpartition(" ")[2].removesuffix("°"))
    spectrum = np.abs(np.fft.rfft2(made.height_um - made.height_um.mean()))
    row, column = np.unravel_index(spectrum.argmax(), spectrum.shape)
    rows, columns = made.height_um.shape
    fy, fx = -np.fft.fftfreq(rows)[row], np.fft.rfftfreq(columns)[column]
    assert np.rad2deg(np.arctan2(fy, fx)) == pytest.approx(stated, abs=1e-3)
    assert made.pitch_um / np.hypot(fx, fy) == pytest.approx(1.7, rel=1e-9)
    assert made.periodic


def test_a_grating_that_need_not_repeat_is_as_asked_for() -> None:
    made = cosine_grating(period_um=2.0, depth_um=0.3, orientation_deg=2.0, size_um=6, pitch_um=0.05, periodic=False)
    assert (made.height_um.shape, made.pitch_um, made.periodic) == ((120, 120), 0.05, False)
    x, y = np.meshgrid(np.arange(120) * 0.05, np.arange(120)[::-1] * 0.05)
    along = x * np.cos(np.deg2rad(2)) + y * np.sin(np.deg2rad(2))
    np.testing.assert_allclose(made.height_um, 0.15 * (1 + np.cos(np.pi * along)), atol=1e-6)


def test_bumps_are_as_large_and_as_many_as_asked_for() -> None:
    made = bumps(period_um=2.5, period_across_um=2.0, width_um=0.5, length_um=1.0, size_um=10, pitch_um=0.05)
    assert made.height_um.shape == (200, 200)
    assert np.unique(made.height_um).tolist() == [0.0, pytest.approx(0.15)]
    assert np.count_nonzero(made.height_um) == 4 * 5 * 10 * 20
    turned = bumps(orientation_deg=90, size_um=10, pitch_um=0.05)
    np.testing.assert_array_equal(turned.height_um, np.rot90(made.height_um))


def test_tracks_repeat_every_1600_nm_across_and_their_tile_along_too() -> None:
    made = cd_tracks(size_um=16, pitch_um=0.05)
    columns = made.height_um.shape[1]
    assert columns * made.pitch_um == pytest.approx(16, rel=1e-12)
    assert np.unique(made.height_um).tolist() == [0.0, pytest.approx(0.12)]
    pit = made.height_um == 0
    assert pit.any(axis=0).reshape(10, -1).sum(axis=1).tolist() == [10] * 10  # 0.5 um of each track
    wrapped = np.vstack([pit, pit])[:, 16]  # the middle of a track, over the seam
    runs = np.diff(np.flatnonzero(np.diff(wrapped.astype(int)))) * made.pitch_um
    assert runs.min() > 0.833 - 2 * made.pitch_um
    assert runs.max() < 3.055 + 2 * made.pitch_um
    grooves = cd_tracks(written=False, size_um=16, pitch_um=0.05).height_um
    assert (grooves == grooves[0]).all()


@pytest.mark.parametrize(
    ("stage", "settings", "message"),
    [
        (blaze, {"pitch_um": 1.0}, r"pitch_um is 1\s+where: +pitch_um\s+expected: at most 0.625, 4 samples"),
        (blaze, {"size_um": 2.0}, r"size_um is 2\s+where: +size_um\s+expected: at least the period, 2.5"),
        (blaze, {"pitch_um": 0.001}, r"20000 samples a side\s+where: +pitch_um, size_um\s+expected: at most 4096"),
        (blaze, {"orientation_deg": 1.0}, r"orientation_deg is 1: a tile would repeat after 143.2 um only"),
        (bumps, {"orientation_deg": 20.0}, r"orientation_deg is 20\s+where: +orientation_deg\s+expected: a multiple"),
        (bumps, {"width_um": 3.0}, r"width_um is 3\s+where: +width_um\s+expected: above 0, at most 2.5"),
        (bumps, {"period_across_um": 30.0}, r"size_um is 20\s+where: +size_um\s+expected: at least period_across_um"),
        (cd_tracks, {"size_um": 3.0}, r"size_um is 3\s+where: +size_um\s+expected: at least 6.11, a longest pit"),
    ],
)
def test_what_cannot_be_made_is_refused(stage, settings: dict[str, float], message: str) -> None:
    with pytest.raises((InputError, InputErrors), match=message):
        stage(**settings)


def flat(side: int = 64) -> HeightField:
    return HeightField(np.zeros((side, side), np.float32), 0.1, periodic=True, caption="Flat")


def test_a_scan_without_faults_changes_nothing() -> None:
    surface = blaze(size_um=5)
    assert scanned(surface) is surface
    assert scanned(surface, noise_um=0.01).caption == surface.caption + ", scanned"


def test_a_tilt_rises_in_its_direction_and_the_tile_repeats_no_more() -> None:
    height = scanned(flat(), tilt_deg=3.0, tilt_direction_deg=90.0).height_um
    np.testing.assert_allclose(np.diff(height, axis=0), -0.1 * np.tan(np.deg2rad(3)), atol=1e-6)  # up is rising
    np.testing.assert_allclose(np.diff(height, axis=1), 0, atol=1e-6)
    assert not scanned(flat(), tilt_deg=3.0).periodic


def test_each_fault_has_the_size_that_was_asked_for() -> None:
    surface = flat(256)
    lines = scanned(surface, line_offset_um=0.02).height_um
    assert np.ptp(lines, axis=1).max() == 0
    assert lines[:, 0].std() == pytest.approx(0.02, rel=0.2)  # four standard errors of 256
    spikes = scanned(surface, spikes=17, spike_um=0.5).height_um
    assert sorted(np.unique(spikes, return_counts=True)[1].tolist()) == [17, 256**2 - 17]
    noise = scanned(surface, noise_um=0.01, seed=3)
    assert noise.height_um.std() == pytest.approx(0.01, rel=0.02)
    np.testing.assert_array_equal(noise.height_um, scanned(surface, noise_um=0.01, seed=3).height_um)
    assert not np.array_equal(noise.height_um, scanned(surface, noise_um=0.01, seed=4).height_um)
    levels = np.unique(scanned(surface, noise_um=0.01, bits=4).height_um)
    np.testing.assert_allclose(np.diff(levels), np.ptp(levels) / 15, rtol=1e-4)


def test_what_is_not_known_stays_unknown() -> None:
    surface = flat(16)
    height = surface.height_um.copy()
    height[3, 4] = np.nan
    scan = scanned(HeightField(height, 0.1), tilt_deg=1, noise_um=0.01, bits=8).height_um
    assert np.flatnonzero(np.isnan(scan)).tolist() == [3 * 16 + 4]
