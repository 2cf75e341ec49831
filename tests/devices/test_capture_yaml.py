"""What a folder of photographs says about itself: capture.yaml, and file names in its place."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.devices.angle_names import angles_from_names, capture_from_names
from pipeline.devices.capture_yaml import read_capture_yaml
from pipeline.devices.decimal_angles import degrees_of, radians_of
from pipeline.errors import InputErrors

WHOLE = """\
kind: polarizer_sequence
wavelength_nm: 530
pixel_mm: 2e-2
photos:
  - {file: psi_000.tif, polarizer_deg: 0.0}
  - {file: psi_015.tif, polarizer_deg: 15, exposure_s: 0.5}
  - file: raw.png
    mosaic_deg: [[90, 45], [135, 0]]
mask: mask.png
dark: [dark_1.tif, dark_2.tif]
flat: flat.tif
linear: false
saturation: ~
metadata: {model: One, iso: 400, note: null}
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "capture.yaml"
    path.write_text(text)
    return path


def test_every_field(tmp_path: Path) -> None:
    capture = read_capture_yaml(write(tmp_path, WHOLE))
    assert (capture.wavelength_nm, capture.pixel_mm, capture.linear, capture.saturation) == (530.0, 0.02, False, None)
    first, second, third = capture.photos
    assert (first.file, first.polarizer_rad, first.exposure_s) == (tmp_path / "psi_000.tif", 0.0, None)
    assert (second.polarizer_rad, second.exposure_s) == (0.26179938779914943654, 0.5)
    assert third.polarizer_rad is None
    assert third.mosaic_rad == ((math.pi / 2, math.pi / 4), (3 * math.pi / 4, 0.0))
    assert third.where == f"{tmp_path}/capture.yaml:7"
    assert capture.mask == tmp_path / "mask.png"
    assert [p.name for p in (*capture.dark, *capture.flat)] == ["dark_1.tif", "dark_2.tif", "flat.tif"]
    assert capture.metadata == {"model": "One", "iso": "400", "note": "null"}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("pixel_mm", "pixle_mm", r"capture.yaml has no 'pixle_mm'[\s\S]*capture.yaml:3[\s\S]*mean 'pixel_mm'\?"),
        ("polarizer_deg: 15", "polariser_deg: 15", r"no 'polariser_deg'[\s\S]*yaml:6[\s\S]*mean 'polarizer_deg'\?"),
        ("polarizer_deg: 15", "polarizer_deg: east", r"'east' is no angle[\s\S]*yaml:6[\s\S]*degrees, such as 22.5"),
        ("polarizer_deg: 15", "polarizer_deg: .inf", r"'.inf' is no angle"),
        ("polarizer_deg: 15", "polarizer_deg: [15]", r"a list of 1 stands where one value is due[\s\S]*yaml:6"),
        (", polarizer_deg: 15", "", r"neither of polarizer_deg and mosaic_deg[\s\S]*yaml:6"),
        ("deg: 15", "deg: 15, mosaic_deg: [[0, 45], [90, 135]]", r"both of polarizer_deg and mosaic_deg"),
        ("[[90, 45], [135, 0]]", "[90, 45, 135, 0]", r"mosaic_deg is a list of 4[\s\S]*yaml:8[\s\S]*two rows of two"),
        ("file: raw.png\n", "exposure_s: 1\n", r"a photo lacks 'file'[\s\S]*yaml:7"),
        ("exposure_s: 0.5", "exposure_s: -1", r"'-1' is no positive number[\s\S]*yaml:6"),
        ("wavelength_nm: 530", "wavelength_nm: green", r"'green' is no positive number[\s\S]*yaml:2"),
        ("linear: false", "linear: maybe", r"'maybe' is neither true nor false[\s\S]*yaml:12"),
        ("linear: false", "mask: other.png", r"'mask' stands twice[\s\S]*yaml:12"),
        ("kind: polarizer_sequence", "kind: polarizer_sequenze", r"is no kind[\s\S]*mean 'polarizer_sequence'\?"),
        (
            "kind: polarizer_sequence",
            "kind: flash",
            r"'flash' cannot be replayed as[\s\S]*expected: polarizer_sequence",
        ),
        ("kind: polarizer_sequence", "", r"lacks 'kind'"),
        ("metadata: {model: One, iso: 400, note: null}", "metadata: One", r"metadata is 'One'[\s\S]*yaml:14"),
        ("metadata: {", "metadata: [", r"no valid YAML[\s\S]*capture.yaml:14"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert WHOLE.count(old) == 1
    with pytest.raises(InputErrors, match=message):
        read_capture_yaml(write(tmp_path, WHOLE.replace(old, new)))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"capture.yaml is empty"),
        ("photos", r"capture.yaml is 'photos'[\s\S]*a mapping with kind, photos"),
        ("kind: polarizer_sequence\nphotos: []", r"photos is a list of 0[\s\S]*yaml:2"),
        ("kind: !!python/object/apply:os.system [ls]\nphotos: []", r"a list of 1 stands where one value is due"),
    ],
)
def test_no_capture_at_all(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputErrors, match=message):
        read_capture_yaml(write(tmp_path, text))


def test_all_problems_are_told_at_once(tmp_path: Path) -> None:
    text = WHOLE.replace("pixel_mm", "pixle_mm").replace("linear: false", "linear: maybe")
    with pytest.raises(InputErrors) as caught:
        read_capture_yaml(write(tmp_path, text))
    assert [error.where.rpartition(":")[2] for error in caught.value.errors] == ["3", "12"]


def test_degrees_are_rounded_once() -> None:
    """pi/12 = 0.26179938779914943654 to the last bit, which np.deg2rad(15), a product of doubles, misses."""
    assert [radians_of(text) for text in ("45", "90.0", "180", "15")] == [
        math.pi / 4,
        math.pi / 2,
        math.pi,
        0.26179938779914943654,
    ]
    assert degrees_of(math.pi / 8) == "22.5"
    assert degrees_of(-math.pi) == "-180.0"
    np.testing.assert_allclose([radians_of(str(d)) for d in range(-360, 361)], np.deg2rad(range(-360, 361)), rtol=3e-16)


@given(st.floats(-1e300, 1e300))
def test_every_angle_has_a_decimal_in_degrees(radians: float) -> None:
    back = radians_of(degrees_of(radians))
    assert np.float64(back).tobytes() == np.float64(radians).tobytes()


@pytest.mark.parametrize(
    ("names", "angles"),
    [
        (["psi_000.tif", "psi_015.tif", "psi_-15.tif"], [0, 15, -15]),
        (["foo_0.png", "foo_45.png", "foo_90.png"], [0, 45, 90]),
        ([f"NIR_filtre_nir_{angle}_aligned.tif" for angle in (0, 45, 90, 135)], [0, 45, 90, 135]),
        (["IMG-pol22.5deg.tiff", "IMG-pol45deg.tiff"], [22.5, 45]),
        (["polarizer-45.png", "Angle=-30.png", "20200101_90 deg.jpg", "x_12,5°.dng"], [45, -30, 90, 12.5]),
        (["0deg.tif", "-30deg.tif", "-60.5deg.tif"], [0, -30, -60.5]),
        (["IMG_0001_0deg.tif", "IMG_0002_45deg.tif"], [0, 45]),
        (["run2_0.tif", "run2_22.5.tif", "run2_45.tif"], [0, 22.5, 45]),
    ],
)
def test_angles_in_names(names: list[str], angles: list[float], tmp_path: Path) -> None:
    assert [float(text) for text in angles_from_names(names, tmp_path)] == angles


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["IMG_0001.CR2", "IMG_0002.CR2", "IMG_0003.CR2"], "look like a counter"),
        (["IMG_0340.CR2", "IMG_0350.CR2", "IMG_0360.CR2"], "look like a counter"),
        (["IMG_0012.CR2", "IMG_0017.CR2", "IMG_0019.CR2"], "look like a counter"),
        (["IMG_0100.CR2", "IMG_0102.CR2", "IMG_0104.CR2"], "look like a counter"),
        (["IMG_0001_0.tif", "IMG_0002_45.tif", "IMG_0003_90.tif"], "differ in 2 numbers"),
        (["a.tif", "b.tif", "c.tif"], "are not alike: a.tif, b.tif, c.tif"),
        (["psi_0.tif", "psi_45.tif", "overview.tif"], "'overview.tif' has no number that a word tags"),
        (["psi_0_pol45.tif", "psi_1.tif"], "'psi_0_pol45.tif' has 2 numbers that a word tags"),
        (["scene.tif"], "differ in no numbers"),
    ],
)
def test_doubtful_names_are_refused(names: list[str], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputErrors, match=rf"no capture.yaml, and [\s\S]*{message}[\s\S]*expected: one angle in each"):
        angles_from_names(names, tmp_path)


def test_a_folder_without_capture_yaml(tmp_path: Path) -> None:
    for name in (
        "psi_090.tif",
        "psi_000.tif",
        "psi_045.tif",
        "mask.png",
        "dark_1.tif",
        "flat1.tif",
        "notes.txt",
        ".x.tif",
    ):
        (tmp_path / name).touch()
    capture = capture_from_names(tmp_path, {".tif", ".png"})
    assert [p.file.name for p in capture.photos] == ["psi_000.tif", "psi_045.tif", "psi_090.tif"]
    np.testing.assert_allclose([p.polarizer_rad for p in capture.photos], np.deg2rad([0, 45, 90]))
    assert capture.mask == tmp_path / "mask.png"
    assert (capture.dark, capture.flat) == ((tmp_path / "dark_1.tif",), (tmp_path / "flat1.tif",))
    (tmp_path / "mask2.png").touch()
    with pytest.raises(InputErrors, match=r"several masks: mask.png, mask2.png"):
        capture_from_names(tmp_path, {".tif", ".png"})


def test_a_folder_without_photographs(tmp_path: Path) -> None:
    with pytest.raises(InputErrors, match=r"the folder is empty[\s\S]*capture.yaml or with their angles"):
        capture_from_names(tmp_path, {".tif"})
    (tmp_path / "capture.yml").touch()
    with pytest.raises(InputErrors, match=r"no photo among the 1 files[\s\S]*psi_015"):
        capture_from_names(tmp_path, {".tif"})
