"""Distributions of gratings: drawn as sheets, read off a photograph, and drawn again."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
from flash_sheets import EYE, GREEN, photographed

from pipeline.data.flash import FlashPhotographs
from pipeline.data.flash_maps import GratingDistribution
from pipeline.data.gratings import GratingSample
from pipeline.data.pictures import PictureSeries
from pipeline.errors import InputError
from pipeline.stages.evaluate.distribution import distribution
from pipeline.stages.evaluate.macroscopic_pattern import macroscopic_pattern
from pipeline.stages.fit.highlight import highlight
from pipeline.stages.fit.orientation_period_distribution import orientation_period_distribution
from pipeline.stages.simulate.spiral import spiral
from pipeline.stages.simulate.stochastic_texture import drawn_gratings, stochastic_texture

LIGHT = [[0.0, 0.0, 250.0]]
SHEET = {"pixel_mm": 1.0, "size_mm": 1.0}


@pytest.fixture(scope="module")
def paper() -> GratingSample:
    return stochastic_texture(spiral(), **SHEET)


def seen(sample: GratingSample, band_nm: tuple[float, float] | None = None) -> FlashPhotographs:
    return photographed(sample.orientation_rad, sample.period_um, LIGHT, pixel_mm=sample.pixel_mm, band_nm=band_nm)


@pytest.fixture(scope="module")
def green(paper: GratingSample) -> FlashPhotographs:
    return seen(paper, GREEN)


@pytest.fixture(scope="module")
def white(paper: GratingSample) -> FlashPhotographs:
    return seen(paper)


@pytest.fixture(scope="module")
def measured(green: FlashPhotographs) -> GratingDistribution:
    return orientation_period_distribution(green, highlight(green))


def test_a_spiral_gives_every_orientation_the_same_share_and_its_own_period() -> None:
    made = spiral(first_um=1.2, last_um=2.0, scatter_um=0.05, turn_deg=30.0)
    np.testing.assert_allclose(made.share.sum(axis=1), 1 / 60)
    mean = (made.share * made.period_um).sum(axis=1) * 60
    turned = np.mod(made.orientation_rad - np.deg2rad(30), np.pi) / np.pi
    np.testing.assert_allclose(mean, 1.2 + 0.8 * turned, atol=0.005)


def test_gratings_are_drawn_together() -> None:
    share = np.zeros((6, 4))
    share[1, 0], share[4, 3] = 0.25, 0.75
    two = GratingDistribution(share, (np.arange(6) + 0.5) * np.pi / 6, np.array([1.0, 1.2, 1.4, 1.6]), share >= 0)
    orientation, period = drawn_gratings(two, 20_000, np.random.default_rng(3))
    first = period < 1.3
    assert first.mean() == pytest.approx(0.25, abs=4 * np.sqrt(0.25 * 0.75 / 20_000))
    assert (np.abs(np.rad2deg(orientation[first]) - 45) <= 15).all()
    assert (np.abs(np.rad2deg(orientation[~first]) - 135) <= 15).all()
    assert (np.abs(period[~first] - 1.6) <= 0.1).all()


def test_squares_lie_side_by_side_and_discs_where_chance_puts_them() -> None:
    squares = stochastic_texture(spiral(), width_mm=20.0, height_mm=10.0, pixel_mm=0.5, size_mm=2.0)
    assert squares.orientation_rad.shape == (20, 40)
    blocks = squares.period_um.reshape(5, 4, 10, 4)
    assert (blocks == blocks[:, :1, :, :1]).all()
    assert np.unique(squares.period_um).size == 50
    discs = stochastic_texture(
        spiral(), width_mm=60.0, height_mm=40.0, pixel_mm=0.25, size_mm=2.0, shape="discs", cover=1.0
    )
    # Of discs strewn at random, a share exp(-cover) of the plane stays bare; fewer reach the edge.
    assert 1 - discs.diffracts.mean() == pytest.approx(np.exp(-1.0), abs=0.05)


def test_one_green_photograph_tells_the_distribution(paper: GratingSample, measured: GratingDistribution) -> None:
    found = distribution(measured, paper).metrics
    assert found["distribution_distance_percent"] < 45
    assert found["period_by_orientation_error_median_percent"] < 2


def test_counting_spreads_it_and_white_light_makes_it_redundant(
    paper: GratingSample,
    green: FlashPhotographs,
    white: FlashPhotographs,
    measured: GratingDistribution,
    caplog: pytest.LogCaptureFixture,
) -> None:
    counted = orientation_period_distribution(green, highlight(green), method="naive")
    with caplog.at_level(logging.WARNING):
        unfiltered = orientation_period_distribution(white, highlight(white), wavelength_nm=550.0)
    assert "redundant and wrong" in caplog.text
    far = [distribution(one, paper).metrics for one in (measured, counted, unfiltered)]
    distances = [one["distribution_distance_percent"] for one in far]
    assert distances[0] < distances[1] < distances[2]
    assert far[2]["bins_filled_ratio"] > 2 * far[0]["bins_filled_ratio"]
    with pytest.raises(InputError, match="taken without a filter"):
        orientation_period_distribution(white, highlight(white))


def test_what_is_drawn_from_a_measured_distribution_shows_the_same_pattern(
    white: FlashPhotographs, measured: GratingDistribution
) -> None:
    def agreement(sample: GratingSample) -> dict[str, float]:
        made = seen(sample)
        series = PictureSeries(made.radiance, made.light_mm, EYE, sample.pixel_mm)
        return dict(macroscopic_pattern(white, series).metrics)

    again = agreement(stochastic_texture(measured, seed=1, **SHEET))
    mirrored = agreement(stochastic_texture(replace(measured, share=measured.share[::-1]), seed=1, **SHEET))
    assert again["pattern_correlation"] > 0.85
    assert again["pattern_polar_correlation"] > 0.9
    assert mirrored["pattern_correlation"] < again["pattern_correlation"] - 0.1
    assert mirrored["pattern_polar_correlation"] < 0


def test_a_picture_agrees_with_itself(white: FlashPhotographs) -> None:
    same = PictureSeries(white.radiance, white.light_mm, EYE, white.pixel_mm)
    assert macroscopic_pattern(white, same).metrics == pytest.approx(
        {"pattern_correlation": 1.0, "pattern_polar_correlation": 1.0}
    )
    with pytest.raises(InputError, match="2 pictures are not of the 1 lights"):
        macroscopic_pattern(white, replace(same, rgb=np.repeat(same.rgb, 2, axis=0)))


@pytest.mark.parametrize("change", [{"first_um": 0.5}, {"longest_um": 2.0}])
def test_a_spiral_beyond_its_bins_is_refused(change: dict[str, float]) -> None:
    with pytest.raises(InputError, match="do not lie between"):
        spiral(**change)  # type: ignore[arg-type]


def test_a_photograph_that_is_not_there_and_a_dark_one_are_refused(green: FlashPhotographs) -> None:
    with pytest.raises(InputError, match="there is no photograph 1"):
        orientation_period_distribution(green, highlight(green), photograph=1)
    dark = replace(green, radiance=np.zeros_like(green.radiance))
    with pytest.raises(InputError, match="nothing outside the highlight is bright"):
        orientation_period_distribution(dark, highlight(green), method="naive")
    unseen = replace(green, valid=np.zeros_like(green.valid))
    for method in ("naive", "modelled"):
        with pytest.raises(InputError, match="nothing outside the highlight is bright"):
            orientation_period_distribution(unseen, highlight(green), method=method)
    with pytest.raises(InputError, match="not rectified"):
        orientation_period_distribution(replace(green, pixel_mm=None), highlight(green))
