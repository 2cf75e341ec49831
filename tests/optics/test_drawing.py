"""Shapes drawn on a map of orientation and period."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics.drawing import Drawing, azimuth, polar, ray, star


def drawn(side: int = 400, pixel_mm: float = 0.05) -> Drawing:
    return Drawing(side, pixel_mm)


def area(drawing: Drawing) -> float:
    return float(np.isfinite(drawing.orientation_rad).sum()) * drawing.pixel_mm**2


def test_x_is_right_and_y_is_up() -> None:
    drawing = drawn()
    drawing.polygon(np.array([(2.0, 5.0), (4.0, 5.0), (4.0, 6.0), (2.0, 6.0)]), 0.3, 1.2)
    rows, columns = np.nonzero(np.isfinite(drawing.orientation_rad))
    assert (rows.min(), rows.max()) == (80, 99)
    assert (columns.min(), columns.max()) == (240, 279)
    np.testing.assert_allclose(drawing.period_um[85, 250], 1.2, rtol=1e-6)


def test_areas_are_those_of_geometry() -> None:
    ring = drawn()
    ring.annulus((1.0, -2.0), (2.0, 5.0), 0.0, 1.0)
    assert area(ring) == pytest.approx(np.pi * 21, rel=2e-3)
    bar = drawn()
    bar.polygon(ray((2.0, 7.0), 33.0, 0.8), 0.0, 1.0)
    assert area(bar) == pytest.approx(4.0, rel=5e-3)
    five = drawn()
    for kite in star((0.5, 0.5), 6.0, points=5, waist=0.5, turn_deg=20.0):
        five.polygon(kite, 0.0, 1.0)
    assert area(five) == pytest.approx(5 * 6.0 * 3.0 * np.sin(np.pi / 5), rel=5e-3)


def test_a_star_points_where_it_is_turned() -> None:
    drawing = drawn()
    for kite in star((0.0, 0.0), 6.0, points=5, waist=0.4, turn_deg=90.0):
        drawing.polygon(kite, 0.0, 1.0)
    rows, _ = np.nonzero(np.isfinite(drawing.orientation_rad))
    assert drawing.y_mm[rows.min()] == pytest.approx(6.0, abs=0.15)
    assert drawing.y_mm[rows.max()] == pytest.approx(-6.0 * np.cos(np.pi / 5), abs=0.15)


def test_what_reaches_over_the_edge_is_cut_off_and_what_lies_beyond_it_is_nothing() -> None:
    drawing = drawn()
    drawing.annulus((10.0, 0.0), (0.0, 2.0), 0.0, 1.0)
    assert area(drawing) == pytest.approx(np.pi * 2, rel=0.01)
    drawing.annulus((30.0, 30.0), (0.0, 2.0), 0.0, 1.0)
    assert area(drawing) == pytest.approx(np.pi * 2, rel=0.01)


def test_later_shapes_lie_on_top() -> None:
    drawing = drawn()
    drawing.annulus((0.0, 0.0), (0.0, 5.0), 0.1, 1.0)
    drawing.annulus((0.0, 0.0), (0.0, 2.0), 0.7, 1.4)
    assert drawing.orientation_rad[200, 200] == np.float32(0.7)
    assert drawing.orientation_rad[200, 280] == np.float32(0.1)


@given(st.floats(-100, 100))
def test_orientations_come_into_half_a_turn(angle: float) -> None:
    drawing = drawn(3, 1.0)
    drawing.annulus((0.0, 0.0), (0.0, 5.0), angle, 1.0)
    value = drawing.orientation_rad[1, 1]
    assert 0 <= value < np.pi
    assert np.cos(2 * float(value)) == pytest.approx(np.cos(2 * angle), abs=1e-5)


@pytest.mark.parametrize("angle_deg", [10.0, 100.0, 190.0, 280.0])
def test_azimuth_is_the_angle_of_polar(angle_deg: float) -> None:
    x, y = polar(3.0, angle_deg, (1.0, 2.0))
    found = azimuth((1.0, 2.0))(np.array(x), np.array(y))
    assert np.rad2deg(found) % 360 == pytest.approx(angle_deg)
