"""Row maxima, their line, and how often they go round."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics.angles import axial_difference
from pipeline.optics.jones import polarizer_response
from pipeline.optics.row_maxima import (
    deviation_from_branches,
    deviation_from_line,
    normalized_rows,
    row_maxima,
    winding,
)

PSI = np.pi * np.arange(36) / 36
THETA = np.pi * np.arange(180) / 180


@given(st.floats(0.2, 3), st.floats(-3, 3), st.floats(0, 1.5), st.floats(0, 3))
def test_maxima_are_where_a_fine_search_finds_them(r: float, zeta: float, delta: float, axis: float) -> None:
    settings = {"amplitude_ratio": r, "phase_rad": zeta, "retardation_rad": delta, "film_axis_rad": axis}
    theta = np.array([[0.3], [1.1], [2.9]])
    found = row_maxima(polarizer_response(PSI, theta, **settings), PSI)
    fine = np.pi * np.arange(7200) / 7200
    brightest = fine[np.argmax(polarizer_response(fine, theta, **settings), axis=1)]
    clear = found.amplitude > 1e-4
    assert np.all(np.abs(axial_difference(found.polarizer_rad, brightest))[clear] < 1e-3)
    assert np.all(found.residual[clear] < 1e-9)


def test_a_row_without_variation_has_no_maximum() -> None:
    found = row_maxima(np.vstack([np.ones(36), 1 + 0.1 * np.cos(2 * (PSI - 0.4))]), PSI)
    assert np.isnan(found.polarizer_rad[0])
    assert found.polarizer_rad[1] == pytest.approx(0.4)
    assert found.amplitude[1] == pytest.approx(0.1)


def test_what_a_cosine_leaves_is_told_in_units_of_its_amplitude() -> None:
    found = row_maxima(1 + 0.2 * np.cos(2 * PSI)[None] + 0.02 * np.cos(4 * PSI)[None], PSI)
    assert found.residual[0] == pytest.approx(0.1 / np.sqrt(2))


def test_too_few_angles_are_refused() -> None:
    with pytest.raises(ValueError, match="three or more polariser angles"):
        row_maxima(np.ones((2, 2)), [0.0, 1.0])


def test_normalised_cosines_reach_one_and_flat_rows_stay_zero() -> None:
    rows = normalized_rows(np.vstack([5 + 0.01 * np.cos(2 * PSI), np.full(36, 3.0)]))
    assert rows[0, 0] == pytest.approx(1)
    assert rows[0, 18] == pytest.approx(-1)
    np.testing.assert_array_equal(rows[1], 0)


@given(st.floats(0, 3.14))
def test_on_a_line_nothing_deviates_whatever_the_offset(offset: float) -> None:
    deviation, found = deviation_from_line(np.mod(THETA + offset, np.pi), THETA)
    assert np.abs(deviation).max() < 1e-9
    assert abs(axial_difference(found, offset)) < 1e-9
    assert winding(np.mod(THETA + offset, np.pi)) == 1


def test_deviation_is_positive_where_the_maximum_is_ahead() -> None:
    maxima = THETA + 0.3
    maxima[10] += 0.2
    deviation, offset = deviation_from_line(np.mod(maxima, np.pi), THETA)
    assert deviation[10] == pytest.approx(0.2)
    assert offset == pytest.approx(0.3)


def test_two_lines_a_right_angle_apart_are_branches() -> None:
    maxima = np.mod(THETA + 0.3 + np.where(THETA > 1.2, np.pi / 2, 0.02), np.pi)
    assert np.abs(deviation_from_line(maxima, THETA)[0]).max() > 1.5
    assert np.abs(deviation_from_branches(maxima, THETA)).max() == pytest.approx(0.02)


@pytest.mark.parametrize("turns", [-1, 0, 1, 2])
def test_winding_counts_half_turns(turns: int) -> None:
    assert winding(np.mod(turns * THETA + 0.1 * np.sin(2 * THETA), np.pi)) == turns


def test_a_leap_leaves_the_winding_open() -> None:
    assert np.isnan(winding(np.where(THETA > 1, 1.0, 2.2)))
