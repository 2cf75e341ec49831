from __future__ import annotations

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from html_reading import decoded
from made_up_run import values_of_every_type

from pipeline.report.pictures import beside, direction, photos, pictures


@pytest.mark.parametrize(
    ("light_mm", "azimuth", "elevation"),
    [((1, 0, 1), 0, 45), ((0, 2, 0), 90, 0), ((-1, 0, np.sqrt(3)), 180, 60), ((0, -1, 1), -90, 45), ((0, 0, 5), 0, 90)],
)
def test_a_light_is_named_by_its_direction(light_mm: tuple[float, ...], azimuth: float, elevation: float) -> None:
    assert direction(np.array(light_mm)) == pytest.approx((azimuth, elevation))


def test_a_light_from_the_top_of_the_picture_is_drawn_above_the_middle_of_its_disc() -> None:
    series = values_of_every_type()["torch"]
    text = str(pictures(series)[0].body)
    lamps = [(float(x), float(y)) for x, y in re.findall(r'class="lamp" cx="([\d.]+)" cy="([\d.]+)"', text)]
    right, top, left = lamps
    assert right[0] > 9
    assert top[1] < 9
    assert left[0] < 9


def test_photographs_are_labelled_by_their_angle_and_mean() -> None:
    value = values_of_every_type(count=4)["photos"]
    text = str(photos(value)[0].body)
    assert re.findall(r"<b>([\d.]+°)</b>", text) == ["0°", "45°", "90°", "135°"]
    means = [float(mean) for mean in re.findall(r"mean ([\d.]+)", text)]
    np.testing.assert_allclose(means, [image[value.valid].mean() for image in value.images], atol=1e-4)


def test_photographs_taken_in_any_order_are_shown_by_angle() -> None:
    value = values_of_every_type(count=4)["photos"]
    order = [2, 0, 3, 1]
    shuffled = replace(value, images=value.images[order], polarizer_rad=value.polarizer_rad[order])
    for figure, other in zip(photos(value), photos(shuffled), strict=True):
        assert figure.body == other.body
        assert figure.caption == other.caption


def test_every_picture_of_a_signal_says_what_black_and_white_are() -> None:
    values = values_of_every_type()
    sheet, _, left_out = photos(values["photos"])
    white = re.search(r"in all of them black is 0 and white ([\d.]+) of the sensor's full scale", sheet.caption)
    assert white
    assert f"black is 0, white {white[1]} of full scale" in left_out.caption
    assert "Black is 0, white 1." in pictures(values["torch"])[0].caption


def test_a_signal_has_a_bar_from_black_to_white() -> None:
    body = str(photos(values_of_every_type()["photos"])[2].body)
    picture, ramp = re.findall(r'href="([^"]+)"', body)
    grey = cv2.imdecode(np.frombuffer(decoded(ramp), np.uint8), cv2.IMREAD_COLOR)[:, 0]
    assert picture != ramp
    assert (grey[0].tolist(), grey[-1].tolist()) == ([255] * 3, [0] * 3)
    assert np.ptp(grey, axis=1).max() == 0
    assert ">signal</text>" in body
    assert ">0.0</text>" in body or ">0.00</text>" in body


def test_many_lights_are_broken_into_rows_that_fit_the_page() -> None:
    series = values_of_every_type()["torch"]
    many = type(series)(series.rgb[:1].repeat(8, 0), np.tile([[0.0, 1.0, 1.0]], (8, 1)), series.camera_mm)
    text = str(beside({"a": many, "b": many}).body)
    assert re.findall(r"--count:(\d)", text) == ["6", "2"]
    assert text.count("<img") == 16


def test_sizes_that_differ_are_told_by_name() -> None:
    series = values_of_every_type()["torch"]
    rows, columns = series.rgb.shape[1:3]
    small = type(series)(series.rgb[:, ::2], series.light_mm, series.camera_mm)
    assert f"middle; a: {columns} × {rows} pixels (" in beside({"a": series, "b": small}).caption
    assert f", b: {columns} × {(rows + 1) // 2} pixels, sRGB." in beside({"a": series, "b": small}).caption
    assert f"middle; {columns} × {rows} pixels (" in beside({"a": series, "b": series}).caption


def test_a_dark_series_is_brightened_and_says_so() -> None:
    series = values_of_every_type()["torch"]
    dark = type(series)(series.rgb / 100, series.light_mm, series.camera_mm, series.pixel_mm, series.caption)
    assert re.search(r"Shown at 1\d\d times the exposure", pictures(dark)[0].caption)
    assert "exposure" not in pictures(series)[0].caption
