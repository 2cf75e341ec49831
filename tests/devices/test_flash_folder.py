"""Folders of photographs under a flash: written, replayed bit for bit, and refused where they are wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from photo_makers import write_image

from pipeline.data.flash import FlashBrackets
from pipeline.data.gratings import GratingSample
from pipeline.devices.flash_folder import FlashFolder
from pipeline.devices.photo_folder_writer import write_flash
from pipeline.devices.protocols import FlashRig
from pipeline.errors import InputError, InputErrors
from pipeline.stages.capture.flash_photographs import flash_photographs
from pipeline.stages.simulate.polygons import polygons

RNG = np.random.default_rng(8)


def brackets(kind: type[np.unsignedinteger], **changes: object) -> FlashBrackets:
    full = np.iinfo(kind).max
    known = {
        "images": RNG.integers(0, full, (2, 3, 12, 16, 3), kind, endpoint=True),
        "exposure_s": np.array([0.001, 1 / 60, 0.1]),
        "linear": kind is np.uint16,
        "room": RNG.integers(0, full, (12, 16, 3), kind, endpoint=True),
        "light_mm": np.array([[100.0, 0.1, 250.0], [-70.7, 70.7, 249.5]]),
        "camera_mm": np.array([0.0, 1.5, 500.0]),
        "sheet_mm": (297.0, 210.0),
        "corners_px": np.array([[1.25, 1.0], [14.0, 1.0], [14.5, 10.0], [1.0, 10.75]]),
        "wavelength_nm": 530.0,
        "bandwidth_nm": 10.0,
        "light_sigma_mm": 4.0,
        "metadata": {"model": "Bench 1"},
    }
    return FlashBrackets(**known | changes)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_what_is_written_is_replayed_bit_for_bit(tmp_path: Path, kind: type[np.unsignedinteger]) -> None:
    taken = brackets(kind)
    write_flash(taken, tmp_path)
    rig = FlashFolder(folder=tmp_path)
    assert isinstance(rig, FlashRig)
    rig.check()
    again = flash_photographs(rig=rig)
    assert again.images.dtype == kind
    for name, value in vars(taken).items():
        assert np.array_equal(getattr(again, name), value), name


def test_what_is_not_known_stays_so(tmp_path: Path) -> None:
    unknown = {"light_mm": np.full((2, 3), np.nan), "camera_mm": np.full(3, np.nan), "room": None, "corners_px": None}
    unknown |= {"wavelength_nm": None, "bandwidth_nm": None, "light_sigma_mm": None, "sheet_mm": None, "metadata": {}}
    write_flash(brackets(np.uint8, **unknown), tmp_path)
    again = flash_photographs(rig=FlashFolder(folder=tmp_path))
    assert np.isnan(again.light_mm).all()
    assert again.light_mm.shape == (2, 3)
    assert np.isnan(again.camera_mm).all()
    assert (again.room, again.sheet_mm, again.corners_px, again.wavelength_nm) == (None,) * 4


def test_exposures_are_taken_from_the_files_where_nothing_is_stated(tmp_path: Path) -> None:
    for light in (1, 2):
        for time in (0.01, 0.25):
            pixels = np.full((8, 10, 3), 50 * light, np.uint8)
            write_image(tmp_path / f"{light}_{time}.jpg", pixels, ExposureTime=time, Compression="jpeg:100")
    photos = "".join(f"  - {{file: {n}_{t}.jpg, light: {n}}}\n" for n in (2, 1) for t in (0.25, 0.01))
    (tmp_path / "capture.yaml").write_text(f"kind: flash\nphotos:\n{photos}")
    taken = flash_photographs(rig=FlashFolder(folder=tmp_path))
    assert taken.exposure_s == pytest.approx([0.01, 0.25], rel=1e-3)
    assert taken.images.shape == (2, 2, 8, 10, 3)
    assert taken.images[:, 0].mean(axis=(1, 2, 3)) == pytest.approx([50, 100], abs=1)
    assert not taken.linear


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"capture.yaml is empty"),
        ("kind: flush\nphotos: [{file: a.png, light: 1}]", r"capture.yaml:1[\s\S]*flash"),
        ("kind: flash\nphotos: []", r"photos is a list of 0[\s\S]*light: 1"),
        ("kind: flash\nphotos: [{file: a.png, light: 0}]", r"'0' is no number of a light"),
        ("kind: flash\nphotos: [{file: a.png, light: 2}]", r"have the lights \[2\][\s\S]*every number from 1 to 1"),
        ("kind: flash\nlights_mm: [[1, 2]]\nphotos: [{file: a.png, light: 1}]", r"capture.yaml:2[\s\S]*\[x, y, z\]"),
        (
            "kind: flash\ncorners_px: [[1, 2]]\nphotos: [{file: a.png, light: 1}]",
            r"corners_px is a list of 1[\s\S]*four \[column, row\]",
        ),
        ("kind: flash\ncamera_mm: 500\nphotos: [{file: a.png, light: 1}]", r"camera_mm is '500'"),
        ("kind: flash\nlights_mm: [[1, 2, 3]]\nphotos: [{file: a.png, light: 2}]", r"1, as lights_mm has 1"),
        ("kind: flash\ncamera_mm: [0, 0, -9]\nphotos: [{file: a.png, light: 1}]", r"yaml:2[\s\S]*z towards the camera"),
        ("kind: flash\nlights_mm: [[1, 2, 0]]\nphotos: [{file: a.png, light: 1}]", r"is not above the sheet"),
        ("kind: flash\nsheet_mm: [0, 2]\nphotos: [{file: a.png, light: 1}]", r"\[width, height\] in mm, above 0"),
        ("kind: flash\nlight_mm: [1]\nphotos: [{file: a.png, light: 1}]", r"did you mean 'lights_mm'"),
    ],
)
def test_what_is_wrong_with_capture_yaml_is_told_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "capture.yaml").write_text(text)
    with pytest.raises(InputErrors, match=message):
        FlashFolder(folder=tmp_path).check()


def stated(folder: Path, *photos: str) -> FlashFolder:
    (folder / "capture.yaml").write_text("kind: flash\nphotos:\n" + "".join(f"  - {{{photo}}}\n" for photo in photos))
    for name, size in (("a", 8), ("b", 8), ("c", 9)):
        write_image(folder / f"{name}.png", np.zeros((size, 8, 3), np.uint8))
    return FlashFolder(folder=folder)


@pytest.mark.parametrize(
    ("photos", "message"),
    [
        (["file: d.png, light: 1, exposure_s: 1"], "there is no photo d.png"),
        (["file: a.png, light: 1, exposure_s: 1", "file: c.png, light: 2, exposure_s: 1"], "a photo of 8 x 9 pixels"),
    ],
)
def test_what_is_wrong_with_files_is_told(tmp_path: Path, photos: list[str], message: str) -> None:
    with pytest.raises(InputErrors, match=message):
        stated(tmp_path, *photos).check()


@pytest.mark.parametrize(
    ("photos", "message"),
    [
        (["file: a.png, light: 1"], "the exposure of a.png is not known"),
        (["file: a.png, light: 1, exposure_s: 1", "file: b.png, light: 1, exposure_s: 1"], "has two photos of 1 s"),
        (
            ["file: a.png, light: 1, exposure_s: 1", "file: b.png, light: 2, exposure_s: 2"],
            r"light 2 has exposures of \[2.0\] s[\s\S]*\[1.0\] s, as light 1 has",
        ),
    ],
)
def test_brackets_have_to_be_alike(tmp_path: Path, photos: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        stated(tmp_path, *photos).check()


def test_a_longer_exposure_has_to_be_brighter(tmp_path: Path) -> None:
    """Files that were swapped, or 500 written for 1/500 s, make it darker."""
    for name, level in (("bright", 90), ("dim", 30)):
        write_image(tmp_path / f"{name}.png", np.full((8, 8, 3), level, np.uint8))
    photos = "file: bright.png, light: 1, exposure_s: 0.016", "file: dim.png, light: 1, exposure_s: 0.002"
    stated(tmp_path, *photos).check()
    with pytest.raises(InputErrors, match=r"dim.png of 500 s is darker than bright.png of 60 s[\s\S]*in seconds"):
        stated(tmp_path, photos[0].replace("0.016", "60"), photos[1].replace("0.002", "500")).check()


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    (tmp_path / "photos").mkdir()
    with pytest.raises(InputError, match=r"does not exist[\s\S]*did you mean 'photos'"):
        FlashFolder(folder=tmp_path / "phots").check()


def test_a_virtual_sample_cannot_be_laid_before_a_replay(tmp_path: Path) -> None:
    sample: GratingSample = polygons(pixel_mm=2.0)
    with pytest.raises(InputError, match="'polygons' cannot be placed before a replay"):
        FlashFolder(folder=tmp_path).place(sample)
