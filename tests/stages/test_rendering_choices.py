"""What a sheet's rendering chooses itself: points of a pixel, their extent, and when it warns."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from pipeline.devices.sheet_views import rectified_view
from pipeline.devices.virtual_light import Lighting, warn_of_aliasing
from pipeline.devices.virtual_sheet import POINTS, Sampling, Sheet, automatic_sampling, render_sheet
from pipeline.optics.sheet.view import rectified

EYE = np.array([0.0, 0.0, 500.0])


def lit(light: tuple[float, float, float], sigma: float = 12.0, step: float = 5.0) -> Lighting:
    return Lighting(np.array([light]), EYE, sigma, "D65", 0.12, 65.0, step)


def sheet(orientation: np.ndarray, pixel_mm: float) -> Sheet:
    return Sheet(orientation.astype(np.float32), np.full(orientation.shape, 1.3, np.float32), pixel_mm)


def test_stripes_of_a_pixel_each_need_one_point_of_it() -> None:
    """A large picture is tried on some of its pixels, but still within each of them."""
    stripes = np.where(np.arange(1024) // 2 % 2, 0.4, 1.3) * np.ones((1024, 1))
    lighting = lit((100.0, 40.0, 300.0), 25.0)
    chosen = automatic_sampling(
        sheet(stripes, 0.1), rectified(512, 512, 0.2, EYE), lighting, samples=None, tolerance=0.01
    )
    assert chosen == POINTS


@pytest.mark.parametrize(("pixel_mm", "part"), [(0.05, 0.0), (0.5, 0.5)])
def test_lobes_are_averaged_where_they_change_within_a_point(pixel_mm: float, part: float) -> None:
    """Half vectors change by 1/200 a mm: in half a pixel of 0.5 mm by a fifth of a lobe's standard deviation."""
    whole = sheet(np.full((64, 64), 0.4), pixel_mm)
    found = automatic_sampling(
        whole, rectified(64, 64, pixel_mm, EYE), lit((100.0, 40.0, 300.0), 0.0), samples=2, tolerance=0.003
    )
    assert found == Sampling(2, part)


def test_a_large_picture_is_checked_with_the_lobes_that_it_is_drawn_with(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    whole = sheet(np.full((260, 260), 0.4), 0.8)
    view = rectified(260, 260, 0.8, EYE)
    render_sheet(
        whole, view, lit((100.0, 42.0, 300.0), 2.0), evaluator="tabulated", sampling=Sampling(1, 1.0), tolerance=0.01
    )
    assert "Colours are looked up in a table" in caplog.text
    assert not [record for record in caplog.records if record.levelno > logging.INFO]


def test_a_slanting_light_is_seen_to_be_narrow(caplog: pytest.LogCaptureFixture) -> None:
    period = np.ones((1, 1), np.float32)
    for light, warned in (((0.0, 0.0, 400.0), False), ((395.0, 0.0, 63.0), True)):
        caplog.clear()
        warn_of_aliasing(period, lit(light, 1.0, 6.9))
        assert ("too coarse" in caplog.text) == warned


def test_a_picture_of_another_shape_shows_the_whole_sheet() -> None:
    whole = sheet(np.zeros((20, 40)), 1.0)
    for size in ([10, 40], [40, 10], [8, 4]):
        view = rectified_view(whole, EYE, size)
        corners = view.pixels(np.array([-20.0, 20.0]), np.array([10.0, -10.0])) + 0.5
        assert corners.min() >= 0
        assert (corners <= size).all()
        assert np.isclose(np.ptp(corners, axis=0), size).any()
