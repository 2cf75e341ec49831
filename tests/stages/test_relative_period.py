from __future__ import annotations

import logging

import numpy as np
import pytest
from polarization import OVER, at_centres, facets, photographed

from pipeline.data.gratings import GratingSample, OrientationMap
from pipeline.errors import InputError
from pipeline.stages.evaluate.period import period as evaluate_period
from pipeline.stages.extract.relative_period import relative_period
from pipeline.stages.fit.cosine import cosine


def brightness(intensity, mask=None):
    intensity = np.asarray(intensity, np.float32)
    mask = np.ones(intensity.shape, bool) if mask is None else mask
    return OrientationMap(np.zeros_like(intensity), np.ones_like(intensity), intensity, mask)


def test_a_quarter_of_the_light_is_half_the_period():
    intensity = np.repeat([[0.8, 0.2]], 40, axis=0).repeat(20, axis=1)
    found = relative_period(brightness(intensity), longest_um=1.4)
    np.testing.assert_allclose(found.period_um[:, :18], 1.4, rtol=0.003)
    np.testing.assert_allclose(found.period_um[:, 22:], 0.7, rtol=0.003)
    assert found.relative


def test_dust_and_noise_do_not_set_the_longest_period(caplog):
    rng = np.random.default_rng(0)
    intensity = np.where(np.arange(100) < 60, 0.4, 0.7) * (1 + 0.02 * rng.standard_normal((100, 100)))
    intensity[rng.random((100, 100)) < 0.005] = 1.0
    with caplog.at_level(logging.INFO):
        found = relative_period(brightness(intensity), longest_um=1.0, median_radius=0)
    assert np.median(found.period_um[:, 65:]) == pytest.approx(1.0, abs=0.005)
    assert "brightest mode" in caplog.text


def test_periods_that_vary_continuously_take_the_percentile(caplog):
    root = np.linspace(0.3, 0.9, 200) * np.ones((50, 1))
    with caplog.at_level(logging.INFO):
        found = relative_period(brightness(root**2), longest_um=1.5, median_radius=0)
    np.testing.assert_allclose(found.period_um, 1.5 * root / np.percentile(root, 99), rtol=1e-3)
    assert "no mode stands out" in caplog.text


def test_retargeting_maps_the_shortest_and_the_longest():
    intensity = np.repeat([[0.9, 0.6, 0.3]], 60, axis=0).repeat(30, axis=1)
    found = relative_period(brightness(intensity), longest_um=1.4, shortest_um=0.9)
    assert found.period_um[30, 10] == pytest.approx(1.4, rel=0.005)
    assert found.period_um[30, 80] == pytest.approx(0.9, rel=0.005)
    assert 0.9 < found.period_um[30, 45] < 1.4


def test_the_median_looks_inside_the_mask_only():
    rng = np.random.default_rng(0)
    mask = rng.random((40, 40)) > 0.5
    intensity = np.where(mask, 0.5, 0.01)
    found = relative_period(brightness(intensity, mask), longest_um=1.0)
    np.testing.assert_allclose(found.period_um[mask], 1.0, rtol=0.003)
    assert np.isnan(found.period_um[~mask]).all()


def test_the_median_is_that_of_numpy():
    rng = np.random.default_rng(1)
    intensity = rng.uniform(0.2, 0.8, (20, 23)).astype(np.float32)
    mask = rng.random((20, 23)) > 0.3
    found = relative_period(brightness(intensity, mask), median_radius=1).period_um
    reference = np.full((22, 25), np.nan)
    reference[1:-1, 1:-1] = np.where(mask, np.sqrt(intensity), np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(reference, (3, 3)).reshape(20, 23, 9)
    expected = np.nanmedian(windows[mask], axis=-1)
    scale = found[mask] / expected
    np.testing.assert_allclose(scale, scale[0], rtol=1e-5)


def test_a_photographed_scene_is_within_three_percent():
    orientation, period = facets()
    fit = cosine(photographed(orientation, period, np.arange(12) * np.pi / 12, electrons=1e4), prenormalize=False)
    truth = GratingSample(orientation, period, 0.02 / OVER, 0.1, 1.1, 0.8, 0.0, 0.0, 0.03, "facets")
    metrics = evaluate_period(relative_period(fit), truth).metrics
    assert metrics["period_error_mean_percent"] < 3
    assert metrics["period_error_median_percent"] < 0.5
    by_hand = np.abs(relative_period(fit).period_um / at_centres(period) - 1)
    assert metrics["period_error_mean_percent"] == pytest.approx(100 * np.nanmean(by_hand), rel=1e-4)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"longest_um": 0.0}, "longest_um is 0"),
        ({"shortest_um": 2.0}, r"shortest_um is 2[\s\S]*expected: below longest_um, 1.4"),
        ({"shortest_um": -1.0}, "shortest_um is -1"),
        ({"percentile": 101.0}, r"percentile is 101[\s\S]*at most 100"),
    ],
)
def test_impossible_periods_are_refused(settings, message):
    with pytest.raises(InputError, match=message):
        relative_period(brightness(np.ones((4, 4))), **settings)


def test_an_empty_mask_is_refused():
    with pytest.raises(InputError, match="no pixel diffracts"):
        relative_period(brightness(np.ones((4, 4)), np.zeros((4, 4), bool)))
