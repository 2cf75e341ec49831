"""Differences against their noise, and regions of them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from pipeline.optics.deviation import SCALES_PX, calibrated, deviation, expected_extreme, extents
from pipeline.optics.regions import described, disc, joined

SIZE = 200


def noise(seed: int = 0, sigma: float = 1.0) -> np.ndarray:
    return np.random.default_rng(seed).normal(0, sigma, (SIZE, SIZE)).astype(np.float32)


def patch(radius: float, row: int = 100, column: int = 90) -> np.ndarray:
    rows, columns = np.mgrid[:SIZE, :SIZE]
    return (rows - row) ** 2 + (columns - column) ** 2 <= radius**2


def found(difference: np.ndarray, judged: np.ndarray | None = None, least: float = 0.0):
    judged = np.ones(difference.shape, bool) if judged is None else judged
    result = deviation(difference, np.ones_like(difference), judged)
    limit = expected_extreme(int(judged.sum()), 0.01)
    return result, extents(result, limit, least)


def test_the_threshold_is_the_gaussian_tail() -> None:
    limit = expected_extreme(10_000, 0.01)
    assert 2 * norm.sf(limit) * 10_000 * len(SCALES_PX) == pytest.approx(0.01)


def test_noise_of_known_shape_is_scaled_to_its_scatter() -> None:
    shape = np.linspace(0.5, 2, SIZE * SIZE, dtype=np.float32).reshape(SIZE, SIZE)
    assert calibrated(3 * shape * noise(), shape, np.ones((SIZE, SIZE), bool)) == pytest.approx(3, rel=0.02)


def test_means_scatter_as_their_deviations_say_at_every_scale() -> None:
    result, _ = found(noise())
    inner = (slice(30, -30), slice(30, -30))
    for mean, spread in zip(result.means, result.deviations, strict=True):
        assert np.std(mean[inner] / spread[inner]) == pytest.approx(1, abs=0.15)


def test_correlated_noise_stretches_the_deviations() -> None:
    rows = np.repeat(noise()[:50, :], 4, axis=0)  # each row four times over
    result, area = found(rows.astype(np.float32))
    assert result.inflation > 1.7
    assert not area.any()


def test_noise_alone_gives_no_region_in_fifty_maps() -> None:
    assert sum(found(noise(seed))[1].any() for seed in range(50)) <= 2


@pytest.mark.parametrize(("radius", "height"), [(3, 8.0), (8, 3.0), (25, 1.0)])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_region_is_found_whatever_its_size_with_its_area(radius: float, height: float, sign: int) -> None:
    true = patch(radius)
    _, area = found(noise() + np.float32(sign * height) * true)
    assert np.sum(area & true) > 0.75 * true.sum()
    assert np.sum(area & ~true) < 0.3 * true.sum() + 4


def test_what_is_below_the_tolerance_is_no_region() -> None:
    difference = noise() + np.float32(0.5) * patch(40)
    assert found(difference, least=0.25)[1].any()
    assert not found(difference, least=1.5)[1].any()


def test_a_strong_region_leaves_no_ring_and_hides_no_neighbour() -> None:
    strong, weak = patch(10), patch(6, 100, 120)
    _, area = found(noise() + 500 * strong.astype(np.float32) + 5 * weak.astype(np.float32))
    labels, count = joined(area)
    assert count == 2
    sizes = sorted(np.bincount(labels.ravel())[1:].tolist())
    assert sizes[0] == pytest.approx(weak.sum(), rel=0.35)
    assert sizes[1] == pytest.approx(strong.sum(), rel=0.05)


def test_pixels_that_are_not_judged_count_for_nothing() -> None:
    judged = ~patch(12)
    _, area = found(noise() + 1e6 * (~judged).astype(np.float32), judged)
    assert not area.any()


def test_the_significance_of_an_area_is_that_of_its_mean() -> None:
    true = patch(20)
    result, _ = found(noise() + 2 * true.astype(np.float32))
    mean, significance = result.over(true)
    assert mean == pytest.approx(2, abs=0.1)
    assert significance == pytest.approx(mean * np.sqrt(true.sum()) / result.inflation)
    assert np.isnan(result.over(np.zeros_like(true))[0])


def test_a_disc_has_its_area_width_and_centre() -> None:
    labels = patch(40, 60, 130).astype(np.int32)
    region = described(labels, 1, 0.1)
    assert region.area_mm2[0] == pytest.approx(np.pi * 4.0**2, rel=0.01)
    assert region.width_mm[0] == pytest.approx(8.1, abs=0.1)
    np.testing.assert_allclose(region.centre_mm[0], [(130 - 99.5) * 0.1, (99.5 - 60) * 0.1], atol=1e-9)
    assert region.elongation[0] == pytest.approx(4 / np.pi, rel=0.05)


def test_a_line_is_as_wide_as_its_diagonal() -> None:
    labels = np.zeros((50, 50), np.int32)
    labels[10, 5:35] = 1
    assert described(labels, 1, 1.0).width_mm[0] == pytest.approx(np.hypot(30, 1))


def test_parts_are_joined_over_a_gap_and_not_over_a_wider_one() -> None:
    area = np.zeros((20, 40), bool)
    area[8:12, 5:10] = area[8:12, 13:18] = area[8:12, 30:35] = True
    assert joined(area)[1] == 3
    labels, count = joined(area, 4.0)
    assert count == 2
    assert np.array_equal(labels > 0, area)
    assert disc(2.0).sum() == 13
