"""From photographs under a flash to the tiles of a sheet."""

from __future__ import annotations

import logging
from dataclasses import replace

import cv2
import numpy as np
import pytest

from pipeline.data.flash import FlashBrackets, FlashPhotographs, Tiles
from pipeline.data.gratings import GratingSample
from pipeline.devices.flash_camera import FlashCamera
from pipeline.devices.simulated_flash import FlashBench, PhoneFlash
from pipeline.errors import InputError
from pipeline.optics.tile_alignment import corners_of
from pipeline.optics.tile_lattice import edges
from pipeline.stages.align.radiance import radiance
from pipeline.stages.align.rectified import rectified
from pipeline.stages.align.tiles import tiles
from pipeline.stages.capture.flash_photographs import flash_photographs
from pipeline.stages.extract.drawn_tile import drawn_tile
from pipeline.stages.simulate.polygons import polygons


@pytest.fixture(scope="module")
def sample() -> GratingSample:
    return polygons(pixel_mm=0.2)


@pytest.fixture(scope="module")
def taken(sample: GratingSample) -> FlashBrackets:
    rig = FlashBench(
        camera=FlashCamera(size_px=[480, 400], field_of_view_deg=27.0, exposure_s=[0.002, 0.01, 0.05], samples=2),
        light=PhoneFlash(lights_mm=[[60.0, 25.0, 200.0]], wavelength_step_nm=5.0),
        tiles=[6, 5],
        board=[20, 17],
        knows_corners=True,
    )
    return flash_photographs(sample, rig=rig)


@pytest.fixture(scope="module")
def sheet(taken: FlashBrackets) -> FlashPhotographs:
    return rectified(radiance(taken))


def test_a_board_below_the_sheet_tells_where_its_corners_are(taken: FlashBrackets) -> None:
    found = rectified(radiance(taken), corners="charuco", board=[20, 17])
    assert found.corners_px == pytest.approx(taken.corners_px, abs=0.15)


def test_the_lattice_is_found_to_a_thousandth(sheet: FlashPhotographs) -> None:
    found = tiles(sheet)
    assert found.metrics["tile_width_mm"] == pytest.approx(28, rel=2e-3)
    assert found.metrics["tile_height_mm"] == pytest.approx(28, rel=2e-3)
    assert len(found.homographies) == 30
    begin = found.homographies[found.reference, :2, 2]
    assert begin == pytest.approx(np.rint(begin))
    assert found.metrics["residual_px"] < 0.4


def misplaced_px(found: Tiles) -> float:
    """Root mean square distance of corners from where tiles that are 28 mm apart have them."""
    corners = np.stack([corners_of(homography, found.shape) for homography in found.homographies])
    away = corners - corners[found.reference]
    step = 28 / found.pixel_mm
    away -= step * np.rint(away.mean(axis=1, keepdims=True) / step)
    return float(np.sqrt((away**2).sum(axis=-1).mean()))


def test_a_tile_that_was_picked_too_large_is_put_right(sheet: FlashPhotographs) -> None:
    """Section 7.2: tiles that are translated lie the farther off, the farther they are from the picked one."""
    translated = tiles(sheet, tile_mm=[28.3, 27.8], motion="translation")
    aligned = tiles(sheet, tile_mm=[28.3, 27.8])
    assert misplaced_px(translated) > 1
    assert misplaced_px(aligned) < 0.2
    assert translated.moved_px.max() == 0
    assert aligned.moved_px.max() > 1
    assert translated.metrics["residual_px"] > 4 * aligned.metrics["residual_px"]


def test_the_drawn_tile_lies_as_the_photograph_shows_it(sample: GratingSample, sheet: FlashPhotographs) -> None:
    found = tiles(sheet, corner_mm=[-20.0, 33.0], tile_mm=[28.0, 28.0])
    drawn = drawn_tile(sample, found, sheet)
    assert found.pattern is not None
    assert drawn.orientation_rad.shape == found.shape

    def likeness(orientation: np.ndarray) -> float:
        seams = edges(np.cos(2 * orientation).astype(np.float32)) + edges(np.sin(2 * orientation).astype(np.float32))
        return float(np.corrcoef(cv2.GaussianBlur(seams, (0, 0), 1.0).ravel(), found.pattern.ravel())[0, 1])

    right = likeness(drawn.orientation_rad)
    wrong = [drawn.orientation_rad[::-1], drawn.orientation_rad[:, ::-1], np.roll(drawn.orientation_rad, 6, axis=1)]
    assert right > 0.5
    assert max(likeness(turned) for turned in wrong) < 0.5 * right


def test_without_room_light_a_tile_has_to_be_picked(sheet: FlashPhotographs) -> None:
    dark = replace(sheet, room=None)
    with pytest.raises(InputError, match="without a photograph under room light tiles are not found"):
        tiles(dark)
    with pytest.raises(InputError, match=r"no photograph under room light[\s\S]*translation"):
        tiles(dark, tile_mm=[28.0, 28.0], motion="tile")
    found = tiles(dark, tile_mm=[28.0, 28.0])
    assert len(found.homographies) == 30
    assert np.isnan(found.residual_px).all()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"tile_mm": [2.0, 28.0]}, r"tiles of 2 x 28 mm are too few pixels[\s\S]*at least 16"),
        ({"tile_mm": [280.0, 28.0]}, "no whole tile lies on the sheet"),
        ({"tile_mm": [28.0, 28.0], "corner_mm": [80.0, 0.0]}, "the picked tile does not lie on the sheet"),
        ({"tile_mm": [28.0]}, r"\[28.0\] is no size"),
        ({"corner_mm": [1.0]}, r"\[1.0\] is no place"),
    ],
)
def test_tiles_that_cannot_be_are_refused(
    sheet: FlashPhotographs, settings: dict[str, list[float]], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        tiles(sheet, **settings)


def test_photographs_have_to_be_rectified_first(taken: FlashBrackets) -> None:
    with pytest.raises(InputError, match="the photographs are not rectified"):
        tiles(radiance(taken))


def test_a_single_exposure_has_no_curve_to_be_found(taken: FlashBrackets, caplog: pytest.LogCaptureFixture) -> None:
    single = replace(taken, images=taken.images[:, :1], exposure_s=taken.exposure_s[:1])
    with pytest.raises(InputError, match="no response curve can be found from 1 exposures of 8 bits"):
        radiance(single, method="debevec")
    with caplog.at_level(logging.WARNING, "pipeline"):
        assert radiance(single).response is None
    assert "its levels are taken for sRGB" in caplog.text


def test_brackets_without_a_response_are_refused(taken: FlashBrackets) -> None:
    """As where 500 was written for 1/500 s, so that longer exposures seem darker."""
    with pytest.raises(InputError, match="the brackets tell no response curve"):
        radiance(replace(taken, exposure_s=1 / taken.exposure_s))


def test_corners_outside_the_photographs_are_refused(taken: FlashBrackets) -> None:
    """As of rows written before columns."""
    with pytest.raises(InputError, match=r"lies outside the photographs[\s\S]*\[column, row\], up to \[479, 399\]"):
        rectified(radiance(replace(taken, corners_px=np.array([[10, 10], [10, 450], [390, 450], [390, 10]]))))
