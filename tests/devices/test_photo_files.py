"""Photographs of every kind come in linear, whole or not at all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from photo_makers import write_dng, write_image

from pipeline.data.photographs import Photo
from pipeline.devices.photo_files import channel_of, read_photo, readable_suffixes
from pipeline.errors import InputError

RAMP = np.arange(60 * 80).reshape(60, 80)
SMOOTH = (np.add.outer(np.arange(60), np.arange(80)) + 60).astype(np.uint8)

LARGE = np.tile(SMOOTH, (4, 4))


def test_integers_are_scaled_to_full_scale_one(tmp_path: Path) -> None:
    pixels = np.array([[0, 1, 32768, 65534, 65535]], np.uint16)
    photo = read_photo(write_image(tmp_path / "a.tif", pixels))
    assert photo.image.dtype == np.float32
    np.testing.assert_array_equal(photo.image, (pixels / 65535).astype(np.float32))
    np.testing.assert_array_equal(photo.saturated, [[False, False, False, False, True]])


@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.jxl", "a.pgm"])
def test_formats_of_a_bench_are_linear_whatever_their_tags_say(tmp_path: Path, name: str) -> None:
    """JPEG XL is written with loss here; decoding as sRGB would take 188 of 255 from 0.737 to 0.503."""
    photo = read_photo(write_image(tmp_path / name, LARGE))
    np.testing.assert_allclose(photo.image, LARGE / 255, atol=4 / 255 if name == "a.jxl" else 1e-6)


def test_floats_are_kept_bit_for_bit(tmp_path: Path) -> None:
    pixels = np.array([[np.nan, np.inf, -0.0, 1e-40, 1.0, 7.5]], np.float32)
    for name in ("a.tif", "a.exr"):
        photo = read_photo(write_image(tmp_path / name, pixels))
        np.testing.assert_array_equal(photo.image.view(np.uint32), pixels.view(np.uint32), err_msg=name)
        assert not photo.saturated.any()


def test_floats_with_a_stated_saturation_are_scaled_to_it(tmp_path: Path) -> None:
    path = write_image(tmp_path / "a.exr", np.array([[1000, 4000, 4095]], np.float32))
    photo = read_photo(path, saturation=4000)
    np.testing.assert_array_equal(photo.image, np.float32([[0.25, 1, 4095 / 4000]]))
    np.testing.assert_array_equal(photo.saturated, [[False, True, True]])


def test_integers_with_a_stated_saturation_are_scaled_to_it(tmp_path: Path) -> None:
    """14 bits in a file of 16: the level as a number, or as the share of the largest one."""
    path = write_image(tmp_path / "a.tif", np.array([[4096, 16383, 65535]], np.uint16))
    for saturation in (16383, 16383 / 65535):
        photo = read_photo(path, saturation=saturation)
        np.testing.assert_allclose(photo.image, np.float32([[4096 / 16383, 1, 65535 / 16383]]), rtol=1e-6)
        np.testing.assert_array_equal(photo.saturated, [[False, True, True]])


def test_a_gif_has_three_channels(tmp_path: Path) -> None:
    path = write_image(tmp_path / "a.gif", np.zeros((6, 8, 3), np.uint8))
    assert read_photo(path).image.shape == (6, 8, 3)


def test_jpeg_is_decoded_from_srgb(tmp_path: Path) -> None:
    """IEC 61966-2-1: 188 of 255 is a linear 0.503, 10 of 255 lies on the straight part."""
    for level, linear in ((0, 0.0), (10, 10 / 255 / 12.92), (188, 0.502886), (255, 1.0)):
        path = write_image(tmp_path / "a.jpg", np.full((16, 16), level, np.uint8), CompressionQuality=100)
        photo = read_photo(path)
        np.testing.assert_allclose(photo.image, linear, atol=1e-5)
        assert photo.saturated.all() == (level == 255)
        np.testing.assert_allclose(read_photo(path, linear=True).image, level / 255, atol=1e-6)
    path = write_image(tmp_path / "a.png", np.full((2, 2), 188, np.uint8))
    np.testing.assert_allclose(read_photo(path, linear=False).image, 0.502886, atol=1e-5)


@pytest.mark.parametrize(("colour", "shape"), [(True, (64, 96, 3)), (False, (64, 96))])
@pytest.mark.parametrize("level", [64, 1000, 2080, 4094, 4095])
def test_camera_raw_is_black_subtracted_and_linear(
    tmp_path: Path, level: int, colour: bool, shape: tuple[int, ...]
) -> None:
    """An even frame: (level - black) / (white - black), whatever else is in the picture, and no white balance."""
    photo = read_photo(write_dng(tmp_path / "a.dng", np.full((64, 96), level), colour=colour))
    assert photo.image.shape == shape
    np.testing.assert_allclose(photo.image, (level - 64) / (4095 - 64), atol=1 / 65535)
    assert photo.saturated.all() == (level == 4095)
    assert photo.exposure_s == 0.005
    assert photo.metadata["model"] == "Bench One"


def test_camera_raw_does_not_scale_by_the_brightest_pixel(tmp_path: Path) -> None:
    """LibRaw lowers the white level to a frame's maximum unless told not to; two frames would differ by it."""
    frame = np.full((64, 96), 1000)
    frame[20:40, 20:40] = 3500
    photo = read_photo(write_dng(tmp_path / "a.dng", frame, colour=False))
    np.testing.assert_allclose(photo.image, (frame - 64) / (4095 - 64), atol=1 / 65535)


def test_what_the_camera_says_is_kept(tmp_path: Path) -> None:
    path = write_image(
        tmp_path / "a.jpg", SMOOTH, ExposureTime=0.125, Make="Acme", Model="One", FNumber=5.6, Exif__ISOSpeedRatings=400
    )
    photo = read_photo(path)
    assert photo.exposure_s == 0.125
    assert photo.metadata == {"make": "Acme", "model": "One", "iso": "400", "aperture": "5.6"}


def test_an_orientation_tag_is_obeyed(tmp_path: Path) -> None:
    """Exif: 6 is a camera held on its left side, to be displayed turned clockwise; 3 upside down; 2 mirrored."""
    stored = np.array([[1, 2, 3], [4, 5, 6]], np.uint8) * 40
    displayed = {
        1: stored,
        2: stored[:, ::-1],
        3: stored[::-1, ::-1],
        4: stored[::-1],
        5: stored.T,
        6: np.rot90(stored, -1),
        7: np.rot90(stored, 2).T,
        8: np.rot90(stored),
    }
    for tag, expected in displayed.items():
        photo = read_photo(write_image(tmp_path / "a.tif", stored, Orientation=tag))
        np.testing.assert_allclose(photo.image, expected / 255, atol=1e-6, err_msg=f"orientation {tag}")


def test_transparency_is_dropped_without_touching_the_signal(tmp_path: Path) -> None:
    pixels = np.dstack([SMOOTH, SMOOTH // 2, SMOOTH // 3, np.full_like(SMOOTH, 100)])
    photo = read_photo(write_image(tmp_path / "a.png", pixels, oiio__UnassociatedAlpha=1))
    np.testing.assert_allclose(photo.image, pixels[..., :3] / 255, atol=1e-6)


def damaged(path: Path, keep: float) -> Path:
    data = path.read_bytes()
    path.write_bytes(data[: min(int(len(data) * keep), len(data) - 1)])
    return path


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("keep", [0.0, 0.02, 0.5, 0.9, 1.0])
@pytest.mark.parametrize(
    ("name", "pixels"),
    [
        ("a.png", SMOOTH),
        ("b.png", RAMP.astype(np.uint16)),
        ("a.tif", RAMP.astype(np.uint16)),
        ("f.tif", RAMP.astype(np.float32)),
        ("a.exr", RAMP.astype(np.float32)),
        ("a.jpg", SMOOTH),
        ("a.jxl", LARGE),
        ("a.dng", RAMP),
    ],
)
def test_a_truncated_photo_is_refused(tmp_path: Path, name: str, pixels: NDArray, keep: float) -> None:
    """From a file that lost all to one that lost its last byte."""
    path = tmp_path / name
    whole = write_dng(path, pixels, colour=False) if name == "a.dng" else write_image(path, pixels)
    read_photo(whole)
    with pytest.raises(InputError, match=rf"the photo is truncated|cannot be read[\s\S]*{name}"):
        read_photo(damaged(path, keep))


def test_a_tiff_whose_directory_comes_first_is_noticed_too(tmp_path: Path) -> None:
    """As libtiff's streams and some cameras write it: what is lost then is the end of the pixels."""
    path = write_dng(tmp_path / "a.dng", RAMP, colour=False)
    data = bytearray(path.read_bytes())
    pixels, start = data[8 : 8 + 2 * RAMP.size], 8 + 2 * RAMP.size
    shift = len(data) - start
    directory = bytes(data[start:])
    moved = bytearray(directory)
    for entry in range(2, 2 + 12 * int.from_bytes(directory[:2], "little"), 12):
        tag = int.from_bytes(directory[entry : entry + 2], "little")
        kind, count = int.from_bytes(directory[entry + 2 : entry + 4], "little"), directory[entry + 4]
        place = int.from_bytes(directory[entry + 8 : entry + 12], "little")
        if tag == 273:
            moved[entry + 8 : entry + 12] = (8 + shift).to_bytes(4, "little")
        elif {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 10: 8}[kind] * count > 4:
            moved[entry + 8 : entry + 12] = (place - start + 8).to_bytes(4, "little")
    data[4:] = (8).to_bytes(4, "little") + moved + pixels
    path.write_bytes(data)
    np.testing.assert_allclose(read_photo(path).image[0, 79], (79 - 64) / (4095 - 64), atol=1 / 65535)
    path.write_bytes(data[:-1])
    with pytest.raises(InputError, match=r"truncated[\s\S]*a\.dng"):
        read_photo(path)


def test_what_is_no_photo_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("psi_000 was blurred")
    (tmp_path / "fake.png").write_text("no picture at all")
    (tmp_path / "fake.dng").write_text("no picture at all")
    for name in ("notes.txt", "fake.png", "fake.dng"):
        with pytest.raises(InputError, match=rf"cannot be read: .+[\s\S]*{name}"):
            read_photo(tmp_path / name)
    with pytest.raises(InputError, match=r"no photo fak\.png[\s\S]*did you mean 'fake\.png'"):
        read_photo(tmp_path / "fak.png")


def test_channels_that_are_no_colours_are_refused(tmp_path: Path) -> None:
    path = write_image(tmp_path / "a.exr", np.zeros((4, 4, 5), np.float32))
    with pytest.raises(InputError, match=r"has the channels .*[\s\S]*grey or red, green, blue"):
        read_photo(path)


def test_one_channel_of_a_colour_photo() -> None:
    image = np.float32([[[1.0, 0.5, 0.25], [0.2, 1.0, 0.1]]])
    photo = Photo(image, np.array([[True, True]]), 0.1, {"model": "One"})
    red, green, blue = (channel_of(photo, name) for name in ("red", "green", "blue"))
    np.testing.assert_array_equal(green.image, np.float32([[0.5, 1.0]]))
    np.testing.assert_array_equal([red.saturated, green.saturated, blue.saturated], [[[1, 0]], [[0, 1]], [[0, 0]]])
    assert (green.exposure_s, green.metadata) == (0.1, {"model": "One"})
    luminance = channel_of(photo, "luminance")
    np.testing.assert_allclose(luminance.image, [[0.58825, 0.76494]], atol=1e-5)
    np.testing.assert_array_equal(luminance.saturated, [[True, True]])
    for wavelength, same in ((None, green), (450.0, blue), (530.0, green), (632.8, red)):
        np.testing.assert_array_equal(channel_of(photo, wavelength_nm=wavelength).image, same.image)


def test_a_grey_photo_has_one_channel() -> None:
    photo = Photo(np.zeros((2, 2), np.float32), np.zeros((2, 2), bool))
    assert channel_of(photo, "red") is photo


def test_real_photographs(measurements: Path) -> None:
    """Sixteen bits, near infrared: the file's own integers over 65535."""
    photo = read_photo(measurements / "polarization" / "glass" / "NIR_filtre_nir_0_aligned.tif")
    assert photo.image.shape == (768, 1024)
    steps = photo.image.astype(np.float64) * 65535
    np.testing.assert_allclose(steps, np.round(steps), atol=0.01)
    assert 0.1 < photo.image.mean() < 0.9


def test_endings_of_photographs() -> None:
    assert {".tif", ".png", ".exr", ".jxl", ".jpg", ".dng", ".cr2", ".nef", ".arw"} <= readable_suffixes()
    assert ".yaml" not in readable_suffixes()
