"""Dots on a printer's grid, and gratings on its steps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics.angles import axial_difference
from pipeline.optics.dot_grid import cells_under, nearest_angles, nearest_multiples, nearest_of


def test_cells_of_equal_grids_are_the_points_themselves() -> None:
    np.testing.assert_array_equal(cells_under(7, 0.3, 7, 0.3), np.arange(7))


def test_cells_of_coarser_and_finer_grids() -> None:
    np.testing.assert_array_equal(cells_under(2, 0.3, 6, 0.1), [1, 4])  # the middle of three
    np.testing.assert_array_equal(cells_under(6, 0.1, 2, 0.3), [0, 0, 0, 1, 1, 1])
    np.testing.assert_array_equal(cells_under(3, 0.2, 6, 0.1), [1, 3, 5])  # on the line between two
    np.testing.assert_array_equal(cells_under(3, 1.0, 2, 0.1), [0, 1, 1])  # outside


@given(st.integers(1, 60), st.integers(1, 60), st.floats(0.01, 1), st.floats(0.01, 1))
def test_a_point_lies_in_its_cell(points: int, cells: int, pitch: float, cell_pitch: float) -> None:
    cell = cells_under(points, pitch, cells, cell_pitch)
    place = (np.arange(points) + 0.5 - points / 2) * pitch
    middle = (cell + 0.5 - cells / 2) * cell_pitch
    inside = np.abs(place) <= cells * cell_pitch / 2
    assert (np.abs(place - middle)[inside] <= cell_pitch / 2 + 1e-6).all()
    assert set(cell) <= set(range(cells))


@given(st.floats(0, 180, exclude_max=True), st.sampled_from([0.5, 1.0, 5.0, 7.5, 22.5, 60.0, 180.0]))
def test_angles_are_brought_to_the_nearest_step_across_180_too(angle: float, step: float) -> None:
    found = float(nearest_angles(angle, step))
    assert 0 <= found < 180
    assert found / step == pytest.approx(round(found / step), abs=1e-9)
    assert abs(np.rad2deg(axial_difference(np.deg2rad(found), np.deg2rad(angle)))) <= step / 2 + 1e-9


def test_just_below_180_degrees_the_nearest_step_is_0() -> None:
    np.testing.assert_array_equal(nearest_angles([179.8, 177.4, 177.6, np.nan], 5.0), [0, 175, 0, np.nan])


@given(st.floats(1, 2000), st.lists(st.integers(1, 2000), min_size=1, max_size=9))
def test_the_nearest_of_those_allowed_is_found(value: float, allowed: list[int]) -> None:
    found = float(nearest_of(value, allowed))
    assert found in allowed
    assert abs(found - value) == min(abs(a - value) for a in allowed)


def test_what_is_not_known_has_no_nearest() -> None:
    np.testing.assert_array_equal(nearest_of([np.nan, 640], [600, 700]), [np.nan, 600])
    np.testing.assert_array_equal(nearest_multiples([np.nan, 643, 2], 10), [np.nan, 640, 10])


def test_points_on_the_line_between_two_cells_belong_to_the_next() -> None:
    np.testing.assert_array_equal(cells_under(29, 0.06, 58, 0.03), np.arange(1, 58, 2))
