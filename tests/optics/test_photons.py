"""Counts of photons: the Poisson distribution, drawn so that a last bit of the light stays where it is."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from pipeline.optics.imaging import sensor_signal
from pipeline.optics.photons import photon_counts

DRAWS = 400_000
MEANS = [0.1, 0.7, 3.0, 12.0, 29.9, 30.1, 75.0, 400.0, 1e4, 1e5]


class Deviates:
    """A generator that hands out given normal deviates."""

    def __init__(self, deviates: np.ndarray) -> None:
        self.deviates = deviates

    def standard_normal(self, shape: tuple[int, ...]) -> np.ndarray:
        return self.deviates.reshape(shape)


@pytest.mark.parametrize("mean", MEANS)
def test_mean_variance_and_skewness_are_the_poisson_distributions(mean: float) -> None:
    counts = photon_counts(np.full(DRAWS, mean), np.random.default_rng(1))
    expected = stats.poisson.stats(mean, moments="mvsk")
    error = np.sqrt(np.array([mean, mean * (1 + 2 * mean)]) / DRAWS)
    assert counts.mean() == pytest.approx(expected[0], abs=4 * error[0])
    assert counts.var() == pytest.approx(expected[1], abs=4 * error[1])
    assert stats.skew(counts) == pytest.approx(expected[2], abs=4 * np.sqrt((6 + 10 / mean + 1 / mean**2) / DRAWS))


@pytest.mark.parametrize("mean", MEANS)
def test_counts_are_distributed_as_scipys(mean: float) -> None:
    counts = photon_counts(np.full(DRAWS, mean), np.random.default_rng(2))
    bins = np.unique(stats.poisson.ppf(np.linspace(0.001, 0.999, 60), mean))
    edges = np.concatenate([[-1], bins, [np.inf]])
    found = np.diff(np.searchsorted(np.sort(counts), edges, side="right"))
    expected = np.diff(stats.poisson.cdf(edges, mean)) * DRAWS
    assert stats.chisquare(found, expected * found.sum() / expected.sum()).pvalue > 1e-3


@pytest.mark.parametrize("mean", MEANS)
def test_each_deviate_names_its_quantile(mean: float) -> None:
    deviates = np.linspace(-5, 5, 100_001)
    counts = photon_counts(np.full(deviates.shape, mean), Deviates(deviates))  # type: ignore[arg-type]
    expected = stats.poisson.ppf(stats.norm.cdf(deviates), mean)
    weight = stats.norm.pdf(deviates)
    assert np.abs(counts - expected).max() <= 1
    assert weight[counts != expected].sum() / weight.sum() < 2e-4


def test_no_light_gives_no_electrons_and_bright_light_does_not_overflow() -> None:
    rng = np.random.default_rng(0)
    np.testing.assert_array_equal(photon_counts(np.zeros((3, 4), np.float32), rng), np.zeros((3, 4)))
    assert photon_counts(np.full(1000, 1e9), rng).mean() == pytest.approx(1e9, rel=1e-5)


def test_a_last_bit_of_the_light_moves_few_pixels_by_one_step_of_the_converter() -> None:
    light = np.random.default_rng(0).uniform(0, 0.9, (300, 300)).astype(np.float32)
    light[::7] *= np.float32(1e-3)
    nudge = np.random.default_rng(1).uniform(-1e-7, 1e-7, light.shape)

    def photographed(exposure: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return sensor_signal(
            exposure.astype(np.float32),
            full_well_electrons=25_000,
            read_noise_electrons=5,
            shot_noise=True,
            bits=14,
            rng=np.random.default_rng(5),
        )

    (then, burnt), (now, also_burnt) = photographed(light), photographed(light * (1 + nudge))
    assert 0 < np.count_nonzero(then != now) < 1e-3 * then.size
    assert np.abs(then.astype(np.float64) - now).max() <= 1 / (2**14 - 1) + 6e-8
    np.testing.assert_array_equal(burnt, also_burnt)
