"""What gratings make of a light probe: closed forms, brute force, and the fast evaluators against the reference."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import jv

from pipeline.optics.colour import white_balanced_weights
from pipeline.optics.diffraction.directions import Directions
from pipeline.optics.environment import delta, ordered, separated, window
from pipeline.optics.environment.area_map import area_map
from pipeline.optics.environment.probe import Probe, pose, solid_angles, texel_directions
from pipeline.optics.environment.procedural import SCENES, drawn
from pipeline.optics.environment.spectrum import colour_matrices
from pipeline.optics.grating_brdf import grating_brdf
from pipeline.optics.gratings import window_spread
from pipeline.optics.sheet import spectral
from pipeline.optics.sheet.maps import prepared_gratings
from pipeline.optics.sheet.view import View, rectified

UPRIGHT = pose(0.0, 0.0)
SIZE = 6
VIEW = rectified(SIZE, SIZE, 30.0, np.array([20.0, -30.0, 400.0]))
RNG = np.random.default_rng(7)
ORIENTATION = RNG.uniform(0, np.pi, (SIZE, SIZE))
PERIOD = RNG.uniform(0.9, 1.7, (SIZE, SIZE))
SLOPES = RNG.uniform(-0.2, 0.2, (2, SIZE, SIZE)).astype(np.float32)


def orders_of(step_nm: float = 5.0, depth_um: float = 0.12, **more: float) -> delta.Orders:
    return delta.tabulated_orders(wavelength_step_nm=step_nm, depth_um=depth_um, longest_period_um=1.7, **more)


def towards_eye(view: View = VIEW) -> np.ndarray:
    column, row = np.meshgrid(np.arange(view.columns), np.arange(view.rows))
    points = np.concatenate([view.points(column, row), np.zeros((view.rows, view.columns, 1))], axis=-1)
    away = view.eye_mm - points
    return away / np.linalg.norm(away, axis=-1, keepdims=True)


def reference(probe: Probe, orders: delta.Orders, slopes: np.ndarray | None = None) -> np.ndarray:
    rgb = np.zeros((SIZE, SIZE, 3), np.float32)
    gratings = prepared_gratings(ORIENTATION, PERIOD)
    delta.shade_rows(rgb, (0, SIZE), gratings, view=VIEW, probe=probe, orders=orders, slopes=slopes)
    return rgb


def smooth(rows: int) -> np.ndarray:
    return (1 + 0.5 * texel_directions(rows, 2 * rows)).astype(np.float32)


@pytest.fixture(scope="module")
def room() -> Probe:
    return Probe(drawn(SCENES["room"](8.0), 48), pose(0.3, 0.5))


def test_without_depth_the_sheet_is_a_mirror(room: Probe) -> None:
    mirrored = towards_eye() * [-1, -1, 1]
    np.testing.assert_allclose(reference(room, orders_of(depth_um=0.0)), room.radiance(mirrored), rtol=1e-5)


def test_a_mirror_keeps_left_on_the_left() -> None:
    """A lamp at the viewer's left is seen on the left half of the sheet."""
    rgb = np.zeros((16, 32, 3), np.float32)
    rgb[:, 17:23] = 1
    seen = reference(Probe(rgb, UPRIGHT), orders_of(depth_um=0.0)).mean(axis=(0, 2))
    assert seen[:2].min() > 10 * seen[-2:].max()


@pytest.mark.parametrize("tilted", [False, True])
def test_white_from_everywhere_gives_the_energy_of_all_orders(tilted: bool) -> None:
    """The integral over the spectrum of every order's share and geometry, up to the horizon, in closed form."""
    white = Probe(np.ones((8, 16, 3), np.float32), UPRIGHT)
    depth = 0.12
    slopes = SLOPES if tilted else None
    found = reference(white, orders_of(1.0, depth), slopes)
    nm, weights = white_balanced_weights("D65", 1.0)
    eye = towards_eye()
    for row, column in [(0, 0), (2, 4), (5, 1)]:
        normal = np.array([0, 0, 1.0])
        theta = ORIENTATION[row, column]
        tangent = np.array([np.cos(theta), np.sin(theta), 0])
        if tilted:
            p, q = SLOPES[:, row, column]
            normal = np.array([-p, -q, 1]) / np.sqrt(1 + p * p + q * q)
            tangent = np.array([tangent[0], tangent[1], p * tangent[0] + q * tangent[1]])
            tangent /= np.linalg.norm(tangent)
        o = eye[row, column]
        u0, c, v = -o @ tangent, o @ normal, -o @ np.cross(normal, tangent)
        rim = np.sqrt(1 - v * v)

        total = weights.T @ jv(0, np.pi * depth * 2 * c / (nm / 1000)) ** 2
        for m in [*range(-6, 0), *range(1, 7)]:
            ends = np.clip((u0 + m * np.array([0.38, 0.78]) / PERIOD[row, column]) / rim, -1, 1)
            angle = np.linspace(*np.sort(np.arcsin(ends)), 2001)
            u, cos_light = rim * np.sin(angle), rim * np.cos(angle)
            per_order = PERIOD[row, column] / m
            wavelength, w = (u - u0) * per_order, c + cos_light
            part = jv(m, np.pi * depth * w / wavelength) ** 2 * ((1 + cos_light * c - u * u0 - v * v) / w) ** 2 / c
            seen = np.stack([np.interp(1000 * wavelength, nm, weights[:, i], 0, 0) for i in range(3)])
            total += np.trapezoid(part * seen, angle) * 1000 * abs(per_order)
        assert found[row, column] == pytest.approx(total, rel=2e-3)


def test_brute_force_is_the_brdf_summed_over_the_probe() -> None:
    """The sum over parts of texels of BRDF, cosine and light, written out with the project's BRDF."""
    probe = Probe(drawn(SCENES["room"](20.0), 12), pose(0.2, 0.4))
    coherence, orders = 6.0, orders_of(40.0)
    lights = window.lights_of(probe, coherence, 0.38)
    found = np.zeros((SIZE, SIZE, 3), np.float32)
    gratings = prepared_gratings(ORIENTATION, PERIOD)
    window.shade_rows(found, (0, SIZE), gratings, view=VIEW, lights=lights, orders=orders, coherence_um=coherence)
    nodes, matrices = colour_matrices(40.0)
    eye = towards_eye()
    for row, column in [(0, 0), (3, 4)]:
        pairs = Directions(lights.towards[:, None].astype(np.float64), eye[row, column][None, None])
        total = np.zeros(3)
        for nm, matrix in zip(nodes, matrices, strict=True):
            brdf = grating_brdf(
                pairs,
                orientation_rad=ORIENTATION[row, column],
                period_um=PERIOD[row, column],
                depth_um=0.12,
                wavelength_um=nm / 1000,
                coherence_um=coherence,
            )[:, 0]
            total += matrix @ ((brdf * lights.towards[:, 2]) @ lights.rgb.astype(np.float64))
        assert found[row, column] == pytest.approx(total, rel=2e-3)


def test_a_wide_window_agrees_with_brute_force() -> None:
    """Where nothing in the probe is as narrow as the window's lobes, the delta response is right."""
    probe = Probe(smooth(24), pose(0.0, 0.3))
    lights = window.lights_of(probe, 25.0, 0.38)
    found = np.zeros((SIZE, SIZE, 3), np.float32)
    gratings = prepared_gratings(ORIENTATION, PERIOD)
    orders = orders_of(5.0)
    window.shade_rows(found, (0, SIZE), gratings, view=VIEW, lights=lights, orders=orders, coherence_um=25.0)
    np.testing.assert_allclose(found, reference(probe, orders), rtol=0.01)


@pytest.mark.parametrize("tilted", [False, True])
@pytest.mark.parametrize("index", [None, 1.5])
def test_look_ups_agree_with_the_reference(tilted: bool, index: float | None) -> None:
    probe = Probe(smooth(64), pose(0.2, 0.5))
    reflectance = 1.0 if index is None else ((index - 1) / (index + 1)) ** 2
    orders = orders_of(5.0, normal_reflectance=reflectance)
    slopes = SLOPES if tilted else None
    area = area_map(probe, all_around=tilted)
    look_ups = ordered.all_look_ups(orders, area, 1.3)
    found = np.zeros((SIZE, SIZE, 3), np.float32)
    gratings = prepared_gratings(ORIENTATION, PERIOD)
    ordered.shade_rows(found, (0, SIZE), gratings, view=VIEW, probe=probe, map_=area, look_ups=look_ups, slopes=slopes)
    exact = reference(probe, orders, slopes)
    assert np.abs(found - exact).max() < 0.001 * exact.max()
    parts = np.zeros((SIZE, SIZE, 3), np.float32)
    ordered.shade_rows(
        parts,
        (0, SIZE),
        gratings,
        view=VIEW,
        probe=probe,
        map_=area,
        look_ups=look_ups.picked(np.arange(0, len(look_ups), 2)),
        slopes=slopes,
    )
    rest = look_ups.picked(np.arange(1, len(look_ups), 2)).without_zeroth()
    ordered.shade_rows(parts, (0, SIZE), gratings, view=VIEW, probe=probe, map_=area, look_ups=rest, slopes=slopes)
    np.testing.assert_allclose(parts, found, rtol=1e-4)


@pytest.mark.parametrize("constant", [False, True])
def test_values_at_nodes_agree_with_the_reference(constant: bool) -> None:
    probe = Probe(drawn(SCENES["room"](20.0), 16), pose(0.1, 0.3))
    rows, columns = 15, 20
    view = rectified(rows, columns, 8.0, np.array([0.0, 0.0, 500.0]))
    y, x = np.mgrid[:rows, :columns]
    turned = (0.1 * x + 0.07 * y) % np.pi
    period = np.full((rows, columns), 1.3) if constant else 1.3 + 0.2 * np.sin(x / 3)
    orders = orders_of(20.0)

    def paint(rgb: np.ndarray, gratings: np.ndarray, seen: View) -> None:
        delta.shade_rows(rgb, (0, len(rgb)), gratings, view=seen, probe=probe, orders=no_mirror)

    no_mirror = delta.Orders(
        orders.wavelength_um,
        orders.matrices,
        np.concatenate([np.zeros_like(orders.share[:1]), orders.share[1:]]),
        orders.per_phase,
        orders.depth_um,
    )
    nodes = separated.nodes_of(view, (float(period.min()), float(period.max())), 0.03)
    values = separated.worked_out(nodes, view, paint)
    assert values.shape[:4] == (len(nodes.lines_per_um), nodes.orientations, *nodes.places)
    assert (len(nodes.lines_per_um) == 1) == constant
    for shift in [(0.0, 0.0), (0.4, -0.3)]:
        gratings = prepared_gratings(turned, period)
        exact, found = (np.zeros((rows, columns, 3), np.float32) for _ in range(2))
        paint(exact, gratings, view.moved(*shift))
        separated.interpolate_rows(found, (0, rows), gratings, nodes=nodes, values=values, shift=shift)
        assert np.abs(found - exact).max() < 0.03 * exact.max()


def test_a_small_lamp_in_a_probe_is_a_point_light_far_away() -> None:
    """Absolutely: the point light's unit is its irradiance times the lobe's peak at 550 nm."""
    rows, sigma, coherence = 512, np.deg2rad(0.5), 20.0
    towards = texel_directions(rows, 2 * rows)
    lamp = np.array([0.3, 0.2, 0.0])
    lamp[2] = np.sqrt(1 - lamp @ lamp)
    bright = np.exp(-((towards - lamp) ** 2).sum(axis=-1) / (2 * sigma**2)).astype(np.float32)
    probe = Probe(np.repeat(bright[..., None], 3, axis=-1), UPRIGHT)
    irradiance = (bright * solid_angles(rows, 2 * rows)[:, None]).sum()
    view = rectified(SIZE, SIZE, 10.0, np.array([0.0, 0.0, 300.0]))
    orientation = np.arctan2(lamp[1], lamp[0]) + RNG.uniform(-0.1, 0.1, (SIZE, SIZE))
    gratings = prepared_gratings(orientation, PERIOD)
    found = np.zeros((SIZE, SIZE, 3), np.float32)
    lights = window.lights_of(probe, coherence, 0.38)
    window.shade_rows(
        found, (0, SIZE), gratings, view=view, lights=lights, orders=orders_of(5.0), coherence_um=coherence
    )
    distance = 1e5
    spectrum = spectral.spectral_table(
        light="D65",
        wavelength_step_nm=5.0,
        coherence_um=coherence,
        depth_um=0.12,
        longest_period_um=1.7,
        largest_half_vector=1.0,
    )
    torch = np.zeros((SIZE, SIZE, 3), np.float32)
    spectral.shade_rows(
        torch,
        (0, SIZE),
        orientation,
        PERIOD,
        view=view,
        light_mm=distance * lamp,
        light_sigma_mm=distance * sigma,
        table=spectrum,
    )
    unit = irradiance / (2 * np.pi * window_spread(0.55, coherence) ** 2) * (distance / 500) ** 2
    assert torch.max() > 0
    np.testing.assert_allclose(found, unit * torch, atol=0.02 * float(found.max()))
