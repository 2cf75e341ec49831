from __future__ import annotations

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from html_reading import decoded
from made_up_run import line_deviation, polarizer_response

from pipeline.data.polarization import LineDeviation
from pipeline.report.responses import deviations, responses, shown_rows
from pipeline.report.shades import GROUND


def dots(body: str) -> np.ndarray:
    return np.array(re.findall(r'class="maximum" cx="([\d.]+)" cy="([\d.]+)"', body), float)


def frame(body: str) -> tuple[float, float, float, float]:
    return tuple(
        map(float, re.search(r'class="frame" x="(.*?)" y="(.*?)" width="(.*?)" height="(.*?)"', body).groups())
    )


def test_a_row_maximum_is_drawn_on_the_brightest_pixel_of_its_row() -> None:
    value = polarizer_response(rows=12, columns=20)
    body = str(responses(value)[0].body)
    left, top, width, height = frame(body)
    picture = cv2.imdecode(np.frombuffer(decoded(re.search(r'href="([^"]+)"', body)[1]), np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape[:2] == (12, 20)
    found = dots(body)
    assert len(found) == 11  # of twelve rows one is flat
    for x, y in found:
        row, column = int((y - top) / height * 12), int((x - left) / width * 20)
        green = picture[row, :, 1].astype(int)  # viridis grows greener with the signal
        assert green[column] >= green.max() - 12


def test_orientations_go_up() -> None:
    value = polarizer_response()
    found = dots(str(responses(value)[0].body))
    assert np.all(np.diff(found[:, 1]) < 0)
    np.testing.assert_array_equal(np.isnan(shown_rows(value)).all(axis=1).nonzero()[0], [12 - 1 - 2])


def test_the_expected_line_goes_through_the_maxima_without_a_film() -> None:
    body = str(responses(polarizer_response())[0].body)
    pieces = re.findall(r'class="expected" d="M([\d.-]+),([\d.-]+) ([\d.-]+),([\d.-]+)"', body)
    assert len(pieces) == 2
    for x, y in dots(body):
        distances = []
        for x0, y0, x1, y1 in np.array(pieces, float):
            across = np.array([y1 - y0, x0 - x1]) / np.hypot(x1 - x0, y1 - y0)
            distances.append(abs(across @ [x - x0, y - y0]))
        assert min(distances) < 0.5


def test_both_axes_are_in_degrees_and_the_bar_has_its_name() -> None:
    normalised, intensity = responses(polarizer_response())
    for words in ("polariser ψ (°)", "orientation θ (°)", ">150<"):
        assert words in normalised.body
        assert words in intensity.body
    assert ">I norm<" in normalised.body
    assert ">intensity<" in intensity.body


def test_captions_say_what_was_simulated() -> None:
    value = polarizer_response()
    caption = responses(value)[0].caption
    assert "R = 1.1 exp(i 40.11°)" in caption
    assert "retards by 2.865° a pass" in caption
    assert f"ψ = θ + {np.rad2deg(2.1):.2f}°" in caption
    assert "the 1 rows that" not in caption
    assert "Grey: 1 of 12 rows" in caption
    assert "mean over all orientations" in responses(replace(value, prenormalized=True))[0].caption
    assert "no row would have a maximum" in responses(replace(value, offset_rad=None))[0].caption


def test_flat_rows_are_grey() -> None:
    body = str(responses(polarizer_response())[0].body)
    picture = cv2.imdecode(np.frombuffer(decoded(re.search(r'href="([^"]+)"', body)[1]), np.uint8), cv2.IMREAD_COLOR)
    np.testing.assert_allclose(picture[9] / 255, GROUND, atol=0.01)


def test_a_deviation_that_wraps_is_drawn_in_pieces() -> None:
    theta, wrapping, smooth = line_deviation()
    body = str(deviations(LineDeviation(theta, wrapping, smooth, {}))[0].body)
    assert body.count('class="curve"') == 2
    assert body.count('class="second"') == 1


@pytest.mark.parametrize("known", [True, False])
def test_a_deviation_that_is_not_known_is_not_drawn(known: bool) -> None:
    theta, _, smooth = line_deviation()
    void = np.full_like(smooth, np.nan)
    found = deviations(LineDeviation(theta, smooth if known else void, void, {}))
    assert len(found) == known
    assert not known or 'class="second"' not in found[0].body
