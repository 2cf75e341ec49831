"""A measured tile laid out over its sheet, rendered, and beside the photographs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flash_sheets import laid_tiles, photographed, stripes

from pipeline.data.flash import FlashPhotographs
from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.errors import InputError
from pipeline.stages.evaluate.picture_difference import picture_difference
from pipeline.stages.extract.even_period import even_period
from pipeline.stages.extract.flash_pictures import flash_pictures
from pipeline.stages.fit.highlight import highlight
from pipeline.stages.render.flash_sheet import flash_sheet

SIDE, PIXEL, TILES, LIGHTS = 16, 1.5, (11, 8), [[50.0, 30.0, 200.0], [0.0, -40.0, 200.0]]
TANGENTS = stripes([5.0, 50.0, 95.0, 140.0], side=SIDE)
TRUE = OrientationMap.of_angles(TANGENTS, pixel_mm=PIXEL, absolute=True)
SPACED = laid_tiles((SIDE, SIDE), TILES, PIXEL)


@pytest.fixture(scope="module")
def white() -> FlashPhotographs:
    return photographed(TANGENTS, np.full_like(TANGENTS, 1.6), LIGHTS, pixel_mm=PIXEL, tiles=TILES)


def test_true_maps_render_as_the_photographs_show_them(white: FlashPhotographs) -> None:
    rendering = flash_sheet(TRUE, even_period(TRUE, period_um=1.6), white, SPACED, highlight(white))
    seen = flash_pictures(replace(white, radiance=white.radiance * 3), rendering)
    assert seen.rgb.shape == rendering.rgb.shape == white.radiance.shape
    np.testing.assert_array_equal(seen.light_mm, white.light_mm)
    found = picture_difference(rendering, seen).metrics
    assert found["picture_correlation"] > 0.999
    np.testing.assert_allclose(np.maximum(rendering.rgb, 0), seen.rgb, atol=1e-3 * float(seen.rgb.max()))
    wrong = flash_sheet(TRUE, even_period(TRUE, period_um=1.3), white, SPACED, highlight(white))
    assert picture_difference(wrong, flash_pictures(white, wrong)).metrics["picture_correlation"] < 0.7


def test_a_tile_lies_where_it_was_found_and_nothing_beside_it(white: FlashPhotographs) -> None:
    """A tile that begins four columns later holds the pattern four columns further on."""
    later = np.array([[1.0, 0, 4], [0, 1, 0], [0, 0, 1]])
    moved = replace(SPACED, homographies=later @ SPACED.homographies)
    turned = OrientationMap.of_angles(np.roll(TANGENTS, -4, axis=1), pixel_mm=PIXEL, absolute=True)
    period = even_period(TRUE, period_um=1.6)
    first = flash_sheet(TRUE, period, white, SPACED, highlight(white), white_percentile=100.0)
    second = flash_sheet(turned, period, white, moved, highlight(white), white_percentile=100.0)
    assert not second.rgb[:, :, :4].any()
    np.testing.assert_allclose(second.rgb[:, :, 4:], first.rgb[:, :, 4:], atol=0.01)


def test_an_even_period_is_known_where_tangents_are() -> None:
    known = OrientationMap.of_angles(np.where(np.eye(3), np.nan, 1).astype(np.float32), pixel_mm=0.2, absolute=True)
    period = even_period(known, period_um=1.25)
    np.testing.assert_array_equal(period.period_um, np.where(np.eye(3), np.nan, np.float32(1.25)))
    assert (period.pixel_mm, period.relative) == (0.2, False)
    with pytest.raises(InputError, match="period_um"):
        even_period(known, period_um=0.0)


def test_maps_of_another_tile_and_pictures_of_other_lights_are_refused(white: FlashPhotographs) -> None:
    period = even_period(TRUE, period_um=1.6)
    with pytest.raises(InputError, match=r"are not of a tile of \(8, 8\)"):
        flash_sheet(TRUE, period, white, laid_tiles((8, 8), TILES, PIXEL), highlight(white))
    rendering = flash_sheet(TRUE, period, white, SPACED, highlight(white))
    with pytest.raises(InputError, match="2 pictures are not of the 1 lights"):
        flash_pictures(replace(white, radiance=white.radiance[:1]), rendering)
    with pytest.raises(InputError, match="have to be rectified"):
        flash_pictures(replace(white, pixel_mm=None), rendering)
    with pytest.raises(InputError, match="black where the rendering is lit"):
        flash_pictures(replace(white, radiance=np.zeros_like(white.radiance)), rendering)
    dark = PeriodMap(np.full_like(TANGENTS, np.nan), np.zeros(TANGENTS.shape, bool), PIXEL, relative=False)
    assert not flash_sheet(TRUE, dark, white, SPACED, highlight(white)).rgb.any()
