"""Highlight, orientation and period from flash photographs that the reference renderer made."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
from flash_sheets import GREEN, laid_tiles, photographed, stripes

from pipeline.data.flash import FlashPhotographs
from pipeline.data.gratings import OrientationMap
from pipeline.errors import InputError
from pipeline.optics.angles import axial_difference
from pipeline.stages.fit.flash_orientation import flash_orientation
from pipeline.stages.fit.flash_period import flash_period
from pipeline.stages.fit.highlight import highlight

SIDE, PIXEL, TILES = 16, 1.5, (11, 8)
DEGREES = [5.0, 50.0, 95.0, 140.0]
LIGHTS = [[50.0, 30.0, 200.0], [-50.0, 30.0, 200.0], [0.0, -40.0, 200.0]]
TANGENTS = stripes(DEGREES, side=SIDE)
SPACED = laid_tiles((SIDE, SIDE), TILES, PIXEL)
PERIOD = 1 / 0.6


def sheet(period_um: float | np.ndarray = PERIOD, count: int = 3, **light: object) -> FlashPhotographs:
    periods = np.broadcast_to(np.asarray(period_um, np.float32), TANGENTS.shape)
    return photographed(TANGENTS, periods, LIGHTS[:count], pixel_mm=PIXEL, tiles=TILES, **light)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def white() -> FlashPhotographs:
    return sheet()


@pytest.fixture(scope="module")
def green() -> FlashPhotographs:
    return sheet(band_nm=GREEN)


@pytest.fixture(scope="module")
def measured(white: FlashPhotographs) -> OrientationMap:
    return flash_orientation(white, SPACED, highlight(white))


def test_highlights_lie_where_a_mirror_shows_the_flash_and_tell_its_size(white: FlashPhotographs) -> None:
    found = highlight(white)
    # The mirror point divides the way between the feet of light and camera as their heights.
    np.testing.assert_allclose(found.place_mm, np.array(LIGHTS)[:, :2] * 500 / 700, atol=0.3)
    np.testing.assert_allclose(found.stated_mm, np.array(LIGHTS)[:, :2] * 500 / 700)
    assert found.light_sigma_mm == pytest.approx(5.0, rel=0.1)
    assert not found.saturated.any()
    assert not found.outside.any()


def test_a_flash_that_was_elsewhere_than_stated_is_noticed(
    white: FlashPhotographs, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        found = highlight(replace(white, light_mm=white.light_mm + np.array([0.0, 20.0, 0.0])))
    assert "the highlight of flash 1 lies 14.3 mm from where" in caplog.text
    assert found.metrics["highlight_off_max_mm"] == pytest.approx(20 * 500 / 700, abs=0.3)


def test_a_highlight_outside_the_picture_or_too_bright_is_noticed(
    white: FlashPhotographs, caplog: pytest.LogCaptureFixture
) -> None:
    beside = photographed(TANGENTS, np.full_like(TANGENTS, PERIOD), [[400.0, 0.0, 200.0]], pixel_mm=PIXEL, tiles=TILES)
    valid = white.valid.copy()
    valid[0] &= white.radiance[0].mean(axis=-1) < 0.2 * white.radiance[0].mean(axis=-1).max()
    with caplog.at_level(logging.WARNING):
        lost = highlight(beside)
        bright = highlight(replace(white, valid=valid))
    assert lost.outside[0]
    assert np.isnan(lost.place_mm[0]).all()
    assert "put it at (285.7, 0.0) mm, outside the sheet of 264 x 192 mm" in caplog.text
    assert bright.saturated.tolist() == [True, False, False]
    assert "flash 1 is too bright for every exposure" in caplog.text


def test_tangents_are_found_within_their_stated_error(measured: OrientationMap) -> None:
    assert measured.mask.all()
    assert measured.absolute
    error = np.abs(axial_difference(measured.orientation_rad, TANGENTS))
    assert np.rad2deg(np.median(error)) < 0.3
    inside = np.ones(SIDE, bool)
    inside[[0, 3, 4, 7, 8, 11, 12, 15]] = False
    assert measured.standard_error_rad is not None
    assert np.mean(error[:, inside] < 3 * measured.standard_error_rad[:, inside]) > 0.9


def test_the_threshold_alone_reads_no_finer_than_its_views(white: FlashPhotographs) -> None:
    found = flash_orientation(white, SPACED, highlight(white), method="threshold")
    error = np.rad2deg(np.abs(axial_difference(found.orientation_rad, TANGENTS)))
    assert 0.3 < np.median(error) < 5


def test_without_places_they_follow_from_the_highlight_and_distances(
    white: FlashPhotographs, measured: OrientationMap
) -> None:
    blind = replace(white, light_mm=np.full((3, 3), np.nan), camera_mm=np.full(3, np.nan))
    found = flash_orientation(
        blind, SPACED, highlight(blind), light_distance_mm=200.0, camera_distance_mm=500.0, light_sigma_mm=5.0
    )
    turn = np.abs(axial_difference(found.orientation_rad, measured.orientation_rad))
    assert np.rad2deg(np.median(turn)) < 0.3
    with pytest.raises(InputError, match="the camera's place is not known"):
        flash_orientation(blind, SPACED, highlight(blind), light_distance_mm=200.0)
    with pytest.raises(InputError, match="the place of flash 1 is not known"):
        flash_orientation(blind, SPACED, highlight(blind), camera_distance_mm=500.0)


def test_fewer_photographs_than_asked_for_are_told(
    white: FlashPhotographs, measured: OrientationMap, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO, "pipeline"):
        found = flash_orientation(white, SPACED, highlight(white), photographs=5)
    assert "there are 3 photographs, not 5" in caplog.text
    assert np.array_equal(found.orientation_rad, measured.orientation_rad, equal_nan=True)


def test_what_was_never_lit_stays_unknown_until_the_next_flash_shows_it(caplog: pytest.LogCaptureFixture) -> None:
    few = laid_tiles((SIDE, SIDE), (4, 3), PIXEL)

    def orientation(lights: list[list[float]]) -> OrientationMap:
        photos = photographed(
            TANGENTS, np.full_like(TANGENTS, PERIOD), lights, pixel_mm=PIXEL, tiles=(4, 3), light_sigma_mm=3.0
        )
        return flash_orientation(photos, few, highlight(photos))

    with caplog.at_level(logging.WARNING):
        first = orientation([[0.0, 0.0, 200.0]])
    assert np.isnan(first.orientation_rad[~first.mask]).all()
    assert 5 < first.metrics["lit_percent"] < 95
    assert "percent of the tile are not lit in the first photograph. A flash at (" in caplog.text
    proposed = [first.metrics[f"next_light_{axis}_mm"] for axis in "xyz"]
    both = orientation([[0.0, 0.0, 200.0], proposed])
    beside = orientation([[0.0, 0.0, 200.0], [1.0, 0.0, 200.0]])
    assert both.metrics["lit_percent"] > beside.metrics["lit_percent"] + 5


def test_what_paper_scatters_is_not_taken_for_light_where_views_are_few(white: FlashPhotographs) -> None:
    dim = np.float32(0.05 * np.percentile(white.radiance, 99))
    scattering = replace(white, radiance=white.radiance + dim)

    def orientation(count: int) -> OrientationMap:
        few = replace(SPACED, homographies=SPACED.homographies[:count], residual_px=SPACED.residual_px[:count])
        return flash_orientation(scattering, replace(few, reference=0), highlight(scattering), photographs=1)

    with pytest.raises(InputError, match="no pixel outside the highlights rises above the dark"):
        orientation(1)
    found = orientation(4)
    error = np.rad2deg(np.abs(axial_difference(found.orientation_rad, TANGENTS)[found.mask]))
    assert 0.1 < found.mask.mean() < 0.5
    assert np.percentile(error, 90) < 10


def test_one_period_is_found_and_one_number_will_do(green: FlashPhotographs, measured: OrientationMap) -> None:
    found = flash_period(green, SPACED, highlight(green), measured)
    assert found.metrics["period_constant"] == 1
    assert np.unique(found.period_um[found.mask]) == pytest.approx([PERIOD], rel=0.005)
    assert found.metrics["light_sigma_mm"] == pytest.approx(5.0, rel=0.03)
    assert found.metrics["depth_um"] == pytest.approx(0.12, rel=0.05)
    assert not found.relative


def test_periods_that_vary_are_told_apart(measured: OrientationMap) -> None:
    truth = np.repeat([1.4, 1.55, 1.7, 1.85], SIDE // 4) * np.ones((SIDE, 1))
    photos = sheet(truth, band_nm=GREEN)
    found = flash_period(photos, SPACED, highlight(photos), measured)
    assert found.metrics["period_constant"] == 0
    error = np.abs(found.period_um[found.mask] / truth[found.mask] - 1)
    assert found.mask.mean() > 0.8
    assert np.median(error) < 0.01


def test_the_published_bias_of_a_large_light_goes_with_the_model(measured: OrientationMap) -> None:
    """Toisoul et al. 2018, section 7.1: 600 lines/mm read at 560 nm as 1.618 to 2.326 um, mean 1.939, std 0.15."""
    photos = photographed(
        TANGENTS,
        np.full_like(TANGENTS, PERIOD),
        [[0.0, 0.0, 200.0]],
        pixel_mm=PIXEL,
        tiles=TILES,
        band_nm=(560.0, 4.0),
        light_sigma_mm=30.0,
    )
    stated = {"keep_off": 1.6, "shortest_um": 1.2, "longest_um": 2.6}
    naive = flash_period(photos, SPACED, highlight(photos), measured, method="naive", share=0.95, **stated).metrics
    assert naive["period_mean_um"] == pytest.approx(1.939, abs=0.1)
    assert naive["period_std_um"] == pytest.approx(0.15, abs=0.06)
    assert naive["period_min_um"] == pytest.approx(1.618, abs=0.1)
    assert naive["period_max_um"] == pytest.approx(2.326, abs=0.15)
    model = flash_period(photos, SPACED, highlight(photos), measured, **stated).metrics
    assert model["period_um"] == pytest.approx(PERIOD, rel=0.02)
    assert model["period_mean_um"] == pytest.approx(PERIOD, rel=0.02)
    assert model["period_std_um"] < 0.05


@pytest.mark.parametrize("percent", [0.0, 3.0])
def test_a_few_percent_of_variation_are_measured(percent: float) -> None:
    """Each tile of smoothly turning tangents has as many pixels at either of two periods."""
    turning = np.broadcast_to(np.deg2rad(5.0 * np.arange(SIDE) + 5), (SIDE, SIDE)).astype(np.float32)
    either = np.random.default_rng(2).permuted(np.repeat([-1.0, 1.0], SIDE * SIDE // 8)).reshape(SIDE // 2, SIDE // 2)
    truth = PERIOD * (1 + percent / 100 * either.repeat(2, axis=0).repeat(2, axis=1))
    photos = photographed(turning, truth, LIGHTS, pixel_mm=PIXEL, tiles=TILES, band_nm=GREEN)
    found = flash_period(photos, SPACED, highlight(photos), known(turning))
    assert found.metrics["period_variation_percent"] == pytest.approx(percent, abs=0.3)
    assert found.metrics["period_constant"] == (percent == 0)
    each = flash_period(photos, SPACED, highlight(photos), known(turning), kind="varying")
    assert each.standard_error_um is not None
    assert each.mask.mean() > 0.8
    assert np.std((each.period_um - truth)[each.mask] / each.standard_error_um[each.mask]) < 1.5


def known(tangents: np.ndarray) -> OrientationMap:
    return OrientationMap(
        tangents, np.ones_like(tangents), np.ones_like(tangents), np.ones(tangents.shape, bool), PIXEL
    )


def test_pixels_whose_period_is_ambiguous_do_not_state_it(caplog: pytest.LogCaptureFixture) -> None:
    """A small flash over few tiles lights most pixels once or never: other periods fit as well."""
    photos = sheet(band_nm=GREEN, light_sigma_mm=2.0)
    with caplog.at_level(logging.WARNING):
        one = flash_period(photos, SPACED, highlight(photos), known(TANGENTS))
    assert one.metrics["period_um"] == pytest.approx(PERIOD, rel=0.005)
    assert "Whether periods vary is not told: fewer than 50 pixels" in caplog.text
    each = flash_period(photos, SPACED, highlight(photos), known(TANGENTS), kind="varying")
    assert each.standard_error_um is not None
    away = np.abs(np.log(each.period_um / PERIOD))[each.mask]
    assert np.mean(away < 3 * (each.standard_error_um / each.period_um)[each.mask]) > 0.9
    assert 0.05 < each.mask.mean() < 0.5


def test_gratings_so_deep_that_second_orders_outshine_first_ones_are_warned_of(
    measured: OrientationMap, caplog: pytest.LogCaptureFixture
) -> None:
    photos = sheet(band_nm=GREEN, depth_um=0.3)
    with caplog.at_level(logging.WARNING):
        flash_period(photos, SPACED, highlight(photos), measured)
    assert "periods are doubtful, and half of what they are" in caplog.text


def test_what_does_not_belong_together_is_refused(
    white: FlashPhotographs, green: FlashPhotographs, measured: OrientationMap
) -> None:
    seen = highlight(white)
    one = replace(seen, place_mm=seen.place_mm[:1], stated_mm=seen.stated_mm[:1])
    with pytest.raises(InputError, match="1 highlights are not of 3 photographs"):
        flash_orientation(white, SPACED, one)
    with pytest.raises(InputError, match="not rectified"):
        flash_orientation(replace(white, pixel_mm=None), SPACED, seen)
    with pytest.raises(InputError, match=r"flash 1 at \[-50.0, 30.0, 0.0\] mm is not above the sheet"):
        flash_orientation(replace(white, light_mm=white.light_mm * [[1, 1, 1], [1, 1, 0], [1, 1, 1]]), SPACED, seen)
    with pytest.raises(InputError, match=r"the camera at .* is not above the sheet"):
        flash_period(replace(green, camera_mm=-green.camera_mm), SPACED, seen, measured)
    with pytest.raises(InputError, match=r"shortest_um 1\.6 is not 1.1 times below longest_um 1.61"):
        flash_period(green, SPACED, seen, measured, shortest_um=1.6, longest_um=1.61)
    unlit = replace(measured, mask=np.zeros_like(measured.mask))
    with pytest.raises(InputError, match="no orientation of the tile is known"):
        flash_period(green, SPACED, seen, unlit, method="naive")


def test_periods_need_one_wavelength(
    white: FlashPhotographs, measured: OrientationMap, caplog: pytest.LogCaptureFixture
) -> None:
    with pytest.raises(InputError, match="taken without a filter"):
        flash_period(white, SPACED, highlight(white), measured)
    with caplog.at_level(logging.WARNING):
        flash_period(white, SPACED, highlight(white), measured, method="naive", wavelength_nm=550.0)
    assert "all wavelengths are seen at once" in caplog.text


def test_a_map_of_another_tile_and_dark_photographs_are_refused(
    white: FlashPhotographs, green: FlashPhotographs, measured: OrientationMap
) -> None:
    other = laid_tiles((SIDE, SIDE // 2), TILES, PIXEL)
    with pytest.raises(InputError, match=r"of \(16, 16\) is not of a tile of \(16, 8\)"):
        flash_period(green, other, highlight(green), measured)
    dark = replace(white, radiance=np.full_like(white.radiance, 0.1))
    with pytest.raises(InputError, match="rises above the dark"):
        flash_orientation(dark, SPACED, highlight(white))
    with pytest.raises(InputError, match="not rectified"):
        highlight(replace(white, pixel_mm=None))
