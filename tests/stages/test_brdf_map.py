"""Colours of diffraction: a mirror's, a known grating's, and what the stage says of settings that do not do."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.data import HeightField, Periodicity
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
    brdf_map(filled(HeightField(holed, 0.1)), **few)
    for setting, value in (("light_deg", [95.0]), ("tolerance", 2.0), ("terms", 0), ("coherence_um", 0.0)):
        whole = {
            "wavelength_step": None,
            "terms": None,
            "tolerance": 1e-3,
            "coherence_um": 65.0,
            "refractive_index": 1.5,
        }
        with pytest.raises(InputError, match=setting):
            stage._check_brdf_map(**{**whole, "light_deg": [0.0], "size_px": 9, setting: value})


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
    with pytest.raises(InputError, match=r"a relief of 250 um asks chebyshev for \d{4} terms[\s\S]*in um\?"):
        brdf_map(in_nm, **few)
    wide = HeightField(grating().height_um[:32, :32], 1000.0, periodic=True)
    with pytest.raises(InputError, match=r"3.2e\+04 x 3.2e\+04 um has \d+ x \d+ spectral lines[\s\S]*pitch of 1000 um"):
        brdf_map(wide, **few)
