"""Colours of diffraction: a mirror's, a known grating's, and what the stage says of settings that do not do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.data.height_fields import HeightField, Periodicity
from pipeline.errors import InputError
from pipeline.optics.colour import white_balanced_weights
from pipeline.stages.align.filled import filled
from pipeline.stages.evaluate.brdf_difference import brdf_difference
from pipeline.stages.fit.periodicity import periodicity
from pipeline.stages.render import brdf_map as stage
from pipeline.stages.render.brdf_map import brdf_map
from pipeline.stages.simulate.cosine_grating import cosine_grating


def grating(period_um: float = 1.6, depth_um: float = 0.15, pitch_um: float = 0.05) -> HeightField:
    return cosine_grating(period_um=period_um, depth_um=depth_um, size_um=8.0, pitch_um=pitch_um, periodic=True)


def test_a_mirror_in_daylight_is_white_and_dark_beside_its_direction() -> None:
    flat = HeightField(np.zeros((20, 20)), 0.1, periodic=True)
    rgb = brdf_map(flat, light_deg=[0.0], size_px=41).rgb[0]
    np.testing.assert_allclose(rgb[20, 20], 1.0, atol=2e-3)
    assert np.abs(rgb[20, 25]).max() < 1e-4


def test_a_grating_shows_the_colours_of_the_grating_equation() -> None:
    """At (x, 0) under light from above the first order brings the wavelength d x, in the colour of that wavelength."""
    size, period = 401, 1.6
    row = brdf_map(grating(period), light_deg=[0.0], size_px=size).rgb[0, size // 2]
    wavelength, weights = white_balanced_weights("D65", 1.0)
    for nm in (450, 500, 550, 600, 650):
        at = round(((nm / 1000 / period) + 1) / 2 * size - 0.5)
        x = (2 * at + 1) / size - 1
        # A line of finite width mixes its neighbours.
        sigma = (period * x * 1000) ** 2 * 4 / (2 * np.pi * 65) / np.sqrt(2) / (x * 1000)
        line = np.exp(-0.5 * ((wavelength - period * x * 1000) / sigma) ** 2)
        expected = line @ weights
        np.testing.assert_allclose(row[at] / np.linalg.norm(row[at]), expected / np.linalg.norm(expected), atol=0.03)


def test_the_picture_is_turned_as_the_surface_and_the_light_are() -> None:
    surface = grating()
    turned = HeightField(np.ascontiguousarray(np.rot90(surface.height_um)), surface.pitch_um, periodic=True)
    first = brdf_map(surface, light_deg=[15.0], light_azimuth_deg=30.0, size_px=60).rgb[0]
    second = brdf_map(turned, light_deg=[15.0], light_azimuth_deg=120.0, size_px=60).rgb[0]
    np.testing.assert_allclose(second, np.rot90(first), atol=1e-4 * first.max())


def test_the_widest_step_that_is_chosen_is_fine_enough_and_a_coarse_one_is_not() -> None:
    few = {"light_deg": [10.0], "size_px": 61}
    reference = brdf_map(grating(), wavelength_step=0.1, **few)
    chosen = brdf_map(grating(), **few)
    coarse = brdf_map(grating(), wavelength_step=20.0, **few)
    assert brdf_difference(chosen, reference).metrics["brdf_error_rms_percent"] < 2
    assert brdf_difference(coarse, reference).metrics["brdf_error_rms_percent"] > 10


def test_the_step_that_is_chosen_shows_the_fringes_of_a_deep_relief() -> None:
    steps = np.zeros((4, 16))
    steps[:, 8:] = 10.0
    few = {"light_deg": [10.0], "size_px": 15, "coherence_um": 4.0}
    chosen = brdf_map(HeightField(steps, 0.1, periodic=True), **few)
    reference = brdf_map(HeightField(steps, 0.1, periodic=True), wavelength_step=0.5, **few)
    assert brdf_difference(chosen, reference).metrics["brdf_error_rms_percent"] < 1
    coarse = brdf_map(HeightField(steps, 0.1, periodic=True), wavelength_step=10.0, **few)
    assert brdf_difference(coarse, reference).metrics["brdf_error_rms_percent"] > 10


def test_figures_are_those_of_the_light_that_asks_for_most() -> None:
    surface, few = grating(depth_um=1.0), {"size_px": 9, "coherence_um": 20.0}
    both, upright, slanting = (brdf_map(surface, light_deg=to, **few).metrics for to in ([0.0, 60.0], [0.0], [60.0]))
    assert upright["terms"] > slanting["terms"]
    assert upright["wavelength_step_nm"] > slanting["wavelength_step_nm"]
    assert both["terms"] == upright["terms"]
    assert both["wavelength_step_nm"] == slanting["wavelength_step_nm"]
    assert both["brdf_largest"] == max(upright["brdf_largest"], slanting["brdf_largest"])


def test_a_window_too_wide_for_any_step_is_told(caplog: pytest.LogCaptureFixture) -> None:
    brdf_map(grating(), light_deg=[10.0], size_px=5, coherence_um=300.0)
    assert "ask for wavelength steps" not in caplog.text
    brdf_map(grating(), light_deg=[10.0], size_px=5, coherence_um=2000.0)
    assert "ask for wavelength steps of 0.0" in caplog.text
    assert "and 0.25 nm are taken" in caplog.text


@pytest.mark.parametrize("evaluator", ["flss", "nmm", "pq", "pq_sinc", "gem", "nufft"])
def test_other_evaluators_of_a_grating_send_light_to_the_same_places(evaluator: str) -> None:
    if evaluator == "nufft":
        pytest.importorskip("finufft")
    settings = {"light_deg": [20.0], "size_px": 51, "wavelength_step": 20.0, "coherence_um": 20.0}
    surface = grating()
    reference = brdf_map(surface, **settings)
    found = brdf_map(surface, periodicity(surface), evaluator=evaluator, **settings)
    error = brdf_difference(found, reference).metrics["brdf_error_max_percent"]
    assert error < {"flss": 0.2, "nmm": 0.2, "nufft": 0.2}.get(evaluator, 1000)
    lit = [picture.rgb[0].sum(axis=-1) > 0.02 * picture.rgb.sum(axis=-1).max() for picture in (found, reference)]
    assert (lit[0] & lit[1]).sum() > 0.5 * lit[1].sum()


def test_too_few_terms_a_coarse_pitch_and_a_seam_are_told(caplog: pytest.LogCaptureFixture) -> None:
    few = {"light_deg": [10.0], "size_px": 11, "wavelength_step": 50.0}
    brdf_map(grating(), **few)
    assert not [record for record in caplog.records if record.levelname == "WARNING"]
    brdf_map(grating(depth_um=3.0), evaluator="flss", terms=30, **few)
    assert "30 terms leave an amplitude error of up to" in caplog.text
    brdf_map(grating(period_um=3.2, pitch_um=0.4), **few)
    assert "Samples 0.4 um apart hold orders up to 1.25 per um" in caplog.text
    slope = HeightField(np.tile(np.linspace(0, 1, 40), (40, 1)), 0.1)
    brdf_map(slope, **few)
    assert "the tile jumps at its border" in caplog.text


@pytest.mark.parametrize("azimuth_deg", [0.0, 90.0])
def test_the_pitch_that_is_said_to_do_does(azimuth_deg: float, caplog: pytest.LogCaptureFixture) -> None:
    """Light from 60 degrees asks for orders up to ``(1 + sin 60) / 0.38`` per um along its own azimuth."""
    few = {"light_deg": [60.0], "light_azimuth_deg": azimuth_deg, "size_px": 101, "wavelength_step": 100.0}
    needed = 0.38 / (100 / 101 + np.sin(np.deg2rad(60))) / 2
    brdf_map(HeightField(np.zeros((8, 8)), 0.99 * needed, periodic=True), **few)
    assert "Samples" not in caplog.text
    brdf_map(HeightField(np.zeros((8, 8)), 1.01 * needed, periodic=True), **few)
    assert f"A pitch of {needed:.3g} um would do" in caplog.text


@pytest.mark.parametrize("turns", [0, 1])
def test_a_seam_along_either_axis_and_a_narrow_tile_are_told(turns: int, caplog: pytest.LogCaptureFixture) -> None:
    few = {"light_deg": [10.0], "size_px": 11, "wavelength_step": 50.0, "coherence_um": 3.9}
    caplog.set_level("INFO")
    slope = np.rot90(np.tile(np.linspace(0, 1, 40), (40, 1)), turns)
    brdf_map(HeightField(slope, 0.1), **few)
    assert "the tile jumps at its border by 39.0 times its largest step inside" in caplog.text
    assert "narrower than the coherence window" not in caplog.text
    brdf_map(HeightField(np.rot90(np.zeros((10, 80)), turns), 0.1, periodic=True), **few)
    assert "The tile is 1 um wide, narrower than the coherence window of 3.9 um" in caplog.text


@pytest.mark.parametrize("orientation_deg", [30.0, 135.0])
def test_evaluators_look_along_a_slanting_period(orientation_deg: float) -> None:
    surface = cosine_grating(period_um=1.6, depth_um=0.15, size_um=8.0, pitch_um=0.1, orientation_deg=orientation_deg)
    few = {"light_deg": [10.0], "size_px": 31, "wavelength_step": 50.0, "coherence_um": 20.0}
    reference = brdf_map(surface, evaluator="flss", **few)
    found = brdf_map(surface, periodicity(surface), evaluator="nmm", **few)
    assert brdf_difference(found, reference).metrics["brdf_error_rms_percent"] < 1


def test_what_cannot_be_is_refused() -> None:
    few = {"light_deg": [10.0], "size_px": 11, "wavelength_step": 50.0}
    with pytest.raises(InputError, match="looks for light where the surface's periods send it"):
        brdf_map(grating(), evaluator="gem", **few)
    empty = np.empty(0)
    none = Periodicity(empty, empty, empty, empty, empty, empty, empty, np.zeros((1, 1), np.float32), (1.0, 1.0), {})
    with pytest.raises(InputError, match="and none is known"):
        brdf_map(grating(), none, evaluator="nmm", **few)
    holed = np.zeros((20, 20))
    holed[3, 4] = np.nan
    with pytest.raises(InputError, match=r"1 heights of the surface are not known[\s\S]*graph.level.surface=filled"):
        brdf_map(HeightField(holed, 0.1), **few)
    with pytest.raises(InputError, match=r"relief of 20 um asks flss for \d+ terms"):
        brdf_map(grating(depth_um=20.0), evaluator="flss", **few)
    brdf_map(filled(HeightField(holed, 0.1)), **few)
    for setting, value in (
        ("light_deg", [95.0]),
        ("tolerance", 2.0),
        ("terms", 0),
        ("coherence_um", 0.0),
        ("light_deg", []),
        ("refractive_index", 1.0),
    ):
        whole = {
            "wavelength_step": None,
            "terms": None,
            "tolerance": 1e-3,
            "coherence_um": 65.0,
            "refractive_index": 1.5,
        }
        with pytest.raises(InputError, match=setting):
            stage._check_brdf_map(**{**whole, "light_deg": [0.0], "size_px": 9, setting: value})


def test_a_single_row_is_what_repeats_across_it() -> None:
    few = {"light_deg": [20.0], "size_px": 21, "wavelength_step": 50.0, "coherence_um": 8.0}
    whole = HeightField(np.tile(grating().height_um[0], (4, 1)), 0.05)
    for turns in (0, 1):
        expected = brdf_map(HeightField(np.rot90(whole.height_um, turns), 0.05), **few).rgb
        found = brdf_map(HeightField(np.rot90(whole.height_um[:1], turns), 0.05), **few).rgb
        np.testing.assert_allclose(found, expected, atol=1e-5)


def test_maps_are_compared_away_from_the_mirror_and_by_luminance() -> None:
    dark = brdf_map(grating(), light_deg=[0.0], size_px=11, wavelength_step=50.0)
    rgb = np.zeros((1, 11, 11, 3), np.float32)
    rgb[0, 5, :] = [0.0, 0.02, 0.0]
    rgb[0, 5, 5] = 10.0
    reference, estimate = (replace(dark, rgb=rgb.copy()) for _ in range(2))
    estimate.rgb[0, 5, 0] = [0.0, 0.04, 0.0]
    luminance = 10 + 10 * 0.02 * 0.7152
    assert brdf_difference(estimate, reference).metrics == {
        "brdf_error_max_percent": pytest.approx(0.2),
        "brdf_error_rms_percent": pytest.approx(100 / np.sqrt(10)),
        "brdf_energy_percent": pytest.approx(100 * (1 + 0.02 * 0.7152 / luminance)),
    }
    reference.rgb[0, 5, [*range(5), *range(6, 11)]] = 0.0
    assert "brdf_error_rms_percent" not in brdf_difference(estimate, reference).metrics


def test_maps_of_other_lights_are_not_compared() -> None:
    few = {"size_px": 11, "wavelength_step": 50.0}
    first, second = brdf_map(grating(), light_deg=[0.0], **few), brdf_map(grating(), light_deg=[5.0], **few)
    assert brdf_difference(first, first).metrics == {
        "brdf_error_max_percent": 0.0,
        "brdf_error_rms_percent": 0.0,
        "brdf_energy_percent": pytest.approx(100.0),
    }
    with pytest.raises(InputError, match="differ in size or lights"):
        brdf_difference(first, second)


def test_what_would_take_hours_or_all_memory_is_refused_with_the_likely_mistake() -> None:
    few = {"light_deg": [10.0], "size_px": 11, "wavelength_step": 50.0}
    in_nm = grating(depth_um=250.0)
    with pytest.raises(InputError, match=r"a relief of 250 um asks chebyshev for \d{4} terms[\s\S]*in um, and"):
        brdf_map(in_nm, **few)
    wide = HeightField(grating().height_um[:32, :32], 1000.0, periodic=True)
    with pytest.raises(InputError, match=r"3.2e\+04 x 3.2e\+04 um has \d+ x \d+ spectral lines[\s\S]*pitch of 1000 um"):
        brdf_map(wide, **few)
