"""Height maps from pictures, arrays, instruments' files and folders."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from photo_makers import write_image

from pipeline.errors import InputError, InputErrors
from pipeline.report.exr import write_exr
from pipeline.stages.capture.height_map import height_map

RAMP = np.arange(30.0).reshape(5, 6)


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int16])
def test_an_array_holds_micrometres(tmp_path: Path, kind: type) -> None:
    np.save(tmp_path / "map.npy", RAMP.astype(kind))
    read = height_map(file=tmp_path / "map.npy", pitch_um=0.05, periodic=True, caption="A ramp")
    np.testing.assert_array_equal(read.height_um, RAMP)
    assert read.height_um.dtype == np.float32
    assert (read.pitch_um, read.periodic, read.caption) == (0.05, True, "A ramp")


@pytest.mark.parametrize(("kind", "full"), [(np.uint8, 255), (np.uint16, 65535)])
def test_grey_is_a_share_of_the_full_height(tmp_path: Path, kind: type, full: int) -> None:
    grey = np.linspace(0, full, 30).reshape(5, 6).astype(kind)
    write_image(tmp_path / "map.png", grey)
    read = height_map(file=tmp_path / "map.png", pitch_um=0.05, full_height_um=0.375)
    np.testing.assert_allclose(read.height_um, 0.375 * grey / full, rtol=1e-6)
    write_image(tmp_path / "colour.png", np.repeat(grey[..., None], 3, axis=2))
    same = height_map(file=tmp_path / "colour.png", pitch_um=0.05, full_height_um=0.375)
    np.testing.assert_array_equal(same.height_um, read.height_um)


def test_floating_point_pictures_hold_micrometres_unless_a_full_height_is_told(tmp_path: Path) -> None:
    write_image(tmp_path / "map.tif", RAMP.astype(np.float32))
    np.testing.assert_array_equal(height_map(file=tmp_path / "map.tif", pitch_um=1).height_um, RAMP)
    shares = height_map(file=tmp_path / "map.tif", pitch_um=1, full_height_um=0.5).height_um
    np.testing.assert_array_equal(shares, RAMP / 2)


def test_what_the_report_writes_is_read_back_with_its_pitch(tmp_path: Path) -> None:
    height = np.where(RAMP == 7, np.nan, RAMP).astype(np.float32)
    write_exr(tmp_path / "surface.exr", {"height_um": height}, {"pitch_um": 0.065})
    read = height_map(file=tmp_path / "surface.exr")
    np.testing.assert_array_equal(read.height_um, height)
    assert read.pitch_um == 0.065
    assert height_map(file=tmp_path / "surface.exr", pitch_um=0.1).pitch_um == 0.1


def instrument_file(path: Path, heights_nm: np.ndarray, size_nm: tuple[float, float]) -> Path:
    """Write heights, row 0 on top, by the package that others read them with."""
    topography = pytest.importorskip("SurfaceTopography").Topography(heights_nm.T, size_nm, unit="nm")
    getattr(topography, f"to_{path.suffix[1:]}")(str(path))
    return path


@pytest.mark.parametrize("suffix", [".gwy", ".x3p"])
def test_an_instruments_file_states_lengths_and_heights(tmp_path: Path, suffix: str) -> None:
    file = instrument_file(tmp_path / f"scan{suffix}", RAMP, (600.0, 500.0))
    read = height_map(file=file)
    np.testing.assert_allclose(read.height_um, RAMP / 1000, rtol=1e-6)
    assert read.pitch_um == pytest.approx(0.1, rel=1e-12)


def test_rows_of_gwyddion_begin_at_the_top(tmp_path: Path) -> None:
    """A data field of Gwyddion is stored row by row from the top, as its manual says of ``GwyDataField``."""
    stored = instrument_file(tmp_path / "scan.gwy", RAMP, (600.0, 500.0)).read_bytes()
    start = stored.index(b"data\0D") + len(b"data\0D") + 4
    first_row = np.frombuffer(stored[start : start + 48], "<f8")
    np.testing.assert_allclose(first_row * 1e6, height_map(file=tmp_path / "scan.gwy").height_um[0], rtol=1e-6)


def test_pixels_that_are_not_square_become_so(tmp_path: Path) -> None:
    """Columns 0.1 um apart, rows 0.2: a smooth surface comes back at 0.1 both ways."""

    def surface(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 100 * np.sin(2 * np.pi * x / 3000 + 0.4) * np.cos(2 * np.pi * y / 4000)

    x, y = np.arange(60) * 100.0, np.arange(40)[:, None] * 200.0
    read = height_map(file=instrument_file(tmp_path / "scan.gwy", surface(x, y), (6000.0, 8000.0)))
    assert (read.height_um.shape, read.pitch_um) == ((79, 60), pytest.approx(0.1))
    expected = surface(x, np.arange(79)[:, None] * 100.0) / 1000
    np.testing.assert_allclose(read.height_um, expected, atol=3e-5)


def test_a_folder_says_what_its_map_is(tmp_path: Path) -> None:
    write_image(tmp_path / "map.png", np.uint8(RAMP))
    (tmp_path / "capture.yaml").write_text(
        "kind: height_field\nfile: map.png\npitch_um: 0.065\nfull_height_um: 0.51\nperiodic: true\ncaption: A ramp\n"
    )
    read = height_map(file=tmp_path)
    np.testing.assert_allclose(read.height_um, RAMP * 0.002, rtol=1e-6)
    assert (read.pitch_um, read.periodic, read.caption) == (0.065, True, "A ramp")
    assert height_map(file=tmp_path, pitch_um=0.1).pitch_um == 0.1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("kind: flash\nfile: map.png", r"'flash' is no height map\s+where: .*capture.yaml:1\s+expected: height_field"),
        ("kind: height_field", r"lacks 'file'"),
        (
            "kind: height_field\nfile: map.png\npitch: 1",
            r"no 'pitch'\s+where: .*:3\s[\s\S]*did you mean 'pitch_um'",
        ),
        ("kind: height_field\nfile: map.png\npitch_um: -1", r"'-1' is no positive number\s+where: .*:3"),
        ("kind: height_field\nfile: mop.npy\npitch_um: 1", r"no file mop.npy[\s\S]*did you mean 'map.npy'"),
        ("", r"capture.yaml is empty"),
    ],
)
def test_a_folder_that_says_something_wrong_is_refused(tmp_path: Path, text: str, message: str) -> None:
    np.save(tmp_path / "map.npy", RAMP)
    (tmp_path / "capture.yaml").write_text(text)
    with pytest.raises((InputError, InputErrors), match=message):
        height_map(file=tmp_path)


def test_what_cannot_be_a_height_map_is_refused(tmp_path: Path) -> None:
    def refused(name: str, message: str, **settings: object) -> None:
        with pytest.raises(InputError, match=message):
            height_map(file=tmp_path / name, **{"pitch_um": 0.1, **settings})

    np.save(tmp_path / "map.npy", RAMP)
    np.save(tmp_path / "cube.npy", np.zeros((2, 3, 4)))
    np.save(tmp_path / "complex.npy", np.zeros((3, 4), complex))
    np.save(tmp_path / "unknown.npy", np.full((3, 4), np.nan))
    (tmp_path / "torn.npy").write_bytes((tmp_path / "map.npy").read_bytes()[:200])
    colour = np.zeros((4, 4, 3), np.uint8)
    colour[1, 2, 0] = 9
    write_image(tmp_path / "colour.png", colour)
    write_image(tmp_path / "grey.png", colour[..., 0])
    refused("mop.npy", r"there is no file mop.npy[\s\S]*did you mean 'map.npy'")
    refused("map.npy", r"map.npy does not say how far[\s\S]*where: +pitch_um", pitch_um=None)
    refused("map.npy", r"pitch_um is 0\s+where: +pitch_um\s+expected: a number above 0", pitch_um=0.0)
    refused("map.npy", r"full_height_um is 1, but an array holds heights", full_height_um=1.0)
    refused("cube.npy", r"an array of 2 x 3 x 4\s")
    refused("complex.npy", r"an array of complex128\s[\s\S]*expected: heights in um")
    refused("unknown.npy", r"no height is known")
    refused("torn.npy", r"the array cannot be read")
    refused("colour.png", r"a picture in colour\s[\s\S]*expected: grey", full_height_um=1.0)
    refused("grey.png", r"grey.png holds shares of a height that is not told\s+where: +full_height_um")
    refused("", r"the folder has no capture.yaml")


def test_what_an_instruments_file_lacks_is_told(tmp_path: Path) -> None:
    file = instrument_file(tmp_path / "scan.gwy", RAMP, (600.0, 500.0))
    with pytest.raises(InputError, match=r"no channel 'Topo'\s[\s\S]*hint: +did you mean 'Topography'"):
        height_map(file=file, channel="Topo")
    with pytest.raises(InputError, match=r"full_height_um is 1, but scan.gwy states its heights"):
        height_map(file=file, full_height_um=1.0)
    (tmp_path / "other.gwy").write_bytes(b"not a scan")
    with pytest.raises(InputError, match=r"other.gwy is of no known format"):
        height_map(file=tmp_path / "other.gwy")
    file.write_bytes(file.read_bytes()[:150])
    with pytest.raises(InputError, match=r"the scan is damaged or cannot be read|of no known format"):
        height_map(file=file)


def test_without_the_package_the_command_that_installs_it_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "scan.gwy").write_bytes(b"GWYP")
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    with pytest.raises(InputError, match=r"needs the package SurfaceTopography[\s\S]*pip install 'optibench\[surfaces"):
        height_map(file=tmp_path / "scan.gwy")


@pytest.mark.parametrize(
    ("name", "full_height_um", "shape", "levels"),
    [
        ("Elaph100x100.png", 0.375, (100, 100), (21, 244)),
        ("Xeno100x100.png", 0.44345, (100, 100), (66, 250)),
        ("BlazingBump.bmp", 0.246, (100, 100), (0, 255)),
        ("Elaphe65microns.png", 0.375, (1332, 1332), (0, 255)),
        ("Xenopeltis65microns.png", 0.81869, (1332, 1332), (0, 252)),
    ],
)
def test_real_maps_are_read(
    measurements: Path, name: str, full_height_um: float, shape: tuple[int, int], levels: tuple[int, int]
) -> None:
    read = height_map(file=measurements / "afm" / name, pitch_um=0.065, full_height_um=full_height_um)
    assert read.height_um.shape == shape
    ends = np.array([read.height_um.min(), read.height_um.max()]) / full_height_um * 255
    np.testing.assert_allclose(ends, levels, atol=1e-3)


def test_the_documented_folder_is_read(tmp_path: Path) -> None:
    page = Path(__file__).resolve().parents[2] / "docs" / "height-fields.md"
    (block,) = re.findall(r"```yaml\n(kind: height_field.*?)```", page.read_text(), re.DOTALL)
    (tmp_path / "capture.yaml").write_text(block)
    write_image(tmp_path / "scan.png", np.full((3, 4), 255, np.uint8))
    read = height_map(file=tmp_path)
    assert (read.height_um.max(), read.pitch_um, read.caption) == (np.float32(0.375), 0.0488, "a shed skin")


@pytest.mark.parametrize(("scale", "told"), [(1.0, False), (1e-6, True), (1e3, True), (0.0, False)])
def test_heights_in_another_unit_are_warned_of(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, scale: float, told: bool
) -> None:
    np.save(tmp_path / "map.npy", 0.01 * RAMP * scale)
    height_map(file=tmp_path / "map.npy", pitch_um=0.05)
    assert ("are heights and pitch both in um?" in caplog.text) == told


@pytest.mark.parametrize("name", ["map.txt", "map.npz"])
def test_a_table_of_numbers_is_told_to_be_saved_with_units(tmp_path: Path, name: str) -> None:
    pytest.importorskip("SurfaceTopography")
    np.savetxt(tmp_path / "map.txt", np.random.default_rng(0).normal(size=(50, 50)))
    np.savez(tmp_path / "map.npz", h=np.zeros((50, 50)))
    with pytest.raises(InputError, match=r"does not say how large its map is[\s\S]*np.save"):
        height_map(file=tmp_path / name, pitch_um=0.05)
