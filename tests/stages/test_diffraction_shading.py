"""Shaded bodies and plates: where the highlight is, which colour they have, and what pigment adds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.data.height_fields import HeightField
from pipeline.errors import InputError, InputErrors
from pipeline.optics.diffraction.directions import Directions, unit_vector
from pipeline.optics.diffraction.patch import frequency_sigma
from pipeline.optics.rasterise import Camera
from pipeline.optics.shaded_points import blended
from pipeline.stages.render.brdf_map import brdf_map
from pipeline.stages.render.diffraction_shading import _check_diffraction_shading, diffraction_shading
from pipeline.stages.simulate.blaze import blaze

FLAT = HeightField(np.zeros((8, 8)), 0.5, periodic=True)
BLAZE = blaze(period_um=2.0, depth_um=0.25, orientation_deg=30.0, size_um=8.0, pitch_um=0.1)
FAR = {"shape": "plate", "distance_mm": [1e6], "field_of_view_deg": 1e-3, "size_px": 8, "samples": 1}
SMALL = {"size_px": 48, "samples": 1, "wavelength_step": 20.0, "coherence_um": 10.0, "distance_mm": [300.0]}


@pytest.mark.parametrize(("light_deg", "azimuth_deg"), [(30.0, 90.0), (33.0, 90.0), (24.0, 80.0)])
def test_a_flat_plate_is_a_mirror_where_the_half_vector_is_its_normal(light_deg: float, azimuth_deg: float) -> None:
    settings = {"light_deg": light_deg, "light_azimuth_deg": azimuth_deg, "camera_deg": 30.0}
    whole = {"shape": "plate", "distance_mm": [400.0], "size_px": 97, "samples": 1, "diffuse_share": 0.0}
    (rgb,) = diffraction_shading(FLAT, **settings, **whole, coherence_um=20.0).rgb
    light = unit_vector(np.deg2rad(light_deg), np.deg2rad(azimuth_deg))
    eye = 400 * unit_vector(np.deg2rad(30.0), -np.pi / 2)
    met = eye + eye[2] / light[2] * (light * [1, 1, -1])
    camera = Camera(eye, np.zeros(3), np.array([0.0, 1.0, 0.0]), np.deg2rad(20.0))
    column, row, _ = camera.seen(met[None], *rgb.shape[:2])[0]
    brightest = np.unravel_index(rgb[..., 1].argmax(), rgb.shape[:2])
    assert np.hypot(brightest[0] + 0.5 - row, brightest[1] + 0.5 - column) < 0.75
    assert rgb.max() > 1
    assert np.median(rgb) < 1e-3 * rgb.max()


@pytest.mark.parametrize("pixel", [(22, 20), (28, 11), (20, 25)])
@pytest.mark.parametrize("evaluator", ["chebyshev", "flss"])
def test_a_plate_far_away_has_the_colour_of_the_brdf_in_that_direction(pixel: tuple[int, int], evaluator: str) -> None:
    """Times what a mirror's solid angle makes of its reflectance."""
    how = {"evaluator": evaluator, "coherence_um": 10.0, "light_deg": [20.0], "light_azimuth_deg": 50.0}
    expected = brdf_map(BLAZE, **how, size_px=41).rgb[0][pixel]
    x, y = (2 * pixel[1] + 1) / 41 - 1, 1 - (2 * pixel[0] + 1) / 41
    towards = {"camera_deg": np.rad2deg(np.arcsin(np.hypot(x, y))), "camera_azimuth_deg": np.rad2deg(np.arctan2(y, x))}
    (rgb,) = diffraction_shading(BLAZE, **FAR, **towards, **{**how, "light_deg": 20.0}, diffuse_share=0.0).rgb
    mirror = 0.04 / (frequency_sigma(10.0) * 0.55) ** 2
    assert expected.max() > 1e-4
    np.testing.assert_allclose(rgb, np.broadcast_to(mirror * expected, rgb.shape), rtol=0.02, atol=0.01 * rgb.max())


@pytest.mark.parametrize("angle_deg", [0.0, 40.0, 70.0])
def test_a_mirror_sends_on_the_share_of_the_light_that_fresnel_reflection_says(angle_deg: float) -> None:
    """Radiance relative to a white surface's, over solid angle and ``cos r``: ``pi R cos i``; ``cos r dw = du dv``."""
    sine, cosine, width = np.sin(np.deg2rad(angle_deg)), np.cos(np.deg2rad(angle_deg)), 0.55 * frequency_sigma(65.0)
    u, v = (part.ravel() for part in np.meshgrid(*[np.linspace(-4, 4, 81) * width] * 2))
    view = np.stack([u - sine, v, np.sqrt(1 - (u - sine) ** 2 - v**2)], axis=-1)
    to = Directions(np.broadcast_to([sine, 0.0, cosine], view.shape), view)
    response = np.exp(-(u**2 + v**2) / width**2)[:, None] * np.ones(3)
    how = {"diffuse_share": 0.0, "coherence_um": 65.0, "refractive_index": 1.5, "shadowed": False}
    sent = blended(response, np.zeros_like(view), to, **how).sum(axis=0) * (width / 10) ** 2
    np.testing.assert_allclose(sent, np.pi * cosine * (0.04 + 0.96 * (1 - cosine) ** 5), rtol=0.01)


def test_a_turned_surface_is_a_turned_height_field() -> None:
    field = replace(BLAZE, height_um=np.rot90(BLAZE.height_um))
    turned = diffraction_shading(BLAZE, **SMALL, turn_deg=90.0, diffuse_share=0.0).rgb
    straight = diffraction_shading(BLAZE, **SMALL, diffuse_share=0.0).rgb
    expected = diffraction_shading(field, **SMALL, diffuse_share=0.0).rgb
    np.testing.assert_allclose(turned, expected, atol=2e-3 * expected.max())
    assert np.abs(straight - expected).max() > 0.1 * expected.max()


def test_a_surface_turned_with_light_and_camera_looks_the_same() -> None:
    how = {**FAR, "wavelength_step": 5.0, "coherence_um": 10.0, "diffuse_share": 0.0, "light_deg": 20.0}
    seen = [
        diffraction_shading(
            BLAZE, **how, turn_deg=turn, light_azimuth_deg=50 + turn, camera_deg=20.0, camera_azimuth_deg=215 + turn
        ).rgb
        for turn in (0.0, 90.0, 37.0)
    ]
    for other in seen[1:]:
        np.testing.assert_allclose(other, seen[0], rtol=1e-3)
    assert seen[0].max() > 0.01


@pytest.mark.parametrize("samples", [1, 3])
def test_pigment_alone_is_matt_below_a_surface_that_reflects(samples: int) -> None:
    """Schlick at 40 degrees for n = 1.5."""
    how = {**FAR, "samples": samples, "texture": "grey", "light_deg": 40.0, "diffuse_share": 1.0}
    (rgb,) = diffraction_shading(BLAZE, **how).rgb
    cosine = np.cos(np.deg2rad(40.0))
    np.testing.assert_allclose(rgb, 0.18 * cosine * (1 - 0.04 - 0.96 * (1 - cosine) ** 5), rtol=1e-6)


@pytest.mark.parametrize("shape", ["snake", "plate"])
def test_diffraction_and_pigment_add_up_by_their_shares(shape: str) -> None:
    only, half, none = (
        diffraction_shading(BLAZE, shape=shape, **SMALL, diffuse_share=share).rgb for share in (1.0, 0.5, 0.0)
    )
    np.testing.assert_allclose(half, (only + none) / 2, atol=1e-6 * none.max())
    assert 0 <= only.min() < only.max() < 1
    other = diffraction_shading(FLAT, shape=shape, **SMALL, diffuse_share=1.0).rgb
    np.testing.assert_array_equal(only, other)


def test_samples_average_over_pixels_and_over_places_on_the_surface() -> None:
    rough = HeightField(0.05 * np.random.default_rng(2).normal(size=(60, 60)), 0.2, periodic=True)
    how = {**SMALL, "distance_mm": [60.0], "diffuse_share": 0.0}
    one, many = (diffraction_shading(rough, **{**how, "samples": samples}).rgb[0] for samples in (1, 12))
    lit = (one > 0).all(axis=-1) & (many > 0).all(axis=-1)
    spread = [np.log(picture[lit]).std() for picture in (one, many)]
    assert spread[1] < 0.8 * spread[0]


def test_what_is_wrong_with_a_surface_is_told_once(caplog: pytest.LogCaptureFixture) -> None:
    diffraction_shading(HeightField(np.zeros((8, 8)), 2.0, periodic=True), **{**SMALL, "samples": 3})
    assert caplog.text.count("Samples 2 um apart hold orders") == 1


def test_pictures_zoom_in_by_their_distances() -> None:
    pictures = diffraction_shading(BLAZE, **{**SMALL, "distance_mm": [900.0, 300.0]}, diffuse_share=1.0)
    assert pictures.labels == ("900 mm away, 317 mm wide", "300 mm away, 106 mm wide")
    assert pictures.rgb.shape == (2, 30, 48, 3)
    far, near = (pictures.rgb.any(axis=-1)).mean(axis=(1, 2))
    assert 0 < far < near < 1


def test_what_cannot_be_photographed_is_told() -> None:
    with pytest.raises(InputError, match="sees no surface that is lit"):
        diffraction_shading(FLAT, **{**SMALL, "distance_mm": [1e9]})
    with pytest.raises(InputError, match="nmm looks for light where the surface's periods send it"):
        diffraction_shading(FLAT, **SMALL, evaluator="nmm")


@pytest.mark.parametrize(
    ("setting", "value", "message"),
    [
        ("distance_mm", [], "distance_mm is empty"),
        ("distance_mm", [900.0, 5.0], "distance_mm is 5[\\s\\S]*at least 20"),
        ("light_deg", 90.0, "light_deg is 90[\\s\\S]*0 to 89"),
        ("refractive_index", 1.0, "refractive_index is 1, of which"),
        ("diffuse_share", 1.5, "diffuse_share is 1.5[\\s\\S]*0 to 1"),
        ("field_of_view_deg", 150.0, "field_of_view_deg is 150[\\s\\S]*at most 120"),
    ],
)
def test_impossible_settings_are_refused(setting: str, value: object, message: str) -> None:
    defaults = dict(diffraction_shading.__kwdefaults__)
    _check_diffraction_shading(**defaults)
    with pytest.raises((InputError, InputErrors), match=message):
        _check_diffraction_shading(**{**defaults, setting: value})
