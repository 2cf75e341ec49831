"""Half vectors under a flash, and the lobes that gratings show there."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from pipeline.optics.flash.constancy import blocks_of, common_variation, error_of_common, verdict
from pipeline.optics.flash.distribution import Bins, sharpened
from pipeline.optics.flash.highlight import bright_spot
from pipeline.optics.flash.lobes import (
    half_vectors,
    light_above,
    light_sigma,
    light_variance,
    mirror_point,
    point_variance,
)
from pipeline.optics.flash.next_light import BINS, directions_seen
from pipeline.optics.flash.periods import Orders, order_sum

place = st.floats(-150, 150)
height = st.floats(80, 600)


@given(place, place, height, place, place, height)
def test_the_half_vector_is_upright_where_a_mirror_shows_the_light(
    x: float, y: float, z: float, u: float, v: float, w: float
) -> None:
    light, eye = np.array([x, y, z]), np.array([u, v, w])
    half = half_vectors(*mirror_point(light, eye), light, eye)
    assert half.length == pytest.approx(0, abs=1e-12)


@given(place, place, height, place, place, height)
def test_a_light_is_found_again_from_its_mirror_image_and_height(
    x: float, y: float, z: float, u: float, v: float, w: float
) -> None:
    light, eye = np.array([x, y, z]), np.array([u, v, w])
    np.testing.assert_allclose(light_above(mirror_point(light, eye), z, eye), light, atol=1e-9)


def test_light_and_eye_in_one_place_see_twice_the_sine() -> None:
    above = np.array([0.0, 0.0, 300.0])
    half = half_vectors(400.0, 0.0, above, above)
    assert (half.x, half.y, half.w) == pytest.approx((-2 * 0.8, 0.0, 2 * 0.6))
    # (1 + 1)^2 / (cos (2 cos)^2) over the square of half a metre.
    assert half.gain == pytest.approx(4 / (0.6 * 1.2**2) * 4)


def test_gain_is_stam_s_geometry_for_a_light_and_an_eye_apart() -> None:
    """The light's cosine cancels, the eye's does not."""
    half = half_vectors(0.0, 0.0, np.array([0.0, 0.0, 200.0]), np.array([300.0, 0.0, 400.0]))
    assert half.gain == pytest.approx((1 + 0.8) ** 2 / (0.8 * (1 + 0.8) ** 2) * 25)


def test_a_pixel_spreads_a_lobe_as_an_even_box_does() -> None:
    half = half_vectors(0.0, 0.0, np.array([0.0, 0.0, 250.0]), np.array([0.0, 0.0, 500.0]))
    box = point_variance(half, coherence_um=1e9, wavelength_um=0.53, pixel_mm=3.0)
    assert box == pytest.approx((3 * (1 / 250 + 1 / 500)) ** 2 / 12, rel=1e-6)


def test_a_lobe_is_as_wide_as_the_light_is_seen_and_its_size_follows_from_it() -> None:
    half = half_vectors(0.0, 0.0, np.array([0.0, 0.0, 250.0]), np.array([0.0, 0.0, 500.0]))
    variance = light_variance(half, 5.0) + point_variance(half, coherence_um=65.0, wavelength_um=0.53, pixel_mm=0.0)
    window = 0.53 / (2 * np.pi * np.sqrt(2) * 65 / 4)
    assert variance == pytest.approx(0.02**2 + window**2)
    spread = float(np.sqrt(variance))
    assert light_sigma(spread, light_mm=250.0, coherence_um=65.0, wavelength_um=0.53) == pytest.approx(5.0)


@pytest.mark.parametrize(
    ("light", "eye", "part"),
    [((0.0, 150.0, 200.0), (0.0, 100.0, 500.0), 1.0), ((150.0, 0.0, 200.0), (-300.0, 240.0, 320.0), 1 - 0.6**2)],
)
def test_a_light_is_foreshortened_by_its_slant_across_the_half_vector(
    light: tuple[float, float, float], eye: tuple[float, float, float], part: float
) -> None:
    """Half vectors point along y in both; the light stands aslant along them, and at (0.6, 0, 0.8) across them."""
    half = half_vectors(0.0, 0.0, np.array(light), np.array(eye))
    assert half.x == pytest.approx(0.0)
    assert light_variance(half, 5.0) == pytest.approx(part * (5 / 250) ** 2)


def test_orders_lie_where_the_grating_equation_puts_them_and_keep_their_light() -> None:
    u, v = np.meshgrid(np.linspace(-0.5, 0.5, 801), np.linspace(-0.2, 0.2, 321))
    shares = np.zeros((3, *u.shape))
    shares[1] = 1.0
    seen = order_sum(u, v, (np.full(u.shape, 0.02**2), np.full(u.shape, 0.02**2)), shares, 2.0, Orders(0.53, 0.004))
    ahead = np.where(u > 0, seen, 0)
    assert (ahead * u).sum() / ahead.sum() == pytest.approx(0.53 / 2, rel=1e-6)
    assert (ahead * u**2).sum() / ahead.sum() - (0.53 / 2) ** 2 == pytest.approx(0.02**2 + 0.002**2, rel=1e-4)
    cell = (u[0, 1] - u[0, 0]) * (v[1, 0] - v[0, 0])
    assert seen.sum() * cell == pytest.approx(2 * 2 * np.pi, rel=1e-6)


def test_a_spot_is_measured_through_a_pattern() -> None:
    row, column = np.mgrid[:240, :320]
    spot = np.exp(-((column - 130.4) ** 2 + (row - 88.7) ** 2) / (2 * 14.0**2))
    pattern = 1 + 0.5 * np.sin(column / 1.7) * np.sin(row / 2.1)
    assert bright_spot(spot * pattern, 3.0) == pytest.approx((130.4, 88.7, 14.0), abs=0.2)


def test_what_two_measurements_share_is_told_from_their_errors() -> None:
    rng = np.random.default_rng(5)
    blocks = np.repeat(np.arange(64), 50)

    def measured(real: float) -> tuple[float, float]:
        period = 1.5 * (1 + real * rng.standard_normal(64))[blocks]
        first, second = (period * (1 + 0.05 * rng.standard_normal(period.size)) for _ in range(2))
        return common_variation(first, second, blocks)

    scatter, errors = measured(0.03)
    assert scatter == pytest.approx(0.03, rel=0.25)
    assert errors > 3
    scatter, errors = measured(0.0)
    assert scatter < 0.005
    assert abs(errors) < 3


def test_variation_that_is_not_there_lies_about_one_standard_error_from_none() -> None:
    rng = np.random.default_rng(9)
    blocks = np.repeat(np.arange(64), 20)
    errors = [common_variation(*(1.5 * (1 + 0.02 * rng.standard_normal((2, 1280)))), blocks)[1] for _ in range(100)]
    assert np.std(errors) == pytest.approx(1.0, abs=4 / np.sqrt(2 * 100))
    assert np.mean(errors) == pytest.approx(0.0, abs=4 / np.sqrt(100))


def test_a_few_pixels_that_two_measurements_mistake_alike_are_no_variation() -> None:
    rng = np.random.default_rng(6)
    blocks = np.repeat(np.arange(64), 50)
    real = 1.5 * (1 + 0.02 * rng.standard_normal(64))[blocks]
    real[rng.choice(real.size, 32, replace=False)] /= 2
    scatter, errors = common_variation(*(real * (1 + 0.01 * rng.standard_normal((2, real.size)))), blocks)
    assert scatter == pytest.approx(0.02, rel=0.3)
    assert errors > 3


@pytest.mark.parametrize(
    ("percent", "error", "residual", "constant"),
    [(0.0, 0.01, 0.1, True), (4.0, 0.01, 0.1, False), (0.7, 0.01, 0.1, True), (0.0, 0.01, 0.3, False)],
)
def test_one_period_will_do_unless_pixels_vary_or_it_explains_too_little(
    percent: float, error: float, residual: float, constant: bool
) -> None:
    rng = np.random.default_rng(7)
    real = 1.5 * (1 + percent / 100 * rng.standard_normal((32, 32)))
    period = real * (1 + error * rng.standard_normal((3, 32, 32)))
    judged = verdict(np.stack([period, error * period], axis=1), residual, 1.0)
    assert judged.constant is constant
    assert judged.percent == pytest.approx(percent, abs=0.3)


def test_pixels_that_are_not_measured_twice_tell_no_variation() -> None:
    period = 1.5 * np.ones((3, 2, 8, 8))
    period[:, 1] = 0.01
    period[2, 1, 1:] = 0.2
    judged = verdict(period, 0.1, 1.0)
    assert np.isnan(judged.percent)
    assert "Whether periods vary is not told" in judged.words


def test_the_error_of_one_period_is_that_of_a_mean_of_blocks() -> None:
    blocks = np.random.default_rng(8).standard_normal(64)
    period = 1.5 + 0.01 * blocks[blocks_of((32, 24))]
    assert error_of_common(period) == pytest.approx(0.01 * np.std(blocks, ddof=1) / 8)
    assert np.isnan(error_of_common(np.where(blocks_of((32, 24)) == 0, 1.5, np.nan)))


def test_directions_count_as_seen_around_half_vectors_that_light_gratings() -> None:
    azimuth, length = np.deg2rad([[10.0, 100.0], [190.0, 60.0]]), np.array([[0.3, 0.9], [0.3, np.nan]])
    seen = directions_seen(azimuth, length, np.deg2rad(6.0), (0.2, 0.5))
    middle = (np.arange(BINS) + 0.5) * 180 / BINS
    assert seen[0].tolist() == (abs(middle - 10.5) < 7.5).tolist()
    assert not seen[1].any()


@pytest.mark.parametrize("second", [0.0, 0.1])
def test_a_distribution_is_found_again_from_the_sum_of_its_lobes(second: float) -> None:
    bins = Bins(36, 24, 1.0, 2.2)
    theta, a = np.meshgrid(bins.orientation_rad, bins.period_um, indexing="ij")
    share = np.exp(-(((a - 1.2 - 0.7 * theta / np.pi) / 0.1) ** 2) / 2)
    share /= share.sum()
    variance = np.full(share.shape, 0.01**2)
    brightness = 3.0 * seen_of(share, theta, a, variance, second)
    found, told = sharpened(brightness, np.ones(share.shape, bool), variance, 0.53, bins, 60)
    assert 0.5 * np.abs(found - share).sum() < 0.15
    assert told == pytest.approx(second, abs=0.051)
    assert found.sum() == pytest.approx(1.0)


def seen_of(
    share: NDArray[np.float64],
    theta: NDArray[np.float64],
    a: NDArray[np.float64],
    variance: NDArray[np.float64],
    second: float,
) -> NDArray[np.float64]:
    """Each grating's first and second orders on both sides, added up one grating after another."""
    x, y = 0.53 / a * np.cos(theta), 0.53 / a * np.sin(theta)
    total = np.zeros(share.shape)
    for part, cx, cy in zip(share.flat, x.flat, y.flat, strict=True):
        for order, strength in ((1, 1.0), (-1, 1.0), (2, second), (-2, second)):
            square = (x - order * cx) ** 2 + (y - order * cy) ** 2
            total += part * strength * np.exp(-square / (2 * variance)) / (2 * np.pi * variance)
    return total
