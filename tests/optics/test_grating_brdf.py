"""The BRDF of a sinusoidal grating: height fields, scalar efficiencies, energy, reciprocity, and the paper's form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import jv

from pipeline.optics.diffraction.direct import direct_response
from pipeline.optics.diffraction.directions import Directions, schlick, unit_vector
from pipeline.optics.diffraction.patch import Patch
from pipeline.optics.grating_brdf import grating_brdf, grating_response, relative_grating_brdf
from pipeline.optics.surfaces import cosine, grating_tile

MIRROR = {"orientation_rad": 0.3, "period_um": 1.2, "depth_um": 0.0}


def sphere(seed: int, count: int) -> np.ndarray:
    """Unit vectors above the sheet, none at a grazing angle."""
    rng = np.random.default_rng(seed)
    return unit_vector(np.arccos(rng.uniform(0.3, 1, count)), rng.uniform(0, 2 * np.pi, count))


@pytest.mark.parametrize("orientation_deg", [0.0, 30.0, 120.0])
@pytest.mark.parametrize("depth_um", [0.1, 0.45])
def test_it_is_the_diffraction_of_a_cosine_height_field(orientation_deg: float, depth_um: float) -> None:
    wavelength = 0.53
    tile = grating_tile(period_um=2.5, orientation_rad=np.deg2rad(orientation_deg), size_um=20.0, pitch_um=0.1)
    patch = Patch(depth_um * cosine(tile.phase()), tile.pitch_um)
    towards = tile.orientation_rad
    light = unit_vector(0.35, 0.8)
    orders = np.arange(-2, 3)[:, None]
    away = np.array([-0.011, 0.0, 0.004])
    u = (orders * wavelength / 2.5 + away).ravel()
    x, y = u * np.cos(towards) - light[0], u * np.sin(towards) - light[1]
    view = np.stack([x, y, np.sqrt(1 - x**2 - y**2)], axis=-1)
    directions = Directions(light[None, None], view[None])
    surface = direct_response(patch, coherence_um=20.0)
    out = np.empty((1, 1, len(u)), np.float32)
    surface.rows(directions.uvw, np.array([wavelength]), np.ones((1, 1)), out)(0, 1)
    found = grating_response(
        directions,
        orientation_rad=towards,
        period_um=2.5,
        depth_um=depth_um,
        wavelength_um=wavelength,
        coherence_um=20.0,
    )
    assert out.max() > 0.1
    np.testing.assert_allclose(found[0], out[0, 0], atol=2e-5)


@pytest.mark.parametrize("order", [0, 1, -1, 2, 3])
def test_at_small_angles_an_order_takes_its_scalar_efficiency(order: int) -> None:
    """Over an order's directions the BRDF times the cosine integrates to ``J_m(2 pi h0 / lambda)^2``."""
    wavelength, period, depth = 0.55, 40.0, 0.2
    step = 0.0004
    x = order * wavelength / period + step * np.arange(-16, 17)
    x, y = np.meshgrid(x, step * np.arange(-16, 17))
    view = np.stack([x, y, np.sqrt(1 - x**2 - y**2)], axis=-1)
    brdf = grating_brdf(
        Directions(unit_vector(0.0)[None, None], view),
        orientation_rad=0.0,
        period_um=period,
        depth_um=depth,
        wavelength_um=wavelength,
        coherence_um=400.0,
    )
    assert brdf.sum() * step**2 == pytest.approx(jv(order, 2 * np.pi * depth / wavelength) ** 2, rel=2e-3)


def reflected(light: np.ndarray, **grating: float) -> float:
    """Part of the light that goes anywhere."""
    places = (np.arange(160) + 0.5) / 80 - 1
    x, y = np.meshgrid(places, places)
    inside = x**2 + y**2 < 1
    view = np.stack([x, y, np.sqrt(1 - np.where(inside, x**2 + y**2, 0))], axis=-1)
    brdf = grating_brdf(Directions(light[None, None], view), coherence_um=12.0, **grating)
    return float(brdf[inside].sum() / 80**2)


@settings(max_examples=20, deadline=None)
@given(
    theta=st.floats(0, 0.5),
    phi=st.floats(0, 2 * np.pi),
    orientation=st.floats(0, np.pi),
    period=st.floats(3, 9),
    depth=st.floats(0, 0.15),
    wavelength=st.floats(0.4, 0.75),
)
def test_no_more_light_leaves_than_comes(theta, phi, orientation, period, depth, wavelength) -> None:
    light = unit_vector(theta, phi)
    grating = {"orientation_rad": orientation, "period_um": period, "depth_um": depth, "wavelength_um": wavelength}
    everything = reflected(light, **grating)
    assert 0.9 < everything < 1.005
    assert reflected(light, refractive_index=1.5, **grating) < 0.15 * everything


def test_scalar_theory_makes_light_where_an_order_leaves_at_a_grazing_angle() -> None:
    """What limits the model, and not what anybody wants: the second order leaves at 78 degrees."""
    settings = {"orientation_rad": 0.0, "depth_um": 0.3, "wavelength_um": 0.55}
    assert reflected(unit_vector(0.0), period_um=2 * 0.55 / np.sin(np.deg2rad(78)), **settings) > 1.05


@pytest.mark.parametrize("form", ["exact", "second order"])
def test_light_and_viewer_can_change_places(form) -> None:
    light, view = sphere(1, 200), sphere(2, 200)
    grating = {"orientation_rad": 0.7, "period_um": 1.4, "depth_um": 0.2, "wavelength_um": 0.5, "coherence_um": 3.0}
    here, back = (
        grating_brdf(Directions(*pair), form=form, refractive_index=1.5, **grating)
        for pair in ((light, view), (view, light))
    )
    assert (here > 1e-4).sum() > 10
    np.testing.assert_allclose(here, back, rtol=1e-9)


def test_the_papers_form_approaches_the_exact_one_with_the_square_of_the_square_of_the_depth() -> None:
    directions = Directions(sphere(3, 60), sphere(4, 60))
    grating = {"orientation_rad": 0.7, "period_um": 1.4, "wavelength_um": 0.5, "coherence_um": 3.0}

    def error(depth_um: float) -> float:
        exact, paper = (
            grating_response(directions, depth_um=depth_um, form=form, **grating) for form in ("exact", "second order")
        )
        return float(np.abs(paper - exact).max())

    assert error(0.04) / error(0.02) == pytest.approx(16, rel=0.1)
    assert error(0.02) < 1e-4


def test_without_depth_it_is_a_mirror_and_relative_to_one_it_is_one() -> None:
    light = unit_vector(0.5, 1.0)
    mirror = Directions(light, light * [-1, -1, 1])
    absolute = grating_brdf(mirror, wavelength_um=0.5, coherence_um=40.0, refractive_index=1.5, **MIRROR)
    assert absolute == pytest.approx(4 * np.pi * 100 / 0.25 * schlick(mirror, 1.5))
    above = Directions(unit_vector(0.0), unit_vector(0.0))
    assert relative_grating_brdf(above, wavelength_um=0.5, **MIRROR) == pytest.approx(1)


def test_everything_broadcasts() -> None:
    directions = Directions(sphere(5, 4)[:, None], sphere(6, 3)[None])
    period = np.full((4, 3), 1.3)
    period[1, 2] = 1.1
    settings = {"orientation_rad": 0.2, "depth_um": 0.1, "coherence_um": 3.0}
    found = grating_response(directions, period_um=period, wavelength_um=0.5, **settings)
    one = Directions(directions.light[1, 0], directions.view[0, 2])
    assert found.shape == (4, 3)
    assert found[1, 2] == pytest.approx(grating_response(one, period_um=1.1, wavelength_um=0.5, **settings), abs=1e-12)
