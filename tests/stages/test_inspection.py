"""Items compared with a reference: what is found, what it is called, and what is not found because it is not there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from polarization import OVER, photographed

from pipeline.data.gratings import GratingSample, OrientationMap
from pipeline.data.inspection import Defects, Inspection
from pipeline.errors import InputError, InputErrors
from pipeline.stages.evaluate.defects import defects as compared_with_truth
from pipeline.stages.evaluate.inspection import inspection
from pipeline.stages.extract.relative_period import relative_period
from pipeline.stages.fit.cosine import cosine
from pipeline.stages.simulate.damaged import damaged
from pipeline.stages.simulate.defects import defects
from pipeline.stages.simulate.laid_down import laid_down
from pipeline.stages.simulate.logo import logo

PIXEL_MM = 0.02
ANGLES = np.arange(8) * np.pi / 8


@pytest.fixture(scope="module")
def sample() -> GratingSample:
    return logo(width_mm=3.6, margin_mm=0.2, pixel_mm=PIXEL_MM / OVER, retardation_deg=0.0)


def fitted(sample: GratingSample, seed: int, *, electrons: float = 20_000) -> OrientationMap:
    photos = photographed(sample.orientation_rad, sample.period_um, ANGLES, electrons=electrons, seed=seed)
    return cosine(photos, prenormalize=False)


@pytest.fixture(scope="module")
def golden(sample) -> OrientationMap:
    return fitted(sample, 100)


LISTED = [
    {"kind": "missing", "x_mm": 0.75, "y_mm": 0.4, "size_mm": 0.16},
    {"kind": "turned", "x_mm": -0.75, "y_mm": 0.45, "size_mm": 0.2, "turn_deg": -8.0},
    {"kind": "period", "x_mm": -0.7, "y_mm": -0.35, "size_mm": 0.2, "period_factor": 0.9},
    {"kind": "scratch", "x_mm": 0.8, "y_mm": -0.35, "size_mm": 0.6, "direction_deg": 30.0},
]


@pytest.fixture(scope="module")
def truth(sample) -> Defects:
    return defects(sample, listed=LISTED)


@pytest.fixture(scope="module")
def found(sample, golden, truth) -> Inspection:
    item = laid_down(damaged(sample, truth), x_mm=0.11, y_mm=-0.07, turn_deg=4.0)
    return inspection(golden, fitted(item, 1))


def test_how_the_item_lies_is_found(found) -> None:
    np.testing.assert_allclose(found.shift_mm, [0.11, -0.07], atol=0.001)
    assert np.rad2deg(found.turn_rad) == pytest.approx(4.0, abs=0.02)
    assert np.rad2deg(found.offset_rad) == pytest.approx(0, abs=0.1)


def test_each_defect_is_found_once_and_called_by_its_name(found, truth) -> None:
    metrics = compared_with_truth(found, truth).metrics
    assert (metrics["defects_found"], metrics["false_alarms"]) == (4, 0)
    assert sorted(found.defects.kind) == ["missing", "period", "scratch", "turned"]
    assert metrics["kind_right_percent"] == 100
    assert metrics["position_error_max_mm"] < 2 * PIXEL_MM
    assert metrics["area_error_mean_percent"] < 30
    assert metrics["turn_error_mean_deg"] < 0.5
    assert metrics["period_ratio_error_mean_percent"] < 1


def test_turn_and_period_are_those_of_the_item_against_the_reference(found) -> None:
    at = {kind: i for i, kind in enumerate(found.defects.kind)}
    assert np.rad2deg(found.defects.turn_rad[at["turned"]]) == pytest.approx(-8, abs=0.5)
    assert found.defects.period_ratio[at["period"]] == pytest.approx(0.9, abs=0.01)
    assert np.isnan(found.defects.turn_rad[at["missing"]])


def test_with_the_two_items_exchanged_what_was_missing_is_extra(sample, golden) -> None:
    # A hole in the reference is a grating too many in the item.
    item = fitted(damaged(sample, defects(sample, listed=[{**LISTED[0], "size_mm": 0.3}, *LISTED[1:3]])), 1)
    exchanged = inspection(item, golden).defects
    extra = exchanged.kind.index("extra")
    np.testing.assert_allclose(exchanged.centre_mm[extra], [0.75, 0.4], atol=PIXEL_MM)
    assert np.rad2deg(exchanged.turn_rad[exchanged.kind.index("turned")]) == pytest.approx(8, abs=0.5)
    assert exchanged.period_ratio[exchanged.kind.index("period")] == pytest.approx(1 / 0.9, abs=0.012)


@pytest.mark.parametrize("seed", range(6))
def test_an_item_without_defects_has_none(sample, golden, seed) -> None:
    random = np.random.default_rng(seed)
    x, y, turn = (float(v) for v in random.uniform([-0.15, -0.15, -15], [0.15, 0.15, 15]))
    item = fitted(laid_down(sample, x_mm=x, y_mm=y, turn_deg=turn), seed, electrons=20_000 if seed % 2 else 1500)
    result = inspection(golden, item)
    assert result.defects.kind == ()
    assert result.metrics["defects"] == 0
    np.testing.assert_allclose(result.shift_mm, [x, y], atol=0.002)


def test_a_missing_facet_is_missing_and_no_scratch(sample, golden) -> None:
    narrow = defects(sample, listed=[{"kind": "missing", "x_mm": 1.55, "y_mm": 0.5}])
    kinds = inspection(golden, fitted(damaged(sample, narrow), 2)).defects.kind
    assert kinds == ("missing",)


def test_a_turn_within_the_tolerance_is_no_defect(sample, golden) -> None:
    plan = defects(sample, listed=[{"kind": "turned", "x_mm": 0.0, "y_mm": 0.0, "turn_deg": 2.0}])
    item = fitted(damaged(sample, plan), 3)
    assert inspection(golden, item).defects.kind == ("turned",)
    assert inspection(golden, item, least_turn_deg=3.0).defects.kind == ()


def test_an_offset_of_the_whole_map_is_no_defect_and_is_told(golden, sample) -> None:
    item = fitted(sample, 4)
    turned = replace(item, orientation_rad=np.mod(item.orientation_rad + np.float32(0.6), np.float32(np.pi)))
    result = inspection(golden, turned)
    assert result.defects.kind == ()
    assert result.offset_rad == pytest.approx(0.6, abs=0.005)
    difference = np.abs(np.angle(np.exp(2j * (result.suspect.orientation_rad - golden.orientation_rad)))) / 2
    assert np.rad2deg(np.nanmedian(difference)) < 1


def test_a_factor_of_all_periods_is_no_defect(golden, sample) -> None:
    item = fitted(sample, 4)
    period = relative_period(item, median_radius=0)
    longer = replace(period, period_um=period.period_um * np.float32(1.2))
    assert inspection(golden, item, relative_period(golden, median_radius=0), longer).defects.kind == ()


def test_period_maps_say_what_brightness_says(golden, sample, truth) -> None:
    item = fitted(damaged(sample, truth), 1)
    by_brightness = inspection(golden, item).defects
    by_maps = inspection(
        golden, item, relative_period(golden, median_radius=0), relative_period(item, median_radius=0)
    ).defects
    assert sorted(by_maps.kind) == sorted(by_brightness.kind)
    ratio = [d.period_ratio[d.kind.index("period")] for d in (by_brightness, by_maps)]
    assert ratio[1] == pytest.approx(ratio[0], abs=0.002)


def test_without_a_correlation_the_noise_comes_from_the_scatter(golden, sample, truth) -> None:
    unknown = [
        replace(m, correlation=np.full_like(m.correlation, np.nan)) for m in (golden, fitted(damaged(sample, truth), 1))
    ]
    assert sorted(inspection(*unknown).defects.kind) == ["missing", "period", "scratch", "turned"]


def test_what_the_photograph_does_not_show_is_neither_judged_nor_missing(golden, sample) -> None:
    item = fitted(sample, 5)
    left = OrientationMap(
        *(m[:, :120] for m in (item.orientation_rad, item.correlation, item.intensity, item.mask)), item.pixel_mm
    )
    result = inspection(golden, left)
    assert result.defects.kind == ()
    assert result.metrics["judged_percent"] < 60
    assert np.isnan(result.significance[:, 125:]).all()


def test_impossible_input_is_refused(golden, sample) -> None:
    with pytest.raises(InputError, match="pixel pitch of the reference is not known"):
        inspection(replace(golden, pixel_mm=None), golden)
    random = np.random.default_rng(0)
    other = replace(
        golden,
        orientation_rad=np.where(golden.mask, random.uniform(0, np.pi, golden.mask.shape), np.nan).astype(np.float32),
    )
    with pytest.raises(InputError, match="the two maps agree to"):
        inspection(golden, other)
    with pytest.raises(InputError, match="nothing diffracts in the suspect"):
        inspection(golden, replace(golden, mask=np.zeros_like(golden.mask)))
    period = relative_period(golden)
    small = replace(period, mask=period.mask[:50], period_um=period.period_um[:50])
    with pytest.raises(InputError, match="the suspect's maps are of"):
        inspection(golden, golden, period, small)
    with pytest.raises((InputError, InputErrors), match="false_alarms is 0"):
        inspection(golden, golden, false_alarms=0.0)


def listed(labels: np.ndarray, kinds: tuple[str, ...], pixel_mm: float) -> Defects:
    count = len(kinds)
    centre, area = np.zeros((count, 2)), np.zeros(count)
    for k in range(count):
        down, right = np.nonzero(labels == k + 1)
        centre[k] = (
            (right.mean() - (labels.shape[1] - 1) / 2) * pixel_mm,
            ((labels.shape[0] - 1) / 2 - down.mean()) * pixel_mm,
        )
        area[k] = len(down) * pixel_mm**2
    return Defects(
        kinds, centre, area, np.sqrt(area), np.full(count, 0.1), np.ones(count), np.ones(count), labels, pixel_mm
    )


def test_the_truth_counts_hits_misses_and_false_alarms(found) -> None:
    fine = np.zeros((60, 60), np.int32)
    fine[6:15, 6:15], fine[30:33, 30:33], fine[45:54, 6:15] = 1, 2, 3
    coarse = np.zeros((20, 20), np.int32)
    coarse[2:5, 3:6] = 1  # one pixel to the right of the first
    coarse[15:18, 2:4], coarse[15:18, 4:5] = 2, 3  # two parts of the third
    coarse[2:4, 15:17] = 4
    kinds = ("turned", "missing", "missing", "turned")
    result = replace(found, defects=listed(coarse, kinds, 0.3))
    metrics = compared_with_truth(result, listed(fine, ("turned", "scratch", "turned"), 0.1), near_px=0.0).metrics
    assert metrics["defects_drawn"] == 3
    assert metrics["defects_found"] == 2
    assert metrics["defects_missed"] == 1
    assert metrics["false_alarms"] == 1
    assert metrics["found_percent"] == pytest.approx(200 / 3)
    assert metrics["missed_largest_mm"] == pytest.approx(0.3)
    assert metrics["found_smallest_mm"] == pytest.approx(0.9)
    assert metrics["kind_right_percent"] == 50
    assert metrics["position_error_max_mm"] == pytest.approx(0.3)
    assert metrics["area_error_mean_percent"] == pytest.approx(100 * (0 + 1 / 3) / 2)
    with pytest.raises(InputError, match="do not lie on a map of"):
        compared_with_truth(result, listed(fine[:40, :40], ("turned", "scratch"), 0.1))
