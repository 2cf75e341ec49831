"""The synthetic logo."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.stages.simulate.logo import _facets, logo


@pytest.fixture(scope="module")
def sample():
    return logo(pixel_mm=0.02)


def value_at(sample, x_mm: float, y_mm: float) -> float:
    row = int(sample.orientation_rad.shape[0] / 2 - y_mm / sample.pixel_mm)
    column = int(sample.orientation_rad.shape[1] / 2 + x_mm / sample.pixel_mm)
    return float(np.rad2deg(sample.orientation_rad[row, column]))


def test_it_is_as_wide_as_asked_with_ground_around_it(sample) -> None:
    rows, columns = np.nonzero(sample.diffracts)
    assert np.ptp(columns) * sample.pixel_mm == pytest.approx(15, abs=0.1)
    assert sample.orientation_rad.shape == (810, 810)
    assert not sample.diffracts[:20].any()
    assert 0.4 < sample.diffracts.mean() < 0.7
    half = logo(width_mm=7.5, margin_mm=0.3, pixel_mm=0.01)
    np.testing.assert_array_equal(half.diffracts, sample.diffracts)
    assert rows.size > 0


def test_facets_stand_where_they_are_drawn_with_y_up(sample) -> None:
    assert value_at(sample, 3.5, 1.5) == pytest.approx(0)  # first blade, right of the centre and above it
    assert value_at(sample, 0.0, 4.0) == pytest.approx(15)  # second blade, above
    assert value_at(sample, 3.5, -1.5) == pytest.approx(165)  # last blade, right and below
    assert value_at(sample, 0.0, 0.0) == pytest.approx(105)  # hexagon
    assert value_at(sample, 0.0, -3.5) == pytest.approx(80)  # middle ray
    assert np.isnan(value_at(sample, 0.0, 7.9))


def test_each_facet_has_one_orientation_and_one_of_three_periods(sample) -> None:
    drawn = {round(f.orientation_deg, 6) for f in _facets()}
    found = set(np.round(np.rad2deg(np.unique(sample.orientation_rad[sample.diffracts]).astype(float)), 3))
    assert found == drawn
    np.testing.assert_allclose(np.unique(sample.period_um[sample.diffracts]), [1.0, 1.2, 1.4], rtol=1e-6)
    np.testing.assert_array_equal(np.isfinite(sample.period_um), sample.diffracts)


def test_orientations_are_not_spread_evenly(sample) -> None:
    """The pre-normalisation's assumption, equally common orientations, does not hold for this logo."""
    double = 2 * sample.orientation_rad[sample.diffracts].astype(np.float64)
    assert np.hypot(np.cos(double).mean(), np.sin(double).mean()) > 0.2


def test_facets_are_convex_and_anticlockwise() -> None:
    for facet in _facets():
        edges = np.roll(facet.vertices_mm, -1, axis=0) - facet.vertices_mm
        following = np.roll(edges, -1, axis=0)
        turns = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
        assert (turns > -1e-9).all()


def test_area_does_not_depend_on_the_pitch() -> None:
    areas = [s.diffracts.sum() * s.pixel_mm**2 for s in (logo(pixel_mm=0.01), logo(pixel_mm=0.02))]
    assert areas[1] == pytest.approx(areas[0], rel=2e-3)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"periods_um": (1.0, 1.2, 1.4)}, "three periods above 0, the longest first"),
        ({"periods_um": (1.4, 1.2)}, "three periods above 0, the longest first"),
        ({"periods_um": (1.4, 1.2, 0.0)}, "three periods above 0, the longest first"),
        ({"width_mm": 0.0}, "width_mm is 0"),
        ({"pixel_mm": -0.01}, "pixel_mm is -0.01"),
        ({"margin_mm": -1.0}, "margin_mm is -1"),
        ({"pixel_mm": 1e-5}, "1620000 points a side"),
    ],
)
def test_what_cannot_be_drawn_is_refused(settings, message: str) -> None:
    with pytest.raises(InputError, match=message):
        logo(**settings)
