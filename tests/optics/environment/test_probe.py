"""Which way a light probe faces, and what it shows between its texels."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics.environment.area_map import area_map
from pipeline.optics.environment.probe import Probe, pose, solid_angles, texel_directions
from pipeline.optics.environment.procedural import SCENES, drawn
from pipeline.optics.environment.spectrum import colour_matrices

UPRIGHT = pose(0.0, 0.0)
ROWS = 32


def spot(row: int, column: int) -> np.ndarray:
    rgb = np.zeros((ROWS, 2 * ROWS, 3), np.float32)
    rgb[row, column] = 1
    return rgb


@pytest.mark.parametrize(
    ("part", "towards"),
    [
        ((0.5, 0.5), [0, 0, 1]),  # the middle is behind the viewer
        ((0.5, 0.75), [-1, 0, 0]),  # seen from the sheet, his left hand is to the right
        ((0.5, 0.25), [1, 0, 0]),
        ((0.0, 0.5), [0, 1, 0]),
        ((1.0, 0.5), [0, -1, 0]),
        ((0.5, 0.0), [0, 0, -1]),
    ],
)
def test_directions_of_a_probe(part: tuple[float, float], towards: list[float]) -> None:
    row, column = min(int(part[0] * ROWS), ROWS - 1), int(part[1] * 2 * ROWS)
    nearest = np.linalg.norm(texel_directions(ROWS, 2 * ROWS) - towards, axis=-1)
    assert nearest[row, column] < 1.5 * np.pi / ROWS
    assert Probe(spot(row, column), UPRIGHT).radiance(texel_directions(ROWS, 2 * ROWS)[row, column]).max() == (
        pytest.approx(1, abs=1e-6)
    )


def test_a_probe_turns_anticlockwise_from_above_and_a_sheet_leans_back() -> None:
    forward = np.array([0.0, 0.0, 1.0])
    assert pose(np.pi / 2, 0.0) @ [1, 0, 0] == pytest.approx(forward)  # what was behind the viewer is at +x now
    assert pose(0.0, np.pi / 2) @ forward == pytest.approx([0, 1, 0])  # a sheet on a table looks up
    assert pose(0.0, np.pi / 2) @ [0, 1, 0] == pytest.approx(-forward)  # and its upper edge is far from the viewer


@given(st.floats(-7, 7), st.floats(0, np.pi / 2))
def test_poses_are_rotations(rotation: float, tilt: float) -> None:
    turned = pose(rotation, tilt)
    assert turned @ turned.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(turned) == pytest.approx(1)


def test_solid_angles_fill_the_sphere() -> None:
    assert 64 * solid_angles(32, 64).sum() == pytest.approx(4 * np.pi)
    level = np.cos(np.pi * (0.5 - 15.5 / 32))
    assert solid_angles(32, 64)[15] == pytest.approx((np.pi / 32) ** 2 * level, rel=1e-3)


def test_between_texels_a_probe_is_bilinear_around_the_seam_and_at_the_poles() -> None:
    rgb = np.random.default_rng(1).uniform(0, 1, (ROWS, 2 * ROWS, 3)).astype(np.float32)
    seen = texel_directions(2 * ROWS, 4 * ROWS)
    found = Probe(rgb, UPRIGHT).radiance(seen)
    around = np.concatenate([rgb[:, -1:], rgb, rgb[:, :1]], axis=1)
    padded = np.concatenate([around[:1], around, around[-1:]])
    expected = np.empty_like(found)
    for r in range(2 * ROWS):
        for c in range(4 * ROWS):
            y, x = (r + 0.5) / 2 + 0.5, (c + 0.5) / 2 + 0.5
            i, j = int(y), int(x)
            di, dj = y - i, x - j
            expected[r, c] = (1 - di) * ((1 - dj) * padded[i, j] + dj * padded[i, j + 1]) + di * (
                (1 - dj) * padded[i + 1, j] + dj * padded[i + 1, j + 1]
            )
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_light_is_kept_by_the_equal_area_map_and_its_coarse_levels() -> None:
    rgb = drawn(SCENES["room"](2.0), 64)
    probe = Probe(rgb, pose(0.4, 0.5))
    levels = area_map(probe, all_around=True).levels
    whole = (rgb * solid_angles(64, 128)[:, None, None]).sum(axis=(0, 1))
    places = ((np.arange(len(levels[0])) + 0.5) / len(levels[0]) * 2 - 1) * np.sqrt(2)
    within = places[:, None] ** 2 + places**2 < 2
    solid_angle = 2 * (2 * np.sqrt(2) / len(levels[0])) ** 2
    assert (levels[0][within] * solid_angle).sum(axis=0)[:3] == pytest.approx(whole, rel=0.01)
    for fine, coarse in pairwise(levels):
        assert coarse.mean(axis=(0, 1), dtype=np.float64) == pytest.approx(fine.mean(axis=(0, 1), dtype=np.float64))


@pytest.mark.parametrize("step_nm", [1.0, 5.0, 20.0, 33.0, 100.0])
def test_all_wavelengths_of_a_colour_are_that_colour(step_nm: float) -> None:
    wavelength, matrices = colour_matrices(step_nm)
    assert (wavelength[0], wavelength[-1]) == (380, 780)
    assert np.diff(wavelength).max() <= step_nm + 1e-9
    assert matrices.sum(axis=0) == pytest.approx(np.eye(3), abs=1e-12)


def test_white_of_one_wavelength_is_the_eyes_response_to_daylight() -> None:
    """Of a white probe the basis adds up to 1, so that what is left is D65 seen by the eye."""
    from pipeline.optics.colour import white_balanced_weights

    wavelength, matrices = colour_matrices(1.0)
    weights = white_balanced_weights("D65", 1.0)[1]
    assert matrices[1:-1].sum(axis=2) == pytest.approx(weights[1:-1], abs=2e-5)
    assert len(wavelength) == 401


def test_a_sun_gives_its_irradiance() -> None:
    """Radiance times the solid angle of a disc, 0.6 in red; the sky behind it adds a few percent."""
    solid_angle = 2 * np.pi * (1 - np.cos(np.deg2rad(4)))
    sun = drawn(SCENES["outdoors"](8.0), 128)[..., 0].max()
    assert sun * solid_angle == pytest.approx(0.6, rel=0.06)


def test_lamps_give_the_same_light_however_wide_they_are() -> None:
    angles = solid_angles(128, 256)[:, None, None]
    wide, narrow = ((drawn(SCENES["outdoors"](deg), 128) * angles).sum(axis=(0, 1)) for deg in (12.0, 6.0))
    assert narrow == pytest.approx(wide, rel=0.01)
