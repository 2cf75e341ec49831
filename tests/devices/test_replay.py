"""A folder of photographs stands in for a rig: same photographs, same angles, and nothing wrong goes unnoticed."""

from __future__ import annotations

import logging
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import polanalyser
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.typing import NDArray
from photo_makers import write_image

from pipeline.data.gratings import GratingSample
from pipeline.data.photographs import PolarizerSequence
from pipeline.devices.photo_folder_writer import write_polarizer_sequence
from pipeline.devices.protocols import Camera, PolarizationRig, RotationMount
from pipeline.devices.replay import PhotoFolder
from pipeline.errors import DeviceError, InputError, InputErrors
from pipeline.optics.angles import axial_difference, axial_median
from pipeline.stages.capture.polarizer_sequence import polarizer_sequence
from pipeline.storage.keys import digest

ROWS, COLUMNS = 6, 8
ANGLES = (0.0, 45.0, 90.0, 135.0)


def scene(seed: int) -> NDArray:
    return np.random.default_rng(seed).integers(1000, 60000, (ROWS, COLUMNS)).astype(np.uint16)


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    """Four photographs, psi_000.tif to psi_135.tif, and their capture.yaml."""
    folder = tmp_path / "photos"
    folder.mkdir()
    for seed, angle in enumerate(ANGLES):
        write_image(folder / f"psi_{angle:03.0f}.tif", scene(seed), ExposureTime=0.125, Model="One")
    describe(folder)
    return folder


def describe(folder: Path, *, repeats: tuple[dict[str, Any], ...] = (), **more: Any) -> None:
    """Write capture.yaml for the four photographs."""
    listed = [{"file": f"psi_{angle:03.0f}.tif", "polarizer_deg": angle} for angle in ANGLES]
    content = {"kind": "polarizer_sequence", "photos": [*listed, *repeats], **more}
    (folder / "capture.yaml").write_text(yaml.safe_dump(content))


def replay(folder: Path, **settings: Any) -> PolarizerSequence:
    rig = PhotoFolder(folder=folder, **settings)
    rig.check()
    return polarizer_sequence(rig=rig)


def refused(folder: Path, message: str) -> None:
    with pytest.raises((InputError, InputErrors), match=message):
        PhotoFolder(folder=folder).check()


def test_it_is_a_rig(photos: Path) -> None:
    rig = PhotoFolder(folder=photos)
    assert isinstance(rig, PolarizationRig)
    assert isinstance(rig.camera, Camera)
    assert isinstance(rig.mount, RotationMount)


def test_what_was_recorded_comes_out(photos: Path) -> None:
    describe(photos, wavelength_nm=530, pixel_mm=0.02)
    sequence = replay(photos)
    np.testing.assert_array_equal(sequence.images, [(scene(s) / 65535).astype(np.float32) for s in range(4)])
    np.testing.assert_array_equal(sequence.polarizer_rad, np.pi * np.arange(4) / 4)
    assert sequence.valid.all()
    assert sequence.exposure_s == (0.125,) * 4
    assert (sequence.wavelength_nm, sequence.pixel_mm, dict(sequence.metadata)) == (530.0, 0.02, {"model": "One"})
    stated = replay(photos, wavelength_nm=633.0, pixel_mm=0.5)
    assert (stated.wavelength_nm, stated.pixel_mm) == (633.0, 0.5)


def test_names_stand_in_for_capture_yaml(photos: Path, caplog: pytest.LogCaptureFixture) -> None:
    described = replay(photos)
    (photos / "capture.yaml").unlink()
    with caplog.at_level(logging.INFO):
        assert digest(replay(photos)) == digest(described)
    assert "read from the names of the files: psi_000.tif 0, psi_045.tif 45, psi_090.tif 90" in caplog.text


def test_the_mount_goes_only_where_photographs_were_taken(photos: Path) -> None:
    rig = PhotoFolder(folder=photos)
    with rig:
        assert rig.mount.move_to(np.pi / 4) == np.pi / 4
        np.testing.assert_array_equal(rig.camera.expose().image, (scene(1) / 65535).astype(np.float32))
        with pytest.raises(DeviceError, match=r"no photograph at 50 degrees; the nearest is at 45"):
            rig.mount.move_to(np.deg2rad(50))


def test_no_virtual_sample_lies_before_a_replay(photos: Path) -> None:
    empty = np.zeros((1, 1), np.float32)
    sample = GratingSample(empty, empty, 0.02, 0.1, 0.9, 0.1, 0.0, 0.0, 0.1, "a logo")
    rig = PhotoFolder(folder=photos)
    rig.place(None)
    with pytest.raises(InputError, match=r"'a logo' cannot be placed before a replay"):
        rig.place(sample)


def test_dark_frames_and_flat_fields(photos: Path) -> None:
    """(photo - dark) / flat brings back the scene that vignetting and an offset hid."""
    row, column = np.mgrid[0:ROWS, 0:COLUMNS]
    vignette = 1 - 0.05 * ((row - 2.5) ** 2 + (column - 3.5) ** 2) / 18
    vignette /= vignette.mean()
    truth = [0.1 + 0.5 * np.random.default_rng(seed).random((ROWS, COLUMNS)) for seed in range(4)]
    for angle, light in zip(ANGLES, truth, strict=True):
        write_image(photos / f"psi_{angle:03.0f}.tif", (light * vignette + 0.05).astype(np.float32))
    for name, level in (("dark_1.tif", 0.04), ("dark_2.tif", 0.06)):
        write_image(photos / name, np.full((ROWS, COLUMNS), level, np.float32))
    flat = (0.7 * vignette + 0.05).astype(np.float32)
    write_image(photos / "flat.tif", flat)
    describe(photos, dark=["dark_1.tif", "dark_2.tif"], flat=["flat.tif"])
    np.testing.assert_allclose(replay(photos).images, truth, rtol=1e-5)

    flat[1, 2], flat[3, 4] = np.nan, 0.05
    write_image(photos / "flat.tif", flat)
    sequence = replay(photos)
    assert np.argwhere(~sequence.valid).tolist() == [[1, 2], [3, 4]]
    assert np.isfinite(sequence.images).all()


def test_a_mask_leaves_out_pixels(photos: Path) -> None:
    mask = np.full((ROWS, COLUMNS), 255, np.uint8)
    mask[:2] = 0
    write_image(photos / "mask.png", mask)
    describe(photos, mask="mask.png")
    np.testing.assert_array_equal(replay(photos).valid, mask > 0)


def test_saturated_pixels_are_left_out_and_told(photos: Path, caplog: pytest.LogCaptureFixture) -> None:
    burnt = scene(1)
    burnt[2, 3:5] = 65535
    write_image(photos / "psi_045.tif", burnt)
    sequence = replay(photos)
    assert np.argwhere(~sequence.valid).tolist() == [[2, 3], [2, 4]]
    (warning,) = [r.getMessage() for r in caplog.records if r.levelno >= logging.WARNING]
    assert warning == "saturated pixels, which are left out: psi_045.tif 4.2 %"
    caplog.clear()
    replay(photos, saturation_warning=0.05)
    assert not [r for r in caplog.records if r.levelno >= logging.WARNING]
    with pytest.raises(InputError, match=r"saturation_warning is 5[\s\S]*expected: 0 to 1"):
        PhotoFolder(folder=photos, saturation_warning=5).check()


def test_colour_photographs(photos: Path) -> None:
    colours = [np.dstack([scene(s), scene(s + 10), scene(s + 20)]) for s in range(4)]
    for angle, pixels in zip(ANGLES, colours, strict=True):
        write_image(photos / f"psi_{angle:03.0f}.tif", pixels)
    for settings_, channel in (({}, 1), ({"wavelength_nm": 633.0}, 0), ({"channel": "blue"}, 2)):
        np.testing.assert_allclose(
            replay(photos, **settings_).images, np.stack(colours)[..., channel] / 65535, rtol=1e-6
        )


def test_jpeg_is_decoded_with_a_warning(photos: Path, caplog: pytest.LogCaptureFixture) -> None:
    for angle in ANGLES:
        (photos / f"psi_{angle:03.0f}.tif").unlink()
        write_image(photos / f"psi_{angle:03.0f}.jpg", np.full((8, 8), 188, np.uint8), CompressionQuality=100)
    (photos / "capture.yaml").unlink()
    np.testing.assert_allclose(replay(photos).images, 0.502886, atol=1e-5)
    assert "psi_000.jpg and 3 more decoded as sRGB" in caplog.text


def test_a_repeat_of_the_same_photo_is_dropped(photos: Path, caplog: pytest.LogCaptureFixture) -> None:
    once = replay(photos)
    write_image(photos / "again.png", scene(1))
    describe(photos, repeats=({"file": "again.png", "polarizer_deg": 45},))
    with caplog.at_level(logging.INFO):
        assert digest(replay(photos)) == digest(once)
    assert "again.png repeats psi_045.tif and is left out" in caplog.text


def test_half_a_turn_on_is_another_measurement(photos: Path) -> None:
    write_image(photos / "again.tif", scene(9))
    describe(photos, repeats=({"file": "again.tif", "polarizer_deg": 180, "exposure_s": 0.125},))
    sequence = replay(photos)
    np.testing.assert_array_equal(sequence.polarizer_rad, np.pi * np.arange(5) / 4)
    assert sequence.exposure_s == (0.125,) * 5


def test_photographs_of_other_exposures_are_scaled_to_the_first(photos: Path, caplog: pytest.LogCaptureFixture) -> None:
    plain = replay(photos)
    write_image(photos / "psi_045.tif", (scene(1) // 2).astype(np.uint16), ExposureTime=0.0625, Model="One")
    scaled = replay(photos)
    assert "The exposures differ, 0.0625 to 0.125 s" in caplog.text
    np.testing.assert_allclose(scaled.images, plain.images, atol=2e-5)
    assert scaled.exposure_s == (0.125,) * 4


@pytest.mark.parametrize("name", ["../elsewhere.tif", "/tmp/elsewhere.tif", ".raw/a.tif", ".hidden.tif", "x" * 300])
def test_files_whose_change_would_go_unnoticed(photos: Path, name: str) -> None:
    describe(photos, repeats=({"file": name, "polarizer_deg": 90.0},))
    refused(photos, r"is hidden or lies outside the folder|longer than any file system takes")


def test_a_description_nested_without_end(photos: Path) -> None:
    (photos / "capture.yaml").write_text("[" * 5000)
    refused(photos, r"no valid YAML[\s\S]*capture.yaml")


def test_an_angle_stated_for_two_photographs(photos: Path) -> None:
    write_image(photos / "again.tif", scene(9))
    describe(photos, repeats=({"file": "again.tif", "polarizer_deg": 45.0},))
    refused(photos, r"again.tif and psi_045.tif differ, but both are stated at 45 degrees[\s\S]*capture.yaml:\d+")


def test_folders_that_are_no_capture(photos: Path) -> None:
    refused(photos.parent / "photo", r"folder of photographs does not exist[\s\S]*did you mean 'photos'\?")
    refused(photos / "psi_000.tif", r"folder of photographs is a file[\s\S]*expected: a folder")
    empty = photos.parent / "empty"
    empty.mkdir()
    refused(empty, r"the folder is empty[\s\S]*empty[\s\S]*capture.yaml")
    (photos / "capture.yaml").unlink()
    (photos / "psi_000.tif").rename(photos / "overview.tif")
    refused(photos, r"no capture.yaml, and 'overview.tif' has no number")


def test_a_missing_photo(photos: Path) -> None:
    (photos / "psi_045.tif").rename(photos / "psi_046.tif")
    refused(photos, r"no photo psi_045.tif[\s\S]*capture.yaml:\d+[\s\S]*did you mean 'psi_046.tif'\?")


def test_a_truncated_photo(photos: Path) -> None:
    data = (photos / "psi_045.tif").read_bytes()
    (photos / "psi_045.tif").write_bytes(data[: len(data) // 2])
    refused(photos, r"the photo is truncated[\s\S]*psi_045.tif")


def test_nan_matter_only_inside_the_mask(photos: Path) -> None:
    broken = (scene(1) / 65535).astype(np.float32)
    broken[0, :3], broken[0, 3] = np.nan, np.inf
    write_image(photos / "psi_045.tif", broken)
    refused(photos, r"4 of 48 pixels are NaN or infinite[\s\S]*psi_045.tif")
    mask = np.full((ROWS, COLUMNS), 255, np.uint8)
    mask[0] = 0
    write_image(photos / "mask.png", mask)
    describe(photos, mask="mask.png")
    np.testing.assert_array_equal(replay(photos).valid, mask > 0)


def test_sizes_that_differ(photos: Path) -> None:
    small = np.zeros((ROWS - 1, COLUMNS), np.uint16)
    for name in ("psi_045.tif", "dark.tif", "flat.tif", "mask.png"):
        write_image(photos / name, small + np.uint16(65535 if name == "mask.png" else 100))
    describe(photos, dark=["dark.tif"], flat=["flat.tif"], mask="mask.png")
    with pytest.raises(InputErrors) as caught:
        PhotoFolder(folder=photos).check()
    assert [error.what for error in caught.value.errors] == [
        "a photo of 8 x 5 pixels",
        "a dark frame of 8 x 5 pixels",
        "a flat field of 8 x 5 pixels",
        "a mask of 8 x 5 pixels",
    ]
    assert {error.expected for error in caught.value.errors} == {"8 x 6 pixels, as most photos have"}


def test_a_mask_that_leaves_nothing(photos: Path) -> None:
    write_image(photos / "mask.png", np.zeros((ROWS, COLUMNS), np.uint8))
    describe(photos, mask="mask.png")
    refused(photos, r"the mask leaves no pixel[\s\S]*mask.png")


def test_a_flat_field_that_leaves_nothing(photos: Path) -> None:
    for level in (0, 65535):
        write_image(photos / "flat.tif", np.full((ROWS, COLUMNS), level, np.uint16))
        describe(photos, flat=["flat.tif"])
        refused(photos, r"mask, dark frames and flat fields together leave no pixel[\s\S]*capture.yaml")


def test_too_few_angles(photos: Path) -> None:
    (photos / "capture.yaml").write_text(
        "kind: polarizer_sequence\nphotos:\n  - {file: psi_000.tif, polarizer_deg: 0}\n"
        "  - {file: psi_045.tif, polarizer_deg: 45}\n  - {file: psi_090.tif, polarizer_deg: 180}\n"
    )
    refused(photos, r"3 photographs at 2 distinct angles[\s\S]*capture.yaml[\s\S]*differ modulo 180 degrees")


def test_all_that_is_wrong_is_told_at_once(photos: Path) -> None:
    (photos / "psi_000.tif").unlink()
    (photos / "psi_045.tif").write_bytes(b"no photo")
    write_image(photos / "psi_090.tif", np.full((ROWS, COLUMNS), np.nan, np.float32))
    describe(photos, mask="absent.png")
    with pytest.raises(InputErrors) as caught:
        PhotoFolder(folder=photos).check()
    told = "\n".join(error.what for error in caught.value.errors)
    for part in ("no photo absent.png", "no photo psi_000.tif", "cannot be read", "48 of 48 pixels are NaN"):
        assert part in told


def test_a_mosaic_in_colour(photos: Path) -> None:
    write_image(photos / "raw.png", np.zeros((ROWS, COLUMNS, 3), np.uint8))
    content = {"kind": "polarizer_sequence", "photos": [{"file": "raw.png", "mosaic_deg": [[90, 45], [135, 0]]}]}
    (photos / "capture.yaml").write_text(yaml.safe_dump(content))
    refused(photos, r"a mosaic in colour[\s\S]*raw.png[\s\S]*the raw frame")


def test_a_mosaic_gives_four_photographs(photos: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Of one evenly polarised light, Malus' law at the four angles, and a saturated pixel with its surroundings."""
    angles = np.array([[90, 45], [135, 0]])
    block = 100 * (1 + 0.6 * np.cos(2 * np.deg2rad(20 - angles)))
    raw = np.tile(np.round(block), (ROWS // 2, COLUMNS // 2)).astype(np.uint8)
    raw[5, 7] = 255
    write_image(photos / "raw.png", raw)
    content = {"kind": "polarizer_sequence", "photos": [{"file": "raw.png", "mosaic_deg": angles.tolist()}]}
    (photos / "capture.yaml").write_text(yaml.safe_dump(content))
    with caplog.at_level(logging.INFO):
        sequence = replay(photos)
    np.testing.assert_array_equal(np.rad2deg(sequence.polarizer_rad), [90, 45, 135, 0])
    expected = np.broadcast_to(np.round(block).reshape(4, 1, 1), (4, ROWS, COLUMNS)) / 255
    np.testing.assert_allclose(sequence.images[:, sequence.valid], expected[:, sequence.valid], rtol=1e-6)
    assert np.argwhere(~sequence.valid).tolist() == [[4, 6], [4, 7], [5, 6], [5, 7]]
    assert "raw.png demosaiced to full resolution by bilinear interpolation" in caplog.text
    assert np.count_nonzero(~replay(photos, demosaic="guided").valid) == 16


finite = st.floats(width=32, allow_nan=False, allow_infinity=False)
text = st.text(max_size=12)


@st.composite
def sequences(draw: st.DrawFn) -> PolarizerSequence:
    """Any sequence that keeps the promises of its type, with NaN and infinities where it is not valid."""
    count, rows, columns = draw(st.integers(3, 6)), draw(st.integers(1, 5)), draw(st.integers(1, 6))
    valid = draw(npst.arrays(bool, (rows, columns)))
    valid[draw(st.integers(0, rows - 1)), draw(st.integers(0, columns - 1))] = True
    images = draw(npst.arrays(np.float32, (count, rows, columns), elements=finite))
    images[0, ~valid] = draw(st.sampled_from([np.nan, np.inf, -0.0]))
    start = draw(st.floats(-7, 7))
    steps = draw(st.lists(st.floats(0.05, 0.5), min_size=count, max_size=count))
    positive = st.floats(1e-9, 1e9)
    return PolarizerSequence(
        images=images,
        polarizer_rad=start + np.cumsum(steps),
        valid=valid,
        pixel_mm=draw(st.none() | positive),
        wavelength_nm=draw(st.none() | positive),
        exposure_s=draw(st.none() | positive.map(lambda seconds: (seconds,) * count)),
        metadata=draw(st.dictionaries(text, text, max_size=4)),
    )


@settings(deadline=None, max_examples=40)
@given(sequences())
def test_what_is_written_is_replayed_bit_for_bit(sequence: PolarizerSequence) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = write_polarizer_sequence(sequence, Path(folder) / "photos")
        again = replay(path.parent)
    for name in ("images", "polarizer_rad", "valid"):
        before, after = getattr(sequence, name), getattr(again, name)
        assert (after.dtype, after.shape, after.tobytes()) == (before.dtype, before.shape, before.tobytes()), name
    for name in ("pixel_mm", "wavelength_nm", "exposure_s", "metadata"):
        assert getattr(again, name) == getattr(sequence, name), name
    assert digest(again) == digest(sequence)


def test_written_angles_are_short_where_they_can_be(tmp_path: Path) -> None:
    """12 steps over half a turn: no stray digits for 45, 90 and 135 degrees."""
    ones = np.ones((12, 2, 2), np.float32)
    sequence = PolarizerSequence(ones, np.deg2rad(180.0) * np.arange(12) / 12, np.ones((2, 2), bool))
    written = yaml.safe_load(write_polarizer_sequence(sequence, tmp_path).read_text())
    angles = [photo["polarizer_deg"] for photo in written["photos"]]
    assert [angles[k] for k in (0, 3, 6, 9)] == [0.0, 45.0, 90.0, 135.0]
    np.testing.assert_allclose(angles, 15.0 * np.arange(12), rtol=1e-15)
    assert written["photos"][11]["file"] == "photo_12.tif"
    assert sorted(p.name for p in tmp_path.iterdir())[0] == "capture.yaml"
    assert not (tmp_path / "mask.png").exists()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"polarizer_rad": np.array([0.0, 1.0, 1.0])}, r"stands twice"),
        ({"polarizer_rad": np.array([0.0, 1.0])}, r"2 angles of type float64"),
        ({"images": np.ones((3, 2, 2))}, r"type float64[\s\S]*float32"),
        ({"images": np.full((3, 2, 2), np.nan, np.float32)}, r"valid pixels are NaN"),
        ({"valid": np.zeros((2, 2), bool)}, r"no valid pixel"),
        ({"exposure_s": (1.0, 0.0, 1.0)}, r"exposures of \(1.0, 0.0, 1.0\) s"),
    ],
)
def test_what_could_not_be_replayed_is_not_written(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    fields = {
        "images": np.ones((3, 2, 2), np.float32),
        "polarizer_rad": np.arange(3.0),
        "valid": np.ones((2, 2), bool),
        **changes,
    }
    with pytest.raises(InputError, match=message):
        write_polarizer_sequence(PolarizerSequence(**fields), tmp_path / "photos")
    assert not (tmp_path / "photos").exists()


def stokes_angle(sequence: PolarizerSequence) -> NDArray:
    doubled = 2 * sequence.polarizer_rad
    s1, s2 = (np.tensordot(f(doubled), sequence.images, 1) for f in (np.cos, np.sin))
    return 0.5 * np.arctan2(s2, s1)


@pytest.mark.parametrize("name", ["glass", "fabrics", "filters"])
def test_real_photographs_against_polanalyser(measurements: Path, name: str) -> None:
    sequence = replay(measurements / "polarization" / name)
    vectors = polanalyser.calcStokes(list(sequence.images), sequence.polarizer_rad)
    oracle = polanalyser.cvtStokesToAoLP(vectors)
    difference = np.abs(np.rad2deg(axial_difference(stokes_angle(sequence), oracle)))[sequence.valid]
    assert np.median(difference) < 1e-3
    assert np.quantile(difference, 0.99) < 0.5


def test_angles_in_the_four_discs(measurements: Path) -> None:
    """As polanalyser gave them for the centres of the discs; their labels say nothing about handedness."""
    sequence = replay(measurements / "polarization" / "filters")
    assert sequence.images.shape == (4, 2048, 2448)
    angle = stokes_angle(sequence)
    for (row, column), expected in zip(
        ((1092, 380), (1095, 1002), (1092, 1555), (1110, 2108)), (83.2, 43.6, 175.2, 135.4), strict=True
    ):
        disc = np.s_[row - 60 : row + 60, column - 60 : column + 60]
        assert sequence.valid[disc].all()
        assert abs(np.rad2deg(axial_difference(axial_median(angle[disc]), np.deg2rad(expected)))) < 0.5
