"""Evaluators of the spectral response against the sum that defines it, closed forms, and each other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage
from scipy.special import jv

from pipeline.optics.diffraction.bumps import BumpResponse
from pipeline.optics.diffraction.chebyshev import chebyshev_response
from pipeline.optics.diffraction.direct import direct_response, nonuniform_response
from pipeline.optics.diffraction.directions import Directions, disc_of_views, unit_vector
from pipeline.optics.diffraction.evaluators import Recipe, lattice_orders, prepared
from pipeline.optics.diffraction.patch import Patch, SpectralResponse, frequency_sigma
from pipeline.optics.diffraction.replicas import replica_response
from pipeline.optics.diffraction.taylor import taylor_response

Make = Callable[[Patch, Directions, NDArray[np.float64], float], SpectralResponse]

EXACT: dict[str, Make] = {
    "chebyshev": lambda patch, to, lam, width: chebyshev_response(
        patch, to.uvw, lam, coherence_um=width, tolerance=1e-6
    ),
    "taylor": lambda patch, to, lam, width: taylor_response(patch, to.uvw, lam, coherence_um=width, tolerance=1e-6),
    "direct": lambda patch, to, lam, width: direct_response(patch, coherence_um=width),
    "nonuniform": lambda patch, to, lam, width: nonuniform_response(patch, coherence_um=width, tolerance=1e-9),
}
exact = pytest.mark.parametrize("name", EXACT)
VISIBLE = np.array([0.4, 0.55, 0.7])


def respond(response: SpectralResponse, to: Directions, lam: NDArray[np.float64]) -> NDArray[np.float32]:
    """Of every wavelength, shape (L, M, N)."""
    u = to.uvw[2]
    out = np.full((len(lam), *u.shape), np.nan, np.float32)
    kernel = response.rows(to.uvw, lam, np.eye(len(lam)), out)
    kernel(0, 2)
    kernel(2, len(u))
    return out


def made(name: str, patch: Patch, to: Directions, lam: NDArray[np.float64], width: float) -> NDArray[np.float32]:
    if name == "nonuniform":
        pytest.importorskip("finufft")
    return respond(EXACT[name](patch, to, lam, width), to, lam)


def rough(rows: int = 24, columns: int = 33, relief_um: float = 0.4) -> Patch:
    height = ndimage.gaussian_filter(np.random.default_rng(1).normal(size=(rows, columns)), 2, mode="wrap")
    return Patch((height - height.min()) / np.ptp(height) * relief_um, 0.08)


def scattered() -> Directions:
    """Pairs that form no grid."""
    random = np.random.default_rng(4)
    light, view = (unit_vector(random.uniform(0, 1.2, (5, 7)), random.uniform(0, 6, (5, 7))) for _ in range(2))
    return Directions(light, view)


def in_plane(theta_rad: NDArray[np.float64], light_rad: float = 0.0, azimuth_rad: float = 0.0) -> Directions:
    light = unit_vector(light_rad, azimuth_rad)[None, None]
    return Directions(light, unit_vector(np.stack([theta_rad] * 3), azimuth_rad))


@exact
@pytest.mark.parametrize("grid", [True, False])
def test_a_rough_surface_responds_as_the_sum_over_its_points(name: str, grid: bool) -> None:
    to = disc_of_views(unit_vector(0.35, 0.5), 9) if grid else scattered()
    found = made(name, rough(), to, VISIBLE, 6.0)
    expected = made("direct", rough(), to, VISIBLE, 6.0)
    assert expected.max() > 0.02
    np.testing.assert_allclose(found, expected, atol=1e-6)


@exact
def test_a_mirror_sends_all_light_into_a_gaussian_around_its_direction(name: str) -> None:
    away = np.linspace(-0.08, 0.08, 17)
    to = in_plane(-0.5 + away, light_rad=0.5)
    found = made(name, Patch(np.full((8, 8), 0.3), 0.1), to, VISIBLE, 10.0)
    frequency = to.uvw[0] / VISIBLE[:, None, None]
    np.testing.assert_allclose(found, np.exp(-((frequency / frequency_sigma(10.0)) ** 2)), atol=2e-6)


@exact
@pytest.mark.parametrize("order", [-2, -1, 0, 1, 2])
def test_a_cosine_grating_has_bessel_orders(name: str, order: int) -> None:
    """Raman and Nath: order n of a phase ``exp(i b cos x)`` has the power ``J_n(b)^2``."""
    depth, period = 0.3, 2.0
    patch = Patch(np.tile(depth / 2 * np.cos(2 * np.pi * np.arange(40) / 40), (4, 1)), period / 40)
    sine = order * VISIBLE / period
    for i, wavelength in enumerate(VISIBLE):
        to = in_plane(np.array([np.arcsin(-sine[i])]))
        phase = np.pi * depth / wavelength * abs(to.uvw[2][0, 0])
        found = made(name, patch, to, VISIBLE[i : i + 1], 16.0)
        assert found[0, 0, 0] == pytest.approx(jv(order, phase) ** 2, abs=3e-6)


@exact
@pytest.mark.parametrize(("azimuth_deg", "turn"), [(0, 0), (90, 1), (180, 2), (270, 3)])
def test_a_blaze_that_rises_towards_the_viewer_sends_light_away(name: str, azimuth_deg: float, turn: int) -> None:
    """The first order of a blaze as high as half a wavelength lies where its facets reflect, against their slope."""
    ramp = np.tile(np.arange(50) / 50 * 0.25, (50, 1))
    patch = Patch(np.rot90(ramp, turn), 0.05)
    first = np.arcsin(0.5 / 2.5)
    to = in_plane(np.array([-first, first]), azimuth_rad=np.deg2rad(azimuth_deg))
    against, along = made(name, patch, to, np.array([0.5]), 15.0)[0, 0]
    assert against > 0.95
    assert along < 0.02


def test_fewer_polynomials_than_needed_err_and_a_looser_tolerance_takes_fewer() -> None:
    to = scattered()
    expected = made("direct", rough(), to, VISIBLE, 6.0)
    errors, sizes = [], []
    for tolerance in (1e-2, 1e-3, 1e-4):
        response = chebyshev_response(rough(), to.uvw, VISIBLE, coherence_um=6.0, tolerance=tolerance)
        errors.append(np.abs(respond(response, to, VISIBLE) - expected).max())
        sizes.append(response.table.shape[1])
        assert errors[-1] < 2 * tolerance
    assert sizes == sorted(set(sizes))
    few = chebyshev_response(rough(), to.uvw, VISIBLE, coherence_um=6.0, degree=3)
    assert np.abs(respond(few, to, VISIBLE) - expected).max() > 10 * errors[-1]


def test_wavelengths_that_no_order_sends_are_left_dark_and_the_rest_is_the_same() -> None:
    period = 2.5
    patch = Patch(np.tile(np.arange(50) / 50 * 0.25, (4, 1)), period / 50)
    to = in_plane(np.linspace(-1.2, 1.2, 241))
    lam = np.array([0.5])
    whole = respond(taylor_response(patch, to.uvw, lam, coherence_um=65.0), to, lam)
    orders = np.stack([np.arange(-9, 10) / period, np.zeros(19)], axis=1)
    some = respond(taylor_response(patch, to.uvw, lam, coherence_um=65.0, orders_per_um=orders), to, lam)
    np.testing.assert_allclose(some, whole, atol=1e-8)
    first = respond(taylor_response(patch, to.uvw, lam, coherence_um=65.0, orders_per_um=orders[8:9]), to, lam)
    near = np.abs(to.uvw[0] / 0.5 - orders[8, 0]) < 4 * frequency_sigma(65.0)
    np.testing.assert_allclose(first[0], np.where(near, whole[0], 0), atol=1e-8)
    assert (first[0] == 0).mean() > 0.8


def test_orders_are_all_that_the_directions_reach() -> None:
    to = disc_of_views(unit_vector(1.0), 21)
    (u, v, _), lam = to.uvw, np.array([0.4, 0.7])
    farthest = 20 * (v.max() / 0.4 + 6 * frequency_sigma(65.0))
    assert len(lattice_orders(np.array([[0.0, 1 / 20]]), to.uvw, lam, 65.0)) == 2 * int(farthest) + 1
    first, second = np.array([1 / 4, 1 / 30]), np.array([-1 / 9, 1 / 5])
    found = lattice_orders(np.stack([first, second]), to.uvw, lam, 65.0)
    m, n = np.mgrid[-90:91, -90:91]
    every = (m[..., None] * first + n[..., None] * second).reshape(-1, 2)
    reached = [(every[:, i] > part.min() / 0.4) & (every[:, i] < part.max() / 0.4) for i, part in enumerate((u, v))]
    expected = {tuple(order) for order in np.round(every[reached[0] & reached[1]], 9)}
    assert len(expected) > 400
    assert expected <= {tuple(order) for order in np.round(found, 9)}


def test_a_wide_grating_is_lit_as_brightly_where_only_its_orders_are_looked_at() -> None:
    """Order 60 of 24 um at grazing views, which a list of the first 40 would leave dark."""
    steps = np.where(np.arange(240) % 240 < 3, 0.12, 0.0)[None]
    recipe = Recipe("flss", 60.0, 1e-3, None, np.array([[1 / 24, 0.0]]))
    to, lam = in_plane(np.linspace(-1.4, 1.4, 141), light_rad=0.9), np.array([0.4])
    flss, nmm = (
        respond(prepared(replace(recipe, evaluator=name), Patch(steps, 0.1), to, lam), to, lam)
        for name in ("flss", "nmm")
    )
    far = np.abs(to.uvw[0]) / 0.4 > 45 / 24
    assert flss[0, far].max() > 1e-5
    np.testing.assert_allclose(nmm, flss, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("replicas", [1, 2, 5])
def test_patches_side_by_side_respond_as_the_sum_over_their_points(replicas: int) -> None:
    patch = rough(16, 21)
    to = in_plane(np.linspace(-0.9, 0.9, 13), light_rad=0.3, azimuth_rad=0.7)
    width = 21 * 0.08 * replicas / 0.836
    response = replica_response(patch, to.uvw, VISIBLE, coherence_um=width, reach=100)
    assert response.replicas[0] == replicas
    height = np.tile(patch.height_um, response.replicas[::-1])
    y, x = np.mgrid[: height.shape[0], : height.shape[1]] * 0.08
    found = respond(response, to, VISIBLE)
    for i, wavelength in enumerate(VISIBLE):
        u, v, w = (part[0] for part in to.uvw)
        phase = u[:, None, None] * x - v[:, None, None] * y + w[:, None, None] * height
        expected = np.abs(np.exp(2j * np.pi * phase / wavelength).mean(axis=(1, 2))) ** 2
        # The sinc of samples that do not go on for ever is a little off between lines.
        np.testing.assert_allclose(found[i, 0], expected, atol=3e-3)


def test_patches_side_by_side_have_a_limit_where_their_series_divides_by_zero() -> None:
    period = 2.5
    patch = Patch(np.tile(np.arange(50) / 50 * 0.25, (50, 1)), period / 50)
    to = in_plane(np.arcsin(-np.arange(-2, 3) * 0.5 / period))
    found = respond(replica_response(patch, to.uvw, np.array([0.5]), coherence_um=20.0), to, np.array([0.5]))
    expected = made("direct", patch, to, np.array([0.5]), 20.0)
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_regular_bumps_send_light_where_the_grating_equation_says() -> None:
    theta = np.linspace(-1.4, 1.4, 20001)
    to = in_plane(theta, light_rad=0.4)
    found = respond(BumpResponse(np.array([1 / 1.6, 0.0]), 65.0), to, np.array([0.55]))[0, 0]
    peaks = theta[1:-1][(found[1:-1] > found[:-2]) & (found[1:-1] >= found[2:]) & (found[1:-1] > 0.5)]
    sines = -np.sin(0.4) - np.arange(-9, 10) * 0.55 / 1.6
    expected = np.sort(np.arcsin(sines[np.abs(sines) < np.sin(1.39)]))
    np.testing.assert_allclose(peaks, expected, atol=2e-4)


def test_orders_of_bumps_are_as_wide_as_the_light_of_a_mirror() -> None:
    lattice, random = np.array([0.3, -0.5]), np.random.default_rng(2)
    near = np.array([0.3, -0.5]) + 0.01 * random.normal(size=(4, 6, 2))
    view = np.concatenate([-0.55 * near, np.zeros((4, 6, 1))], axis=-1)
    view[..., 2] = np.sqrt(1 - (view**2).sum(axis=-1))
    to = Directions(unit_vector(0.0)[None, None], view)
    found = respond(BumpResponse(lattice, 30.0), to, np.array([0.55]))[0]
    expected = np.exp(-((near - lattice) ** 2).sum(axis=-1) / frequency_sigma(30.0) ** 2)
    assert np.ptp(expected) > 0.4
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_the_reference_is_exact_whatever_the_tolerance() -> None:
    pytest.importorskip("finufft")
    to = scattered()
    found = respond(prepared(Recipe("nufft", 6.0, 0.1), rough(), to, VISIBLE), to, VISIBLE)
    np.testing.assert_allclose(found, made("direct", rough(), to, VISIBLE, 6.0), atol=1e-6)


def test_directions_that_do_not_exist_are_dark() -> None:
    to = disc_of_views(unit_vector(0.2), 8)
    for name in EXACT:
        found = made(name, rough(), to, VISIBLE, 6.0)
        assert (found[:, 0, 0] == 0).all()
        assert (found[:, 4, 4] > 0).all()
