from __future__ import annotations

import re

import cv2
import numpy as np
import pytest
from html_reading import Page, decoded
from hypothesis import given
from hypothesis import strategies as st

from pipeline.report.encoded import png
from pipeline.report.maps import Scale, _framed, map_with_bar, orientation_map, size_of
from pipeline.report.shades import GROUND, colours, orientation_colours, reduced, wheel_colours
from pipeline.report.svg import CHARACTER, ticks


@pytest.mark.parametrize("degrees", [0, 22.5, 45, 60, 90, 120, 135, 170, 225, 315])
def test_a_pixel_has_the_hue_that_the_wheel_shows_in_its_direction(degrees: float) -> None:
    wheel = wheel_colours(401)
    direction = np.deg2rad(degrees)
    column, row = round(200 + 160 * np.cos(direction)), round(200 - 160 * np.sin(direction))  # y up: row upwards
    assert wheel[row, column, 3] == 1
    pixel = orientation_colours(np.array([[direction % np.pi]]))[0, 0]
    np.testing.assert_allclose(wheel[row, column, :3], pixel, atol=0.03)


def test_hues_run_red_yellow_green_cyan_blue_magenta_over_half_a_turn() -> None:
    named = orientation_colours(np.deg2rad(np.arange(0, 180, 30.0))[None])[0]
    expected = [[1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1], [1, 0, 1]]
    np.testing.assert_allclose(named, expected, atol=1e-5)


def test_an_orientation_and_the_same_half_a_turn_further_have_one_colour() -> None:
    angles = np.linspace(0, 3, 50)[None]
    np.testing.assert_allclose(orientation_colours(angles), orientation_colours(angles + np.pi), atol=1e-5)


def test_masked_pixels_are_grey_in_every_map() -> None:
    void = np.full((1, 1), np.nan)
    np.testing.assert_allclose(orientation_colours(void)[0, 0], GROUND)
    np.testing.assert_allclose(colours(void, 0, 1, "viridis")[0, 0], GROUND)


def test_the_diverging_scale_is_red_above_and_blue_below_and_white_between() -> None:
    low, middle, high = colours(np.array([[-1.0, 0.0, 1.0]]), -1, 1, "diverging")[0]
    assert low[2] > 2 * low[0]
    assert high[0] > 2 * high[2]
    assert middle.min() > 0.95


def test_viridis_grows_lighter_from_low_to_high() -> None:
    ramp = colours(np.linspace(0, 1, 20)[None], 0, 1, "viridis")[0] @ [0.2126, 0.7152, 0.0722]
    assert np.all(np.diff(ramp) > 0)


def test_the_map_in_the_page_stands_upright() -> None:
    """The first row of the array is the top of the picture, and ticks there have the largest y."""
    orientation = np.full((20, 20), np.nan, np.float32)
    orientation[0, 0] = np.deg2rad(60)
    text = str(orientation_map(orientation, 0.1))
    uri = next(a["href"] for tag, a in Page(text).elements if tag == "image")
    shown = cv2.imdecode(np.frombuffer(decoded(uri), np.uint8), cv2.IMREAD_COLOR_RGB)
    np.testing.assert_array_equal(shown[0, 0], [0, 255, 0])
    assert shown[-1, 0].max() < 80
    height = {words: float(y) for y, words in re.findall(r'y="([\d.]+)" text-anchor="end">(−?[\d.]+)<', text)}
    assert height["0.50"] < height["0.00"] < height["−0.50"]


def test_a_map_without_a_pitch_counts_rows_from_the_top() -> None:
    text = str(map_with_bar(np.eye(30, dtype=np.float32), None, Scale("toy", 0.0, 1.0)))
    height = {words: float(y) for y, words in re.findall(r'y="([\d.]+)" text-anchor="end">([\d.]+)<', text)}
    assert height["0"] < height["20"]


@pytest.mark.parametrize("shape", [(30, 30), (4000, 3000), (60000, 40000)])
def test_the_name_of_an_axis_stands_clear_of_its_ticks(shape: tuple[int, int]) -> None:
    svg, axes = _framed(shape, None, 20)
    text = str(svg.markup("toy"))
    ticks_at = [(float(x), words) for x, words in re.findall(r'x="([\d.]+)" y="[\d.]+" text-anchor="end">(\d+)<', text)]
    left_of_ticks = min(x - CHARACTER * len(words) for x, words in ticks_at)
    name = float(re.search(r'<text class="label" x="([\d.]+)"[^>]*rotate\(-90[^>]*>row \(px\)<', text)[1])
    descent, ascent = 3.5, 10.5
    assert name + descent < left_of_ticks
    assert name - ascent > 0
    assert axes.left > max(x for x, _ in ticks_at)


def test_a_logarithmic_axis_says_so() -> None:
    values = np.random.default_rng(0).random((50, 50)).astype(np.float32)
    for log, name in ((True, "pixels (log)"), (False, "pixels")):
        assert f">{name}</text>" in str(map_with_bar(values, 0.1, Scale("toy", 0.0, 1.0, log=log)))


def test_reducing_keeps_the_mean_and_leaves_small_maps_alone() -> None:
    values = np.random.default_rng(0).random((120, 90)).astype(np.float32)
    small = reduced(values, most=37)
    assert small.shape == (37, 28)
    assert abs(small.mean() - values.mean()) < 2e-3
    np.testing.assert_array_equal(reduced(values, most=120), values)


def test_reducing_averages_what_is_known() -> None:
    values = np.ones((4, 4), np.float32)
    values[0, 0] = np.nan
    values[2:, 2:] = np.nan
    np.testing.assert_array_equal(reduced(values, most=2), [[1, 1], [1, np.nan]])


def test_reducing_orientations_averages_across_zero() -> None:
    values = np.deg2rad(np.tile(np.array([[1.0, 179.0], [179.0, 1.0]], np.float32), (2, 2)))
    assert np.all(np.sin(reduced(values, most=2, axial=True)) < 1e-6)


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.integers(2, 10))
def test_ticks_lie_within_and_are_few(low: float, span: float, most: int) -> None:
    marks = ticks(low, low + span, most)
    values = [value for value, _ in marks]
    slack = 1e-6 * span + 1e-9 * abs(low)
    assert all(low - slack <= value <= low + span + slack for value in values)
    assert len(values) <= most + 1
    assert values == sorted(values)


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0, 1, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]),
        (-7.5, 7.5, ["−7.5", "−5.0", "−2.5", "0.0", "2.5", "5.0", "7.5"]),
        (0, 180, ["0", "50", "100", "150"]),
        (1.0, 1.0, []),
        (float("nan"), 1.0, []),
    ],
)
def test_ticks_are_round_numbers(low: float, high: float, expected: list[str]) -> None:
    assert [words for _, words in ticks(low, high)] == expected


def test_a_png_keeps_its_channels_in_order() -> None:
    levels = np.array([[[1.0, 0.5, 0.0], [0.0, 0.0, 1.0]]])
    read = cv2.imdecode(np.frombuffer(png(levels), np.uint8), cv2.IMREAD_COLOR_RGB)
    np.testing.assert_array_equal(read, [[[255, 128, 0], [0, 0, 255]]])


@pytest.mark.parametrize(
    ("shape", "axial", "words"),
    [
        ((2430, 2430), False, "2430 × 2430 pixels, shown as 700 × 700, each the mean of about 3.5 × 3.5 pixels."),
        ((700, 1400), True, "1400 × 700 pixels, shown as 700 × 350, each the axial mean of about 2 × 2 pixels."),
        ((700, 700), False, "700 × 700 pixels."),
    ],
)
def test_a_map_that_was_made_smaller_says_of_how_many_pixels_a_mean_is(
    shape: tuple[int, int], axial: bool, words: str
) -> None:
    assert size_of(shape, axial=axial) == words
