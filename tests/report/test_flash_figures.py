"""What the report shows of photographs under a flash."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from pipeline.data.flash import FlashBrackets, FlashPhotographs, Tiles
from pipeline.optics.tile_alignment import translation
from pipeline.report.figures import figures_of
from pipeline.report.writers import WRITERS

RNG = np.random.default_rng(2)
LIGHTS = np.array([[100.0, 0.0, 250.0], [np.nan, np.nan, np.nan]])


@pytest.fixture
def photos() -> FlashPhotographs:
    return FlashPhotographs(
        radiance=RNG.exponential(size=(2, 30, 40, 3)).astype(np.float32),
        valid=np.ones((2, 30, 40), bool),
        light_mm=LIGHTS,
        camera_mm=np.array([0.0, 0.0, 500.0]),
        pixel_mm=0.5,
        wavelength_nm=530.0,
        bandwidth_nm=10.0,
        room=RNG.random((30, 40, 3)).astype(np.float32),
        response=np.geomspace(1e-3, 10, 256)[:, None] * np.ones(3),
    )


@pytest.fixture
def found() -> Tiles:
    homographies = np.stack([translation(*place) for place in ((0.0, 0.0), (20.0, 0.0), (0.0, 15.0), (20.0, 15.0))])
    numbers = np.array([0.0, 0.25, 1.5, 0.5])
    return Tiles(homographies, (15, 20), 0, numbers, numbers, 1 - numbers, 0.5, RNG.random((15, 20)).astype(np.float32))


def test_brackets_are_shown_by_flash_and_exposure() -> None:
    images = RNG.integers(0, 255, (2, 3, 20, 30, 3), np.uint8)
    taken = FlashBrackets(images, np.array([0.001, 0.01, 0.1]), False, images[0, 0], LIGHTS, np.zeros(3))
    shown = figures_of(taken)
    assert [figure.title for figure in shown] == ["photographs", "room light"]
    assert shown[0].body.count("<img") == 6
    assert "flash 1 at (100, 0, 250) mm" in shown[0].body
    assert "flash 2, somewhere" in shown[0].body
    assert "as the camera stored them" in shown[0].caption


def test_radiance_is_shown_with_the_response(photos: FlashPhotographs) -> None:
    shown = figures_of(photos)
    assert [figure.title for figure in shown] == ["radiance", "room light", "response"]
    assert "Through a filter at 530 nm, 10 nm wide." in shown[0].caption
    assert "of 0.5 mm; row 0 at the largest y" in shown[0].caption


def test_tiles_are_outlined_and_their_mean_shown(found: Tiles) -> None:
    shown = figures_of(found)
    assert [figure.title for figure in shown] == ["tiles", "pattern"]
    assert shown[0].body.count('class="frame"') == 3
    assert "moved by at most 1.5 px" in shown[0].caption


def test_rectified_radiance_and_tiles_are_written(photos: FlashPhotographs, found: Tiles, tmp_path: Path) -> None:
    files = {path.name for path in WRITERS["FlashPhotographs"](tmp_path / "rectified", photos)}
    assert files == {f"rectified_{name}.{kind}" for name in ("0", "1", "room") for kind in ("exr", "png")}
    files = {path.name for path in WRITERS["Tiles"](tmp_path / "tiles", found)}
    assert files == {"tiles.csv", "tiles.png"}
    rows = list(csv.DictReader((tmp_path / "tiles.csv").open()))
    assert float(rows[3]["bottom_right_x_px"]) == 39
    assert float(rows[2]["residual_px"]) == 1.5
