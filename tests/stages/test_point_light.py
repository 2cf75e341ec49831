"""A sheet under a small light: places, colours, and the photograph beside the rendering."""

from __future__ import annotations

import inspect
import logging
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import jv

from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.devices.virtual_light import Lighting, render_supersampled
from pipeline.devices.virtual_sheet import Sheet, render_sheet
from pipeline.errors import InputError
from pipeline.optics.colour import white_balanced_weights
from pipeline.optics.sheet.view import rectified
from pipeline.stages.capture import point_light as capture_module
from pipeline.stages.capture.point_light import point_light as photograph
from pipeline.stages.render import point_light as render_module
from pipeline.stages.render.point_light import point_light as render
from pipeline.stages.simulate.logo import logo

SMALL = {"camera_mm": [0.0, 0.0, 500.0], "light_sigma_mm": 4.0, "coherence_um": 65.0}


def maps(orientation_deg: float, period_um: float = 1.2, size: int = 3) -> tuple[OrientationMap, PeriodMap]:
    angle = np.full((size, size), np.deg2rad(orientation_deg), np.float32)
    mask = np.ones((size, size), bool)
    return (
        OrientationMap(angle, angle, angle, mask, 0.01, absolute=True),
        PeriodMap(np.full((size, size), period_um, np.float32), mask, 0.01),
    )


def light(azimuth_deg: float, inclination: float = 0.45, distance: float = 400.0) -> list[float]:
    """A light whose half vector has the in-plane length ``inclination`` towards an azimuth."""
    a = np.deg2rad(azimuth_deg)
    return [
        distance * inclination * np.cos(a),
        distance * inclination * np.sin(a),
        distance * np.sqrt(1 - inclination**2),
    ]


def brightness(orientation_deg: float, lights: list[list[float]], **settings) -> np.ndarray:
    series = render(*maps(orientation_deg), lights_mm=lights, white_percentile=100.0, **{**SMALL, **settings})
    return series.rgb.max(axis=-1)[:, 1, 1]


def test_a_grating_lights_up_towards_its_tangent_anticlockwise_from_x() -> None:
    azimuths = [-30.0, 0.0, 30.0, 60.0, 90.0, 120.0, 150.0]
    for orientation in (0.0, 30.0, 120.0):
        shine = brightness(orientation, [light(a) for a in azimuths])
        assert azimuths[int(np.argmax(shine))] % 180 == orientation
        assert np.sort(shine)[-2] < 0.01 * shine.max()


def test_a_map_known_up_to_an_offset_is_rendered_with_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    absolute, period = maps(30.0)
    relative, lights = replace(absolute, absolute=False), [light(30.0)]
    told = "known up to one offset"
    assert told in render(relative, period, lights_mm=lights, **SMALL).caption
    (warning,) = [r.getMessage() for r in caplog.records if r.levelno == logging.WARNING]
    assert told in warning
    assert "known_deg" in warning
    caplog.clear()
    assert told not in render(absolute, period, lights_mm=lights, **SMALL).caption
    assert not caplog.records


def test_half_a_turn_of_the_light_shows_the_same() -> None:
    here, there = brightness(30.0, [light(30), light(210)])
    assert there == pytest.approx(here, rel=1e-6)


@pytest.mark.parametrize(("u", "channel"), [(0.46 / 1.2, 2), (0.535 / 1.2, 1), (0.63 / 1.2, 0)])
def test_the_colour_is_that_of_the_grating_equation(u: float, channel: int) -> None:
    series = render(*maps(0.0), lights_mm=[light(0.0, u)], **SMALL)
    assert np.argmax(series.rgb[0, 1, 1]) == channel


def test_the_sheet_is_the_plain_sum_over_wavelengths_and_orders() -> None:
    """The same sum written out with NumPy, pixel by pixel, for a wide sheet seen from the side."""
    rng = np.random.default_rng(5)
    size, pixel_mm, depth, sigma = 4, 9.0, 0.2, 25.0
    orientation = rng.uniform(0, np.pi, (size, size)).astype(np.float32)
    period = rng.uniform(0.9, 1.4, (size, size)).astype(np.float32)
    mask = np.ones((size, size), bool)
    camera = np.array([70.0, -40.0, 400.0])
    lights = np.array([light(10.0, 0.4), light(80.0, 0.5, 300.0), light(200.0, 0.3, 350.0), light(320.0, 0.1)])
    series = render(
        OrientationMap(orientation, orientation, orientation, mask, pixel_mm),
        PeriodMap(period, mask, pixel_mm),
        lights_mm=lights.tolist(),
        camera_mm=camera.tolist(),
        light_sigma_mm=sigma,
        depth_um=depth,
        anti_aliased=False,
        white_percentile=100.0,
    )
    nm, weights = white_balanced_weights("D65", 5.0)
    wavelength = nm / 1000

    def colour(place: np.ndarray, row: int, column: int) -> np.ndarray:
        here = pixel_mm * np.array([column - (size - 1) / 2, (size - 1) / 2 - row, 0.0])
        distance = np.linalg.norm(place - here)
        i, r = (place - here) / distance, (camera - here) / np.linalg.norm(camera - here)
        h = i + r
        c, s = np.cos(float(orientation[row, column])), np.sin(float(orientation[row, column]))
        u, v = h[0] * c + h[1] * s, h[1] * c - h[0] * s
        spread = wavelength / (2 * np.pi * np.sqrt(2) * 65 / 4)
        along, across = i[0] * c + i[1] * s, i[1] * c - i[0] * s
        extent = (sigma / distance) ** 2  # foreshortened along the tangent and across it
        variance_u, variance_v = spread**2 + extent * (1 - along**2), spread**2 + extent * (1 - across**2)
        total = np.zeros_like(wavelength)
        for m in range(-6, 7):
            away = u - m * wavelength / float(period[row, column])
            lobe = np.exp(-0.5 * (away**2 / variance_u + v**2 / variance_v))
            lobe *= spread**2 / np.sqrt(variance_u * variance_v)
            total += lobe * jv(m, 2 * np.pi / wavelength * h[2] * depth / 2) ** 2
        stam = (1 + i @ r) ** 2 / (i[2] * r[2] * (i[2] + r[2]) ** 2)
        incidence = i[2] * (500 / distance) ** 2
        return stam * incidence * (total / wavelength**2) @ weights

    expected = np.array(
        [[[colour(place, row, column) for column in range(size)] for row in range(size)] for place in lights]
    )
    lit = expected.max(axis=-1) > 0.02 * expected.max()
    assert lit.any(axis=(1, 2)).all()
    assert lit.sum() > size * size
    np.testing.assert_allclose(series.rgb / series.rgb.max(), expected / expected.max(), atol=1e-3)


def test_a_wider_light_spreads_its_lobe() -> None:
    azimuths = [light(a) for a in (0, 4)]
    narrow = brightness(0.0, azimuths, light_sigma_mm=2.0)
    wide = brightness(0.0, azimuths, light_sigma_mm=20.0)
    assert wide[1] / wide[0] > 5 * narrow[1] / narrow[0]


def test_masked_pixels_stay_dark() -> None:
    orientation, period = maps(0.0)
    orientation.orientation_rad[0, 0] = np.nan
    series = render(orientation, period, lights_mm=[light(0.0)], **SMALL)
    assert (series.rgb[0, 0, 0] == 0).all()
    assert series.rgb[0, 1, 1].max() > 0


def test_maps_that_do_not_match_are_refused() -> None:
    with pytest.raises(InputError, match=r"differ in shape: orientation \d+ x \d+ points, period 4 x 4 points"):
        render(maps(0.0)[0], maps(0.0, size=4)[1], lights_mm=[light(0.0)])


def test_without_a_pitch_the_width_is_assumed_and_said(caplog: pytest.LogCaptureFixture) -> None:
    orientation, period = maps(0.0)
    bare = OrientationMap(orientation.orientation_rad, period.period_um, period.period_um, orientation.mask)
    series = render(bare, PeriodMap(period.period_um, period.mask), lights_mm=[light(0.0)], width_mm=15.0)
    assert series.pixel_mm == pytest.approx(5.0)
    assert "rendered as 15 mm wide" in caplog.text


def test_the_photograph_shows_what_the_rendering_of_the_truth_shows() -> None:
    sample = logo(pixel_mm=0.04)
    lights = [light(0.0), light(60.0)]
    photo = photograph(sample, lights_mm=lights, pixel_mm=0.12, blur_mm=0.0)
    centre = slice(1, None, 3)
    truth = sample.orientation_rad[centre, centre]
    mask = np.isfinite(truth)
    rendered = render(
        OrientationMap(truth, truth, truth, mask, 0.12),
        PeriodMap(sample.period_um[centre, centre], mask, 0.12),
        lights_mm=lights,
    )
    assert photo.rgb.shape == rendered.rgb.shape
    shown = np.clip(rendered.rgb, 0, 1).ravel()
    assert np.corrcoef(photo.rgb.ravel(), shown)[0, 1] > 0.97


def test_the_lens_blurs_what_it_photographs() -> None:
    sample = logo(pixel_mm=0.04, margin_mm=0.2)
    settings = {"lights_mm": [light(30.0)], "pixel_mm": 0.12, "read_noise_electrons": 0.0, "full_well_electrons": 1e7}
    sharp, soft = (photograph(sample, blur_mm=blur, **settings).rgb[0].sum(axis=-1) for blur in (0.0, 0.24))
    steepest = [np.abs(np.diff(image, axis=1)).max() / image.max() for image in (sharp, soft)]
    assert steepest[1] < 0.5 * steepest[0]


def test_supersampling_where_facets_meet_is_supersampling_everywhere() -> None:
    sample = logo(pixel_mm=0.04)
    lighting = Lighting(
        lights_mm=np.array([light(0.0), light(60.0)]),
        camera_mm=np.array([0.0, 0.0, 500.0]),
        light_sigma_mm=12.0,
        illuminant="D65",
        depth_um=0.12,
        coherence_um=65.0,
        wavelength_step_nm=5.0,
    )
    maps = (sample.orientation_rad, sample.period_um)
    view = rectified(*sample.orientation_rad.shape, 0.04, lighting.camera_mm)
    everywhere = render_sheet(Sheet(*maps, 0.04), view, lighting)
    found = np.stack(list(render_supersampled(*maps, lighting, pixel_mm=0.04, ratio=3)))
    assert np.abs(found - everywhere).max() < 0.01 * everywhere.max()
    assert np.abs(found.mean() - everywhere.mean()) < 1e-4 * everywhere.mean()


def test_the_camera_has_to_fit_the_sample() -> None:
    with pytest.raises(InputError, match="4 times the sample's"):
        photograph(logo(pixel_mm=0.05), lights_mm=[light(0.0)], pixel_mm=0.2)


def test_a_step_too_coarse_for_the_lobes_is_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    """A light without extent leaves only the window's width, which 20 nm steps jump over."""
    orientation, period = maps(0.0, 1.0)
    places = [light(0.0, u) for u in np.linspace(0.50, 0.56, 13)]
    settings = {"lights_mm": places, "camera_mm": [0.0, 0.0, 500.0], "light_sigma_mm": 0.0}
    exact, fine, coarse = (
        render(orientation, period, wavelength_step_nm=step, **settings).rgb.sum(axis=-1)[:, 1, 1]
        for step in (0.5, 5.0, 20.0)
    )
    assert np.abs(fine / exact - 1).max() < 0.01
    assert np.abs(coarse / coarse.max() - exact / exact.max()).max() > 0.1
    assert [record.getMessage()[:24] for record in caplog.records] == ["wavelength_step_nm 20 is"]


@pytest.mark.parametrize("stage", [capture_module, render_module])
@pytest.mark.parametrize(
    ("setting", "value", "message"),
    [
        ("lights_mm", [], "there is no light"),
        ("lights_mm", [[1.0, 2.0]], "is no place"),
        ("lights_mm", [[1.0, 2.0, 300.0], [0.0, 0.0, -300.0]], r"lights_mm\[1\]"),
        ("camera_mm", [0.0, 0.0, 0.0], "camera_mm"),
        ("light_sigma_mm", -1.0, "0 or more"),
        ("coherence_um", 0.0, "above 0"),
        ("wavelength_step_nm", 0.0, "0.1 to 100"),
    ],
)
def test_impossible_lighting_is_refused(stage, setting: str, value, message: str) -> None:
    defaults = {
        n: p.default for n, p in inspect.signature(stage.point_light).parameters.items() if p.kind == p.KEYWORD_ONLY
    }
    good = {**defaults, **SMALL, "lights_mm": [light(0.0)]}
    stage._check_point_light(**good)
    with pytest.raises(InputError, match=message):
        stage._check_point_light(**{**good, setting: value})


def test_the_papers_second_order_form_is_the_exact_one_for_shallow_gratings() -> None:
    pictures = {
        (orders, depth): render(*maps(0.0), lights_mm=[light(0.0)], depth_um=depth, orders=orders, **SMALL).rgb[0, 1, 1]
        for orders in ("exact", "second order")
        for depth in (0.01, 0.25)
    }
    shallow = pictures["second order", 0.01] / pictures["exact", 0.01]
    np.testing.assert_allclose(shallow, 1, atol=0.01)
    assert np.abs(pictures["second order", 0.25] - pictures["exact", 0.25]).max() > 0.01


def test_an_orbit_carries_the_light_once_around_anticlockwise() -> None:
    first, others = [80.0, 60.0, 300.0], [[-60.0, 80.0, 300.0], [-80.0, -60.0, 300.0], [60.0, -80.0, 300.0]]
    film = render(*maps(0.0), lights_mm=[first], orbit=4, **SMALL)
    np.testing.assert_allclose(film.light_mm, [first, *others], atol=1e-9)
    assert film.frames_per_second == 24
    np.testing.assert_allclose(film.rgb, render(*maps(0.0), lights_mm=[first, *others], **SMALL).rgb, atol=1e-6)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"lights_mm": [light(0.0), light(90.0)], "orbit": 4}, r"an orbit carries one light around"),
        ({"lights_mm": [light(0.0)], "orbit": 4, "together": True}, r"an orbit carries one light around"),
        ({"lights_mm": [light(0.0)], "orbit": 1}, r"orbit is 1\s.*orbit\s.*2 to 720"),
    ],
)
def test_orbits_of_nothing_are_refused(given: dict, message: str) -> None:
    defaults = {n: p.default for n, p in inspect.signature(render).parameters.items() if p.kind == p.KEYWORD_ONLY}
    with pytest.raises(InputError, match=message):
        render_module._check_point_light(**{**defaults, **SMALL, **given})


def test_more_pictures_than_memory_holds_are_refused_before_they_are_made() -> None:
    with pytest.raises(InputError, match=r"720 pictures of 1000 x 1000 pixels do not fit[\s\S]*4.17e\+05 pixels each"):
        render(*maps(0.0), lights_mm=[light(0.0)], orbit=720, size_px=[1000, 1000], **SMALL)


def test_periods_near_the_wavelength_and_the_expansion_are_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    place = [light(0.0)]
    render(*maps(0.0, 1.2), lights_mm=place, depth_um=0.03, orders="second order", **SMALL)
    assert not caplog.records
    render(*maps(0.0, 0.5), lights_mm=place, orders="second order", **SMALL)
    said = " ".join(record.getMessage() for record in caplog.records)
    assert "Orders expanded to the second power of a depth of 0.12 um err by 18 percent" in said
    assert "60 percent of the light of gratings of 0.5 um into orders that cannot leave" in said
