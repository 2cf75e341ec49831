"""What a pixel shows: homographies, tiles, bumps, left and right."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.optics.rasterise import Camera
from pipeline.optics.sheet.maps import Bumps, Tiled, sample_rows, slope_rows, slopes_of
from pipeline.optics.sheet.view import View, fitting_field_of_view, photographed, rectified

ROWS, COLUMNS = 60, 80


def camera(eye=(80.0, -120.0, 200.0), target=(5.0, 3.0, 0.0), up=(0.1, 1.0, 0.0), degrees: float = 30.0) -> Camera:
    return Camera(np.array(eye), np.array(target), np.array(up), np.deg2rad(degrees))


def seen(maps: Tiled, view: View) -> np.ndarray:
    out = np.zeros((len(maps.planes), view.rows, view.columns), np.float32)
    sample_rows(maps, view, out, (0, view.rows))
    return out


@settings(max_examples=40, deadline=None)
@given(st.floats(-150, 150), st.floats(-150, 150), st.floats(40, 400), st.floats(5, 70))
def test_a_pixel_shows_the_point_that_the_camera_projects_into_it(x, y, z, degrees) -> None:
    eye = camera((x, y, z), degrees=degrees)
    column, row = np.meshgrid(np.arange(0, COLUMNS, 9.0), np.arange(0, ROWS, 7.0))
    place = photographed(eye, ROWS, COLUMNS).points(column, row)
    known = np.isfinite(place[..., 0])
    on_sheet = np.concatenate([place, np.zeros_like(place[..., :1])], axis=-1)[known]
    back = eye.seen(on_sheet, ROWS, COLUMNS)
    assert known.sum() > 10
    assert (back[:, 2] > 0).all()
    np.testing.assert_allclose(back[:, :2], np.stack([column, row], axis=-1)[known] + 0.5, atol=1e-6)


def test_points_and_pixels_are_each_others_inverse() -> None:
    view = photographed(camera(), ROWS, COLUMNS)
    place = view.points(np.array([3.0, 70.0]), np.array([50.0, 2.0]))
    np.testing.assert_allclose(view.pixels(place[:, 0], place[:, 1]), [[3, 50], [70, 2]], atol=1e-9)
    moved = view.moved(0.25, -0.5)
    np.testing.assert_allclose(moved.points(np.array(3.0), np.array(50.0)), view.points(np.array(3.25), np.array(49.5)))
    few = view.thinned(7)
    assert (few.rows, few.columns) == (9, 12)
    np.testing.assert_allclose(few.points(np.array(10.0), np.array(7.0)), view.points(np.array(70.0), np.array(49.0)))


def test_above_the_horizon_there_is_nothing() -> None:
    view = photographed(camera((0.0, -100.0, 10.0), (0.0, 0.0, 10.0), (0.0, 0.0, 1.0), 60.0), ROWS, COLUMNS)
    place = view.points(np.array(40.0), np.array([5.0, 55.0]))
    assert np.isnan(place[0]).all()
    assert np.isfinite(place[1]).all()
    assert np.isnan(seen(Tiled(np.ones((1, 9, 9), np.float32), 1.0), view)[0, :10]).all()


def test_a_camera_behind_the_sheet_is_refused() -> None:
    with pytest.raises(ValueError, match="does not see the front"):
        photographed(camera((0.0, 0.0, -5.0)), ROWS, COLUMNS)


@pytest.mark.parametrize("rows", [ROWS, 200])
def test_the_fitting_field_of_view_just_holds_the_sheet(rows: int) -> None:
    angle = fitting_field_of_view(camera(), 60.0, 90.0, rows, COLUMNS, margin=1.0)
    view = photographed(camera(degrees=np.rad2deg(angle)), rows, COLUMNS)
    x, y = np.array([-30.0, 30.0, -30.0, 30.0]), np.array([-45.0, -45.0, 45.0, 45.0])
    column, row = (view.pixels(x, y) + 0.5).T
    out = max(np.abs(column / COLUMNS - 0.5).max(), np.abs(row / rows - 0.5).max())
    assert out == pytest.approx(0.5, abs=1e-6)
    with pytest.raises(ValueError, match="not in front"):
        fitting_field_of_view(camera((0.0, 0.0, 10.0), (100.0, 0.0, 0.0)), 200.0, 200.0, ROWS, COLUMNS)


def test_right_is_right_and_up_is_up_in_both_views() -> None:
    planes = np.zeros((2, 40, 40), np.float32)
    planes[0, :, 20:] = 1
    planes[1, :20] = 1
    maps = Tiled(planes, 1.0)
    for view in (
        rectified(40, 40, 1.0, np.array([0.0, 0.0, 100.0])),
        photographed(camera((0.0, 0.0, 100.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 10.0), ROWS, COLUMNS),
    ):
        right, up = seen(maps, view)
        half_columns, half_rows = view.columns // 2, view.rows // 2
        assert (right[:, :half_columns] == 0).all()
        assert (right[:, half_columns:] == 1).all()
        assert (up[:half_rows] == 1).all()
        assert (up[half_rows:] == 0).all()


def test_tiles_lie_side_by_side_and_end_with_the_sheet() -> None:
    planes = np.random.default_rng(0).uniform(size=(2, 5, 7)).astype(np.float32)
    maps = Tiled(planes, 0.5, (3, 2))
    assert maps.size_mm == (10.5, 5.0)
    wide = seen(maps, rectified(12, 23, 0.5, np.array([0.0, 0.0, 9.0])))
    np.testing.assert_array_equal(wide[:, 1:11, 1:22], np.tile(planes, (1, 2, 3)))
    assert np.isnan(wide[:, [0, -1]]).all()
    assert np.isnan(wide[:, :, [0, -1]]).all()


def test_slopes_are_those_of_the_heights() -> None:
    y, x = np.mgrid[4:-5:-1, -6:7] * 20.0
    plane = slopes_of(0.03 * x - 0.02 * y, 20.0, periodic=False)
    np.testing.assert_allclose(plane[0], 0.03, rtol=1e-5)
    np.testing.assert_allclose(plane[1], -0.02, rtol=1e-5)
    angle = 2 * np.pi * np.arange(64) / 64
    wave = slopes_of(np.tile(np.sin(angle), (4, 1)), 2.0, periodic=True)
    np.testing.assert_allclose(wave[0], np.tile(2 * np.pi / 128 * np.cos(angle), (4, 1)), atol=1e-4)


@pytest.mark.parametrize("periodic", [True, False])
def test_slopes_are_interpolated_along_rows_and_columns(periodic: bool) -> None:
    slopes = np.random.default_rng(2).uniform(size=(2, 6, 6)).astype(np.float32)
    out = np.full((2, 7, 7), np.nan, np.float32)
    slope_rows(Bumps(slopes, 1.0, periodic), rectified(7, 7, 1.0, np.array([0.0, 0.0, 9.0])), out, (0, 7))
    rows = (slopes[:, :-1] + slopes[:, 1:]) / 2
    np.testing.assert_allclose(out[:, 1:-1, 1:-1], (rows[:, :, :-1] + rows[:, :, 1:]) / 2, rtol=1e-5)


@pytest.mark.parametrize("periodic", [True, False])
def test_slopes_are_interpolated_and_go_on_or_end(periodic: bool) -> None:
    slopes = np.random.default_rng(1).uniform(size=(2, 6, 6)).astype(np.float32)
    out = np.full((2, 12, 13), np.nan, np.float32)
    slope_rows(Bumps(slopes, 1.0, periodic), rectified(12, 13, 1.0, np.array([0.0, 0.0, 9.0])), out, (0, 12))
    # The picture has one column more, so that its pixels lie between those of the field.
    between = (slopes[:, :, :-1] + slopes[:, :, 1:]) / 2
    np.testing.assert_allclose(out[:, 3:9, 4:9], between, rtol=1e-5)
    if periodic:
        np.testing.assert_allclose(out[:, :6, :6], out[:, 6:, 6:12], rtol=1e-5)
    else:
        assert (out[:, :3] == 0).all()
        assert (out[:, :, :3] == 0).all()
