"""Defects drawn into a sample, and the sample laid down by hand."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest

from pipeline.data.gratings import GratingSample
from pipeline.errors import InputError, InputErrors
from pipeline.optics.angles import axial_difference
from pipeline.stages.simulate.damaged import damaged
from pipeline.stages.simulate.defects import defects
from pipeline.stages.simulate.laid_down import laid_down
from pipeline.stages.simulate.logo import logo


@pytest.fixture(scope="module")
def sample() -> GratingSample:
    return logo(pixel_mm=0.02)


def at(sample: GratingSample, x_mm: float, y_mm: float) -> tuple[float, float]:
    rows, columns = sample.orientation_rad.shape
    row, column = int(rows / 2 - y_mm / sample.pixel_mm), int(columns / 2 + x_mm / sample.pixel_mm)
    return float(np.rad2deg(sample.orientation_rad[row, column])), float(sample.period_um[row, column])


def test_a_disc_lies_where_it_is_asked_for_with_y_up(sample) -> None:
    plan = defects(sample, listed=[{"kind": "missing", "x_mm": 3.0, "y_mm": 1.5, "size_mm": 0.6}])
    np.testing.assert_allclose(plan.centre_mm, [[3.0, 1.5]], atol=0.01)
    assert plan.area_mm2[0] == pytest.approx(np.pi * 0.3**2, rel=0.03)
    assert plan.width_mm[0] == pytest.approx(0.6, abs=0.04)
    result = damaged(sample, plan)
    assert np.isnan(at(result, 3.0, 1.5)).all()
    assert at(result, 3.0, -1.5) == at(sample, 3.0, -1.5)
    assert np.count_nonzero(sample.diffracts & ~result.diffracts) == np.count_nonzero(plan.labels)


def test_a_turn_is_anticlockwise_and_a_period_is_multiplied(sample) -> None:
    listed = [
        {"kind": "turned", "x_mm": 3.5, "y_mm": 1.5, "size_mm": 0.4, "turn_deg": 12.0},
        {"kind": "turned", "x_mm": 3.5, "y_mm": 2.5, "size_mm": 0.4, "turn_deg": -3.0},
        {"kind": "period", "x_mm": 0.0, "y_mm": 4.0, "size_mm": 0.4, "period_factor": 0.9},
    ]
    result = damaged(sample, defects(sample, listed=listed))
    assert at(result, 3.5, 1.5)[0] == pytest.approx(12, abs=1e-4)
    assert at(result, 3.5, 2.5)[0] == pytest.approx(177, abs=1e-4)  # 0 - 3, modulo 180
    assert at(result, 0.0, 4.0) == pytest.approx((15, 0.9 * 1.2), abs=1e-4)


def test_without_a_size_it_is_the_whole_facet_and_nothing_else(sample) -> None:
    plan = defects(sample, listed=[{"kind": "turned", "x_mm": 0.2, "y_mm": 0.1, "turn_deg": 5.0}])
    hexagon = 3 * np.sqrt(3) / 2 * 1.35**2
    assert plan.area_mm2[0] == pytest.approx(hexagon, rel=0.01)
    assert plan.width_mm[0] == pytest.approx(2.7, abs=0.04)


def test_a_scratch_lies_along_its_direction_and_counts_only_where_gratings_are(sample) -> None:
    along = {"kind": "scratch", "x_mm": 3.5, "y_mm": 1.5, "size_mm": 1.5, "direction_deg": 30.0, "thickness_mm": 0.1}
    plan = defects(sample, listed=[along])
    down, right = np.nonzero(plan.labels)
    slope = np.polyfit(right, -down, 1)[0]
    assert np.rad2deg(np.arctan(slope)) == pytest.approx(30, abs=1)
    assert plan.area_mm2[0] == pytest.approx(0.15, rel=0.05)
    outside = defects(sample, listed=[{**along, "x_mm": 7.4, "y_mm": 0.4, "direction_deg": 0.0}])
    assert outside.area_mm2[0] < 0.1
    assert not (outside.labels.astype(bool) & ~sample.diffracts).any()


def test_random_defects_are_apart_of_all_kinds_and_repeat_with_the_seed(sample) -> None:
    plan = defects(sample, count=12, size_mm=0.3, apart_mm=0.5, seed=4)
    assert {kind: plan.kind.count(kind) for kind in set(plan.kind)} == dict.fromkeys(
        ("missing", "turned", "period", "scratch"), 3
    )
    distance = np.hypot(*(plan.centre_mm[:, None] - plan.centre_mm).transpose(2, 0, 1))
    assert distance[~np.eye(12, dtype=bool)].min() > 0.6
    again, other = (defects(sample, count=12, size_mm=0.3, apart_mm=0.5, seed=seed) for seed in (4, 5))
    np.testing.assert_array_equal(again.labels, plan.labels)
    assert not np.array_equal(other.labels, plan.labels)


def test_no_defects_are_an_empty_list_that_damages_nothing(sample) -> None:
    plan = defects(sample)
    assert plan.kind == ()
    assert plan.centre_mm.shape == (0, 2)
    np.testing.assert_array_equal(damaged(sample, plan).orientation_rad, sample.orientation_rad)


@pytest.mark.parametrize(
    ("listed", "match"),
    [
        ({"kind": "mising", "x_mm": 0, "y_mm": 0}, "there is no defect 'mising'"),
        ({"kind": "turned", "x_mm": 0, "y_mm": 0}, "a turned defect has no turn_deg"),
        ({"kind": "missing", "x_mm": 0, "y_mm": 0, "sise_mm": 1}, "a missing defect has a sise_mm"),
        ({"kind": "missing", "x_mm": 0, "y_mm": 0, "size_mm": 0.0}, "size_mm is 0"),
        ({"kind": "turned", "x_mm": 0, "y_mm": 0, "turn_deg": 0}, "turn_deg is 0"),
        ({"kind": "turned", "x_mm": "left", "y_mm": 0, "turn_deg": 3}, "x_mm is 'left'"),
        ({"kind": "missing", "x_mm": 8.0, "y_mm": 8.0, "size_mm": 0.1}, "damages nothing"),
    ],
)
def test_what_is_no_defect_is_refused(sample, listed, match) -> None:
    with pytest.raises((InputError, InputErrors), match=match):
        defects(sample, listed=[listed])


def test_too_many_defects_and_another_samples_are_refused(sample) -> None:
    with pytest.raises(InputError, match="no room for another defect"):
        defects(sample, count=60, size_mm=3.0)
    with pytest.raises(InputError, match="defects on a grid of"):
        damaged(logo(pixel_mm=0.06), defects(sample))


def test_laid_down_it_lies_shifted_and_turned_with_its_gratings_and_film(sample) -> None:
    moved = laid_down(sample, x_mm=0.4, y_mm=-0.2, turn_deg=10.0)
    x, y = 3.5, 1.5
    turn = np.deg2rad(10)
    there = (x * np.cos(turn) - y * np.sin(turn) + 0.4, x * np.sin(turn) + y * np.cos(turn) - 0.2)
    expected = at(sample, x, y)
    assert at(moved, *there) == pytest.approx((expected[0] + 10, expected[1]), abs=1e-3)
    assert np.rad2deg(moved.film_axis_rad) == pytest.approx(10)
    assert np.count_nonzero(moved.diffracts) == pytest.approx(np.count_nonzero(sample.diffracts), rel=2e-3)


def test_laid_down_straight_it_is_the_sample_itself(sample) -> None:
    same = laid_down(sample)
    np.testing.assert_allclose(
        axial_difference(same.orientation_rad, sample.orientation_rad)[sample.diffracts], 0, atol=1e-6
    )
    np.testing.assert_array_equal(same.period_um, sample.period_um)


def test_what_leaves_the_map_is_told_and_more_than_half_a_turn_refused(sample, caplog) -> None:
    with caplog.at_level(logging.WARNING):
        laid_down(sample, x_mm=3.0)
    assert "of the gratings lie outside the map" in caplog.text
    with pytest.raises(InputError, match="turn_deg is 200"):
        laid_down(sample, turn_deg=200.0)


def test_what_varies_over_the_sample_is_laid_down_with_it(sample) -> None:
    rows, columns = sample.orientation_rad.shape
    veil = np.zeros((rows, columns), np.float32)
    veil[:, columns // 2 :] = 0.1  # over the right half
    axis = np.full((rows, columns), 0.2, np.float32)
    moved = laid_down(replace(sample, veil=veil, film_axis_rad=axis), turn_deg=90.0)
    assert moved.veil[rows // 4, columns // 3] == pytest.approx(0.1)  # now over the upper half
    assert moved.veil[3 * rows // 4, columns // 3] == 0
    np.testing.assert_allclose(moved.film_axis_rad, 0.2 + np.pi / 2, atol=1e-5)
