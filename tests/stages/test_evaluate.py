from __future__ import annotations

import numpy as np
import pytest

from pipeline.data.gratings import GratingSample, OrientationMap, PeriodMap
from pipeline.errors import InputError
from pipeline.stages.evaluate.orientation import orientation
from pipeline.stages.evaluate.period import period
from pipeline.stages.evaluate.quality import quality


def sample(theta, period_um=None):
    theta = np.asarray(theta, np.float32)
    period_um = np.where(np.isfinite(theta), 1.0, np.nan) if period_um is None else period_um
    return GratingSample(theta, np.asarray(period_um, np.float32), 0.01, 0.1, 1.1, 0.8, 0.0, 0.0, 0.03, "test")


def orientation_map(theta, correlation=0.9):
    theta = np.asarray(theta, np.float32)
    mask = np.isfinite(theta)
    return OrientationMap(theta, np.where(mask, np.float32(correlation), np.nan), np.ones_like(theta), mask)


def test_one_offset_is_removed_whatever_it_is():
    truth = np.linspace(0, 3.1, 400).reshape(20, 20)
    for offset_deg in (0.0, 40.0, 179.0):
        found = orientation(orientation_map(np.mod(truth + np.deg2rad(offset_deg), np.pi)), sample(truth))
        assert found.metrics["orientation_error_mean_deg"] < 1e-3
        assert (found.metrics["offset_deg"] - offset_deg + 90) % 180 - 90 == pytest.approx(0, abs=1e-3)
        assert found.offset_rad == pytest.approx(np.deg2rad(found.metrics["offset_deg"]))
        assert -90 <= found.metrics["offset_deg"] < 90


def test_the_figures_are_those_of_the_absolute_error():
    truth = np.ones((10, 10))
    wrong = np.deg2rad(np.r_[np.zeros(60), np.full(20, 4.0), np.full(20, -6.0)]).reshape(10, 10)
    found = orientation(orientation_map(truth + wrong + 0.5), sample(truth))
    absolute = np.r_[np.zeros(60), np.full(20, 4.0), np.full(20, 6.0)]
    assert found.metrics["orientation_error_mean_deg"] == pytest.approx(absolute.mean(), abs=1e-4)
    assert found.metrics["orientation_error_std_deg"] == pytest.approx(absolute.std(), abs=1e-4)
    assert found.metrics["orientation_error_median_deg"] == pytest.approx(0, abs=1e-4)
    assert found.metrics["orientation_error_p95_deg"] == pytest.approx(6, abs=1e-4)
    np.testing.assert_allclose(found.error_rad, wrong, atol=1e-6)


def test_the_error_is_signed_estimate_minus_truth_across_the_wrap():
    truth = np.full((5, 5), np.deg2rad(179.0))
    estimate = truth.copy()
    estimate[0, 0] = np.deg2rad(2.0)
    found = orientation(orientation_map(estimate), sample(truth))
    assert np.rad2deg(found.error_rad[0, 0]) == pytest.approx(3, abs=1e-4)


def test_an_absolute_map_is_judged_with_its_offset():
    truth = np.full((6, 6), 1.0)
    found = orientation(orientation_map(truth + np.deg2rad(2)), sample(truth), keep_offset=True)
    assert found.metrics["orientation_error_mean_deg"] == pytest.approx(2, abs=1e-4)
    assert found.metrics["offset_deg"] == pytest.approx(2, abs=1e-4)
    assert found.offset_rad == 0


def test_missing_and_false_pixels_are_counted():
    truth = np.full((10, 10), 1.0)
    truth[:2] = np.nan
    estimate = np.full((10, 10), 1.2)
    estimate[:1] = np.nan
    estimate[8:] = np.nan
    found = orientation(orientation_map(estimate), sample(truth))
    assert found.metrics["masked_share_percent"] == pytest.approx(100 * 20 / 80)
    assert found.metrics["falsely_kept_percent"] == pytest.approx(100 * 10 / 70)
    assert found.metrics["correlation_mean"] == pytest.approx(0.9)
    assert np.isnan(found.error_rad[[0, 1, 9]]).all()


def test_a_finer_truth_is_read_at_the_pixel_centres():
    fine = np.zeros((9, 15), np.float32)
    fine[1::3, 1::3] = np.arange(15).reshape(3, 5) / 10
    found = orientation(orientation_map(fine[1::3, 1::3] + 0.3), sample(fine))
    assert found.metrics["orientation_error_mean_deg"] < 1e-4
    metrics = period(
        PeriodMap(fine[1::3, 1::3] + 1.1, np.ones((3, 5), bool)), sample(np.ones((9, 15)), period_um=fine + 1)
    ).metrics
    expected = 100 * np.mean(0.1 / (1 + np.arange(15) / 10))
    assert metrics["period_error_mean_percent"] == pytest.approx(expected, rel=1e-4)
    assert metrics["period_bias_percent"] > 0


@pytest.mark.parametrize("shape", [(20, 20), (15, 10), (9, 9), (4, 5)])
def test_a_truth_that_does_not_fit_is_refused(shape):
    truth = sample(np.ones(shape))
    with pytest.raises(InputError, match="does not lie on a map of"):
        orientation(orientation_map(np.ones((5, 5))[:, :4]), truth)
    with pytest.raises(InputError, match="does not lie on a map of"):
        period(PeriodMap(np.ones((5, 4), np.float32), np.ones((5, 4), bool)), truth)


def test_maps_that_share_nothing_are_refused():
    truth = np.full((4, 4), np.nan)
    truth[0] = 1
    estimate = np.full((4, 4), np.nan)
    estimate[3] = 1
    with pytest.raises(InputError, match="share no diffracting pixel"):
        orientation(orientation_map(estimate), sample(truth))
    with pytest.raises(InputError, match="share no diffracting pixel"):
        period(PeriodMap(estimate.astype(np.float32), np.isfinite(estimate)), sample(truth))


def test_a_correlation_that_is_not_known_is_left_out():
    truth = np.full((6, 6), 1.0)
    estimate = orientation_map(truth, np.nan)
    assert set(quality(estimate).metrics) == {"diffracting_share_percent"}
    assert "correlation_mean" not in orientation(estimate, sample(truth)).metrics


def test_quality_needs_no_truth():
    theta = np.full((10, 10), 1.0)
    theta[:4] = np.nan
    metrics = quality(orientation_map(theta, 0.95)).metrics
    assert metrics["correlation_mean"] == pytest.approx(0.95)
    assert metrics["diffracting_share_percent"] == pytest.approx(60)
