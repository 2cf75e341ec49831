"""Photographs under a torch, from a folder: places, exposures, and everything wrong named with its line or file."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest
from photo_makers import write_image

from pipeline.data.pictures import PictureSeries
from pipeline.devices.photo_folder_writer import write_point_light
from pipeline.devices.point_light_folder import read_point_light_folder, read_point_light_yaml
from pipeline.errors import InputError, InputErrors
from pipeline.stages.capture import recorded_point_light as stage

ROWS, COLUMNS = 5, 7
WHOLE = """\
kind: point_light
camera_mm: [0, 0, 500]
pixel_mm: 2e-2
photos:
  - {file: torch_1.tif, light_mm: [140, 0, 300]}
  - {file: torch_2.tif, light_mm: [-70.5, 121.2, 300]}
"""


def colours(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).random((ROWS, COLUMNS, 3)).astype(np.float32)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for index in (1, 2):
        write_image(tmp_path / f"torch_{index}.tif", colours(index))
    (tmp_path / "capture.yaml").write_text(WHOLE)
    return tmp_path


def test_pictures_and_places_are_those_of_the_folder(folder: Path) -> None:
    series = stage.recorded_point_light(folder=folder)
    assert np.array_equal(series.rgb, [colours(1), colours(2)])
    assert series.light_mm.tolist() == [[140, 0, 300], [-70.5, 121.2, 300]]
    assert series.camera_mm.tolist() == [0, 0, 500]
    assert series.pixel_mm == 0.02


def test_written_pictures_are_read_as_they_were(tmp_path: Path) -> None:
    light = np.array([[1 / 3, -2.0, 300.0], [0.1, 0.2, 1e3]])
    series = PictureSeries(np.stack([colours(1) - 0.2, colours(2) + 1]), light, np.array([0.1, 0.0, 500.0]), 1 / 150)
    write_point_light(series, tmp_path / "torch")
    back = read_point_light_folder(tmp_path / "torch")
    for name in ("rgb", "light_mm", "camera_mm"):
        assert np.array_equal(getattr(back, name), getattr(series, name)), name
        assert getattr(back, name).dtype == getattr(series, name).dtype
    assert back.pixel_mm == series.pixel_mm


def test_pictures_that_are_no_numbers_are_not_written(tmp_path: Path) -> None:
    series = PictureSeries(np.full((1, 2, 2, 3), np.nan, np.float32), np.ones((1, 3)), np.ones(3))
    with pytest.raises(InputError, match="pixels are NaN or infinite"):
        write_point_light(series, tmp_path)
    with pytest.raises(InputError, match=r"pictures of shape \(0, 2, 2, 3\)"):
        write_point_light(PictureSeries(series.rgb[:0], np.ones((0, 3)), np.ones(3)), tmp_path)


def test_exposures_are_brought_to_the_shortest(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    write_image(folder / "torch_1.tif", colours(1), ExposureTime=0.125)
    write_image(folder / "torch_2.tif", colours(1), ExposureTime=0.5)
    with caplog.at_level(logging.INFO):
        series = read_point_light_folder(folder)
    assert np.array_equal(series.rgb[0], colours(1))
    assert np.array_equal(series.rgb[1], colours(1) / 4)
    assert "exposures of 0.125 to 0.5 s" in caplog.text


def test_the_room_is_subtracted_and_grey_has_three_channels(folder: Path) -> None:
    grey = colours(3)[..., 0]
    write_image(folder / "torch_2.tif", grey)
    write_image(folder / "room.tif", np.full((ROWS, COLUMNS), 0.25, np.float32))
    (folder / "capture.yaml").write_text(WHOLE + "dark: room.tif\n")
    series = read_point_light_folder(folder)
    assert np.array_equal(series.rgb[1], np.repeat(grey[..., None], 3, axis=2) - np.float32(0.25))
    assert np.array_equal(series.rgb[0], colours(1) - np.float32(0.25))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "point_light",
            "polarizer_sequence",
            r"'polarizer_sequence' cannot be replayed as[\s\S]*yaml:1[\s\S]*point_light",
        ),
        ("[0, 0, 500]", "[0, 0]", r"no place before the sample[\s\S]*yaml:2[\s\S]*\[x, y, z\] in mm, z above 0"),
        ("[0, 0, 500]", "[0, 0, -500]", r"no place before the sample[\s\S]*yaml:2"),
        ("[140, 0, 300]", "[140, east, 300]", r"no place before the sample[\s\S]*yaml:5"),
        ("[140, 0, 300]", "[.inf, 0, 300]", r"no place before the sample[\s\S]*yaml:5"),
        ("[140, 0, 300]", "140", r"no place before the sample[\s\S]*yaml:5"),
        (", light_mm: [140, 0, 300]", "", r"a photo lacks 'light_mm'[\s\S]*yaml:5"),
        ("camera_mm: [0, 0, 500]\n", "", r"capture.yaml lacks 'camera_mm'"),
        ("pixel_mm: 2e-2", "pixel_mm: 0", r"'0' is no positive number[\s\S]*yaml:3"),
        ("pixel_mm", "pixle_mm", r"has no 'pixle_mm'[\s\S]*mean 'pixel_mm'"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(folder: Path, old: str, new: str, message: str) -> None:
    assert WHOLE.count(old) == 1
    (folder / "capture.yaml").write_text(WHOLE.replace(old, new))
    with pytest.raises(InputErrors, match=message):
        read_point_light_yaml(folder / "capture.yaml")


@pytest.mark.parametrize("text", ["", "kind: point_light\ncamera_mm: [0, 0, 1]\nphotos: []"])
def test_no_photographs_at_all(folder: Path, text: str) -> None:
    (folder / "capture.yaml").write_text(text)
    with pytest.raises(InputErrors, match=r"capture.yaml is empty|photos is a list of 0"):
        stage._check_recorded_point_light(folder=folder)


def test_files_are_looked_at_before_anything_runs(folder: Path) -> None:
    write_image(folder / "torch_2.tif", colours(2)[1:])
    with pytest.raises(InputErrors, match=r"a photo of 7 x 4 pixels[\s\S]*torch_2.tif[\s\S]*7 x 5 pixels, as torch_1"):
        stage._check_recorded_point_light(folder=folder)
    write_image(folder / "torch_2.tif", np.full((ROWS, COLUMNS), np.nan, np.float32))
    with pytest.raises(InputErrors, match=r"pixels are NaN or infinite[\s\S]*torch_2.tif"):
        stage._check_recorded_point_light(folder=folder)
    (folder / "torch_2.tif").unlink()
    with pytest.raises(InputErrors, match=r"there is no photo torch_2.tif[\s\S]*torch_1.tif"):
        stage._check_recorded_point_light(folder=folder)


def test_a_folder_that_is_missing_or_says_nothing(folder: Path) -> None:
    with pytest.raises(InputErrors, match=r"the folder does not exist"):
        read_point_light_folder(folder / "none")
    (folder / "capture.yaml").unlink()
    with pytest.raises(InputErrors, match=r"the folder has no capture.yaml[\s\S]*of kind point_light"):
        read_point_light_folder(folder)
