"""Tiles that repeat exactly, and what stands on them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.optics.surfaces import (
    CHANNEL_BIT_UM,
    blaze,
    bumps,
    cosine,
    grating_tile,
    pit_marks,
    pits,
    plane_coordinates,
)

DIRECTIONS = st.floats(-180, 180).filter(lambda d: min(abs(np.cos(np.deg2rad(d))), abs(np.sin(np.deg2rad(d)))) > 0.05)


def test_a_channel_bit_of_a_compact_disc_is_278_nm() -> None:
    """The shortest pit, of three, is 0.833 um long."""
    assert round(3 * CHANNEL_BIT_UM, 3) == 0.833


@settings(max_examples=40, deadline=None)
@given(degrees=DIRECTIONS, period_um=st.floats(0.5, 5))
def test_a_tile_in_any_direction_repeats_exactly(degrees: float, period_um: float) -> None:
    """A cosine that repeats has two lines in its discrete spectrum and nothing else, wherever it runs."""
    tile = grating_tile(period_um=period_um, orientation_rad=float(np.deg2rad(degrees)), size_um=15, pitch_um=0.1)
    spectrum = np.fft.fft2(cosine(tile.phase())) / np.prod(tile.shape)
    row, column = -tile.cycles_y % tile.shape[0], tile.cycles_x % tile.shape[1]  # rows go down, y goes up
    assert abs(spectrum[row, column]) == pytest.approx(0.25, abs=1e-12)
    spectrum[0, 0] = spectrum[row, column] = spectrum[-row % tile.shape[0], -column % tile.shape[1]] = 0
    assert np.abs(spectrum).max() < 1e-12
    x, y = tile.cycles_x / (tile.shape[1] * tile.pitch_um), tile.cycles_y / (tile.shape[0] * tile.pitch_um)
    assert 1 / np.hypot(x, y) == pytest.approx(period_um, rel=1e-12)
    assert np.rad2deg(abs(np.angle(np.exp(1j * (np.arctan2(y, x) - np.deg2rad(degrees)))))) < 0.25
    assert tile.pitch_um == pytest.approx(0.1, rel=0.05)


@pytest.mark.parametrize(("degrees", "step"), [(0, (0, 1)), (90, (-1, 0)), (180, (0, -1)), (270, (1, 0))])
def test_a_blaze_rises_in_its_direction(degrees: float, step: tuple[int, int]) -> None:
    """Right, up, left, down: by one sample in ten of the period, but for the fall."""
    tile = grating_tile(period_um=1.0, orientation_rad=np.deg2rad(degrees), size_um=3, pitch_um=0.1)
    assert tile.shape == (30, 30)
    height = blaze(tile.phase())
    rise = np.roll(height, (-step[0], -step[1]), (0, 1)) - height
    np.testing.assert_allclose(np.unique(np.round(rise, 12)), [-0.9, 0.1])
    assert np.mean(rise > 0) == pytest.approx(0.9)
    assert sorted(set(height.ravel().tolist())) == [k / 10 for k in range(10)]  # to the bit


def test_coordinates_turn_anticlockwise_with_y_up() -> None:
    along, across = plane_coordinates((3, 4), 0.5, np.pi / 2)
    np.testing.assert_allclose(along, np.repeat([[1.0], [0.5], [0.0]], 4, axis=1), atol=1e-15)
    np.testing.assert_allclose(across, np.repeat([[0.0, -0.5, -1.0, -1.5]], 3, axis=0), atol=1e-15)


def test_bumps_cover_their_share() -> None:
    u, v = np.arange(100) / 20, np.arange(60)[:, None] / 20
    standing = bumps(u, v, 0.25, 0.4)
    assert standing.mean() == 0.1
    np.testing.assert_array_equal(standing, np.roll(standing, (20, 40), (0, 1)))


@given(tracks=st.integers(1, 4), bits=st.integers(22, 300), seed=st.integers(0, 99))
@settings(max_examples=60, deadline=None)
def test_pits_and_lands_are_three_to_eleven_bits_long_all_the_way_round(tracks: int, bits: int, seed: int) -> None:
    marks = pit_marks(tracks, bits, np.random.default_rng(seed))
    assert marks.shape == (tracks, bits)
    for track in marks:
        edges = np.flatnonzero(track != np.roll(track, 1))
        assert len(edges) % 2 == 0
        runs = np.diff([*edges, edges[0] + bits])
        assert runs.min() >= 3
        assert runs.max() <= 11


def test_a_pit_lies_in_the_middle_of_its_track() -> None:
    marks = np.array([[True, False], [False, True]])
    u, v = (np.arange(20) + 0.5) / 10, np.array([[0.5], [1.5], [2.5]])  # two tracks of ten samples, three bits
    found = pits(u, v, marks, 0.4)
    first, second = np.zeros((2, 20), bool)
    first[3:7], second[13:17] = True, True
    np.testing.assert_array_equal(found, [first, second, first])
