"""What render.point_light makes of its settings: views, tiles, bumps, lights together, and what it chooses itself."""

from __future__ import annotations

import inspect
import logging
from dataclasses import replace

import numpy as np
import pytest

from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.data.height_fields import HeightField
from pipeline.devices import virtual_sheet
from pipeline.devices.photo_folder_writer import write_point_light
from pipeline.devices.sheet_views import camera_view
from pipeline.devices.virtual_sheet import Sheet
from pipeline.errors import InputError
from pipeline.stages.fit.offset import offset
from pipeline.stages.render.point_light import _check_point_light, point_light

LIGHTS = [[60.0, 20.0, 250.0], [-40.0, 70.0, 200.0]]


def maps(rows: int = 30, columns: int = 40, pixel_mm: float = 1.0) -> tuple[OrientationMap, PeriodMap]:
    """A wheel, whose spokes light up, of two periods."""
    y, x = np.mgrid[rows:0:-1, 0:columns] - np.array([rows, columns])[:, None, None] / 2
    angle = (2 * np.arctan2(y, x) % np.pi).astype(np.float32)
    mask = np.ones((rows, columns), bool)
    period = np.where(x > 0, 1.2, 1.6).astype(np.float32)
    return OrientationMap(angle, angle, angle, mask, pixel_mm, absolute=True), PeriodMap(period, mask, pixel_mm)


def test_tiles_are_repeated_and_each_is_lit_where_it_lies() -> None:
    tile = maps(15, 20)
    series = point_light(*tile, lights_mm=LIGHTS, tiles=[2, 3])
    whole = [
        OrientationMap(*(np.tile(tile[0].orientation_rad, (3, 2)),) * 3, np.ones((45, 40), bool), 1.0, absolute=True),
        PeriodMap(np.tile(tile[1].period_um, (3, 2)), np.ones((45, 40), bool), 1.0),
    ]
    np.testing.assert_array_equal(series.rgb, point_light(*whole, lights_mm=LIGHTS).rgb)
    assert series.pixel_mm == 1.0


def test_many_tiles_are_shown_by_fewer_pixels_and_the_brightness_stays(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    settings = {"lights_mm": LIGHTS[:1], "light_sigma_mm": 25.0, "white_percentile": 100.0}
    whole = point_light(*maps(pixel_mm=0.2), tiles=[6, 6], **settings).rgb
    few = point_light(*maps(pixel_mm=0.2), tiles=[6, 6], size_px=[60, 45], **settings)
    assert few.rgb.shape == (1, 45, 60, 3)
    assert few.pixel_mm == pytest.approx(0.8)
    assert "Each pixel is the mean of" in caplog.text
    blocks = whole[0].reshape(45, 4, 60, 4, 3).mean(axis=(1, 3))
    shown = few.rgb[0] * (blocks.sum() / few.rgb.sum())
    assert np.sqrt(np.mean((shown - blocks) ** 2)) < 0.02 * blocks.max()


def test_a_camera_above_sees_what_the_rectified_picture_shows() -> None:
    """A distant camera straight above, whose pixels are those of the map."""
    settings = {"lights_mm": LIGHTS, "camera_mm": [0.0, 0.0, 500.0], "anti_aliased": False, "evaluator": "spectral"}
    angle = np.rad2deg(2 * np.arctan(20 / 500))
    flat = point_light(*maps(), **settings)
    seen = point_light(*maps(), view="camera", size_px=[40, 30], field_of_view_deg=float(angle), **settings)
    np.testing.assert_allclose(seen.rgb, flat.rgb, atol=1e-5)
    assert seen.pixel_mm is None


def test_an_oblique_camera_sees_the_same_points_as_bright(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    camera = [-150.0, -200.0, 300.0]
    settings = {"lights_mm": LIGHTS[:1], "camera_mm": camera, "white_percentile": 100.0, "anti_aliased": False}
    tile = maps(120, 160, 0.25)
    flat = point_light(*tile, **settings).rgb[0]
    seen = point_light(*tile, view="camera", size_px=[80, 60], **settings).rgb[0]
    assert "shows the whole sheet" in caplog.text
    sheet = Sheet(tile[0].orientation_rad, tile[1].period_um, 0.25)
    view = camera_view(sheet, np.array(camera), [0.0, 0.0, 0.0], [0.0, 1.0, 0.0], None, [80, 60])
    x, y = np.moveaxis(view.points(*np.meshgrid(np.arange(80.0), np.arange(60.0))), -1, 0)
    column, row = np.floor(x / 0.25 + 80).astype(int), np.floor(60 - y / 0.25).astype(int)
    on = (column >= 0) & (column < 160) & (row >= 0) & (row < 120)
    assert 0.3 < on.mean() < 0.95
    assert (seen[~on] == 0).all()
    expected = flat[row[on], column[on]]
    np.testing.assert_allclose(seen[on] / seen.max(), expected / expected.max(), atol=0.05)


def test_lights_together_are_their_sum(tmp_path) -> None:
    settings = {"lights_mm": LIGHTS, "white_percentile": 100.0}
    apart, together = (point_light(*maps(), together=both, **settings) for both in (False, True))
    total = apart.rgb.sum(axis=0)
    assert together.rgb.shape == (1, 30, 40, 3)
    np.testing.assert_allclose(together.rgb[0], total / total.max(), atol=1e-5)
    with pytest.raises(InputError, match="all lights are on in one picture"):
        write_point_light(together, tmp_path)
    with pytest.raises(InputError, match="all lights are on in one photograph"):
        offset(replace(maps()[0], absolute=False), maps()[1], together)


def test_bumps_tilt_the_gratings() -> None:
    """A slope of 0.05 along x turns the normal, and with it moves the mirror's direction to a light elsewhere."""
    x = np.broadcast_to(np.arange(-25.0, 26.0) * 2000.0, (51, 51))
    slope = HeightField(0.05 * x, 2000.0)
    mirror, mask = np.zeros((5, 5), np.float32), np.ones((5, 5), bool)
    flat = (
        OrientationMap(mirror, mirror, mirror, mask, 1.0, absolute=True),
        PeriodMap(np.full((5, 5), 1.3, np.float32), mask, 1.0),
    )
    camera = [0.0, 0.0, 500.0]
    towards = np.tan(2 * np.arctan(-0.05)) * 300
    lights = [[0.0, 0.0, 300.0], [towards, 0.0, 300.0], [-towards, 0.0, 300.0]]
    settings = {"lights_mm": lights, "camera_mm": camera, "light_sigma_mm": 3.0}
    on_flat, on_slope = (
        point_light(*flat, bumps, **settings).rgb[:, 2, 2].sum(axis=-1)
        for bumps in (HeightField(0.0 * x, 2000.0), slope)
    )
    assert np.argmax(on_flat) == 0
    assert np.argmax(on_slope) == 1
    with pytest.raises(InputError, match="1 heights of the bumps are not known"):
        point_light(*flat, HeightField(np.array([[0.0, np.nan], [0.0, 0.0]]), 10.0), **settings)


def test_large_pictures_are_looked_up_and_the_choice_is_told(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    settings = {"lights_mm": LIGHTS, "white_percentile": 100.0, "wavelength_step_nm": 1.0}
    exact = point_light(*maps(), **settings).rgb
    assert "table" not in caplog.text
    monkeypatch.setattr(virtual_sheet, "_WORTH_A_TABLE", 1)
    found = point_light(*maps(), **settings).rgb
    assert "Colours are looked up in a table" in caplog.text
    assert 0 < np.abs(found - exact).max() < 0.01
    monkeypatch.setattr(virtual_sheet, "_error", lambda *_: 0.2)
    caplog.clear()
    np.testing.assert_array_equal(point_light(*maps(), **settings).rgb, exact)
    assert "20 percent of white, so that the spectrum is summed" in caplog.text
    caplog.clear()
    point_light(*maps(), evaluator="tabulated", **settings)
    assert [record.levelname for record in caplog.records if "table" in record.getMessage()] == ["WARNING"]


def test_gratings_too_deep_for_a_table_are_summed(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    monkeypatch.setattr(virtual_sheet, "_WORTH_A_TABLE", 1)
    settings = {"lights_mm": LIGHTS, "depth_um": 400.0, "camera_mm": [200.0, 0.0, 200.0], "wavelength_step_nm": 50.0}
    settings["light_sigma_mm"] = 1.0
    assert np.isfinite(point_light(*maps(), **settings).rgb).all()
    assert "The spectrum is summed: a table of colours would have" in caplog.text
    assert "wavelength_step_nm 50 is too coarse" in caplog.text
    with pytest.raises(InputError, match=r"more than \d+"):
        point_light(*maps(), evaluator="tabulated", **settings)


def test_a_sheet_without_gratings_is_black() -> None:
    angle, period = maps()
    angle.orientation_rad[:] = np.nan
    period.period_um[:] = np.nan
    for view in ("rectified", "camera"):
        series = point_light(angle, period, lights_mm=LIGHTS, view=view, tiles=[2, 2], size_px=[12, 9])
        assert (series.rgb == 0).all()


@pytest.mark.parametrize("evaluator", ["spectral", "tabulated"])
def test_a_sheet_that_nothing_lights_is_black_and_the_tails_of_lobes_are_not_brightened(
    evaluator: str, caplog: pytest.LogCaptureFixture
) -> None:
    """Gratings along x, and a light that leaves their plane by up to five times its own extent and more."""
    angle, period = maps(pixel_mm=0.2)
    angle.orientation_rad[:] = np.random.default_rng(0).normal(0, 0.02, angle.orientation_rad.shape)
    brightest = {}
    for y in (30.0, 58.0, 150.0):
        caplog.clear()
        series = point_light(angle, period, lights_mm=[[0.0, y, 300.0]], evaluator=evaluator)
        brightest[y] = (series.rgb.max(), "Nothing shines here" in caplog.text)
    assert brightest[30.0] == (pytest.approx(1, abs=0.2), False)
    assert brightest[58.0] == (pytest.approx(0, abs=1e-3), True)
    assert brightest[150.0] == (0, True)


def test_no_field_of_view_shows_what_lies_behind_the_camera() -> None:
    with pytest.raises(InputError, match="not in front of the camera"):
        point_light(*maps(), lights_mm=LIGHTS, view="camera", camera_mm=[0.0, 0.0, 5.0], target_mm=[900.0, 0.0, 5.0])


@pytest.mark.parametrize(
    ("setting", "value", "message"),
    [
        ("tiles", [12], r"\[12\] does not say how many"),
        ("tiles", [0, 8], "whole numbers from 1"),
        ("size_px", [100], "columns, rows"),
        ("size_px", [100, 100_000], "in pixels"),
        ("samples", 0, "1 to 32"),
        ("tolerance", 0.0, "0.0001 to 0.5"),
        ("refractive_index", 1.0, "denser than air"),
        ("field_of_view_deg", 180.0, "at most 170"),
        ("target_mm", [1.0, 2.0], "is no place"),
        ("target_mm", [0.0, 0.0, 500.0], "where the camera is"),
        ("up", [0.0, 0.0, 1.0], "points along the view"),
        ("up", [0.0, 0.0, 0.0], "is no direction"),
    ],
)
def test_impossible_settings_are_refused(setting: str, value, message: str) -> None:
    defaults = {n: p.default for n, p in inspect.signature(point_light).parameters.items() if p.kind == p.KEYWORD_ONLY}
    good = {**defaults, "lights_mm": LIGHTS}
    _check_point_light(**good)
    with pytest.raises(InputError, match=message):
        _check_point_light(**{**good, setting: value})
