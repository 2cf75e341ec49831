"""Samples of pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from photo_makers import write_image

from pipeline.data.gratings import OrientationMap
from pipeline.errors import InputError, InputErrors
from pipeline.optics.angles import axial_difference
from pipeline.report.writers import WRITERS
from pipeline.stages.simulate.picture_design import picture_design

GREY = np.array([[0, 51, 102], [153, 204, 255]], np.uint8)


def plane(folder: Path, angle_deg: float) -> Path:
    """Grey that grows in one direction, y up."""
    y, x = np.mgrid[40:0:-1, 0:60] - 20.0
    slope = np.cos(np.deg2rad(angle_deg)) * x + np.sin(np.deg2rad(angle_deg)) * y
    return write_image(folder / "plane.tif", np.float32(0.5 + slope / 200))


def test_black_to_white_are_0_to_180_degrees(tmp_path: Path) -> None:
    file = write_image(tmp_path / "design.png", GREY)
    sample = picture_design(file=file, pixel_mm=0.1)
    np.testing.assert_allclose(np.rad2deg(sample.orientation_rad), np.mod(GREY / 255.0 * 180, 180), atol=1e-4)
    assert (sample.pixel_mm, sample.name) == (0.1, "design")
    turned = picture_design(file=file, range_deg=(90.0, 0.0))
    np.testing.assert_allclose(np.rad2deg(turned.orientation_rad), 90 - GREY / 255.0 * 90, atol=1e-4)


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 100.0, 215.0])
def test_the_gradient_points_to_where_it_grows_lighter_y_up(tmp_path: Path, angle_deg: float) -> None:
    sample = picture_design(file=plane(tmp_path, angle_deg), reading="gradient", blur_px=0.0)
    error = axial_difference(sample.orientation_rad, np.deg2rad(angle_deg))
    np.testing.assert_allclose(error, 0, atol=1e-5)


def test_the_picture_of_a_map_in_the_report_is_read_back_by_its_hues(tmp_path: Path) -> None:
    """Eight bits have 1530 hues: steps of 0.12 degrees."""
    degrees = np.linspace(0, 179.9, 400, dtype=np.float32).reshape(20, 20)
    degrees[3, 4:9] = np.nan
    value = OrientationMap.of_angles(np.deg2rad(degrees), pixel_mm=0.1, absolute=True)
    file = next(path for path in WRITERS["OrientationMap"](tmp_path / "fit", value) if path.suffix == ".png")
    sample = picture_design(file=file, reading="hue", pixel_mm=0.1)
    np.testing.assert_array_equal(sample.diffracts, value.mask)
    error = np.rad2deg(axial_difference(sample.orientation_rad, value.orientation_rad))
    assert np.nanmax(np.abs(error)) < 0.07


def test_what_is_flat_is_ground(tmp_path: Path) -> None:
    picture = np.full((30, 30), 90, np.uint8)
    picture[:, 15:] = 200
    sample = picture_design(file=write_image(tmp_path / "edge.png", picture), reading="gradient", blur_px=1.0)
    columns = np.flatnonzero(sample.diffracts.all(axis=0))
    assert columns.min() > 8
    assert columns.max() < 21
    np.testing.assert_allclose(sample.orientation_rad[:, 14:16], 0, atol=1e-6)


def test_periods_come_from_the_setting_or_from_a_second_picture(tmp_path: Path) -> None:
    file = write_image(tmp_path / "design.png", GREY)
    np.testing.assert_array_equal(picture_design(file=file, period_um=1.5).period_um, 1.5)
    second = write_image(tmp_path / "second.png", GREY[::-1].copy())
    periods = picture_design(file=file, period_file=second, periods_um=(2.0, 1.0)).period_um
    np.testing.assert_allclose(periods, 2 - GREY[::-1] / 255.0, rtol=1e-6)


def test_a_mask_makes_ground(tmp_path: Path) -> None:
    file = write_image(tmp_path / "design.png", GREY)
    mask = write_image(tmp_path / "mask.png", np.uint8(GREY > 60))
    sample = picture_design(file=file, mask=mask)
    np.testing.assert_array_equal(sample.diffracts, GREY > 60)
    np.testing.assert_array_equal(np.isfinite(sample.period_um), sample.diffracts)


def test_what_is_no_design_is_refused(tmp_path: Path) -> None:
    file = write_image(tmp_path / "design.png", GREY)
    small = write_image(tmp_path / "small.png", GREY[:1])
    flat = write_image(tmp_path / "flat.png", np.full((5, 5), 7, np.uint8))
    with pytest.raises(InputError, match=r"the periods have 3 x 1 pixels, the orientations 3 x 2\s"):
        picture_design(file=file, period_file=small)
    with pytest.raises(InputError, match=r"nothing diffracts: the picture has no slope"):
        picture_design(file=flat, reading="gradient")
    with pytest.raises(InputError, match=r"a grey picture has no hues"):
        picture_design(file=file, reading="hue")
    colour = np.repeat(GREY[..., None], 3, axis=2)
    with pytest.raises(InputError, match=r"nothing diffracts: the picture has no slope or colour"):
        picture_design(file=write_image(tmp_path / "three.png", colour), reading="hue")
    colour[0, 0] = (255, 0, 0)
    with pytest.raises(InputError, match=r"a picture in colour\s[\s\S]*expected: grey"):
        picture_design(file=write_image(tmp_path / "three.png", colour))
    with pytest.raises(InputErrors, match=r"range_deg is \[1.0\][\s\S]*periods_um is \[0.0, 1.0\]\s"):
        picture_design(file=file, range_deg=(1.0,), periods_um=(0.0, 1.0))
    with pytest.raises(InputError, match=r"there is no photo desing.png[\s\S]*did you mean 'design.png'"):
        picture_design(file=tmp_path / "desing.png")
