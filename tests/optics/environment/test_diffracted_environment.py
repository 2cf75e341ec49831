"""What gratings make of a light probe: closed forms, brute force, and the fast evaluators against the reference."""

from __future__ import annotations

from dataclasses import replace

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
    settings = {"wavelength_step_nm": step_nm, "depth_um": depth_um, "longest_period_um": 1.7}
    return delta.tabulated_orders(**settings | more)


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


@pytest.mark.parametrize(("tilted", "highest"), [(False, 6), (True, 6), (False, 1)])
def test_white_from_everywhere_gives_the_energy_of_all_orders(tilted: bool, highest: int) -> None:
    """The integral over the spectrum of every order's share and geometry, up to the horizon, in closed form."""
    white = Probe(np.ones((8, 16, 3), np.float32), UPRIGHT)
    depth = 0.12
    slopes = SLOPES if tilted else None
    orders = orders_of(1.0, depth)
    found = reference(white, replace(orders, share=orders.share[: highest + 1]), slopes)
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
        for m in [*range(-highest, 0), *range(1, highest + 1)]:
            ends = np.clip((u0 + m * np.array([0.38, 0.78]) / PERIOD[row, column]) / rim, -1, 1)
            angle = np.linspace(*np.sort(np.arcsin(ends)), 2001)
            u, cos_light = rim * np.sin(angle), rim * np.cos(angle)
            per_order = PERIOD[row, column] / m
            wavelength, w = (u - u0) * per_order, c + cos_light
            part = jv(m, np.pi * depth * w / wavelength) ** 2 * ((1 + cos_light * c - u * u0 - v * v) / w) ** 2 / c
            seen = np.stack([np.interp(1000 * wavelength, nm, weights[:, i], 0, 0) for i in range(3)])
            total += np.trapezoid(part * seen, angle) * 1000 * abs(per_order)
        assert found[row, column] == pytest.approx(total, rel=2e-3)


@pytest.mark.parametrize("period_um", [PERIOD, np.full((SIZE, SIZE), 6.0)], ids=["short", "long"])
def test_brute_force_is_the_brdf_summed_over_the_probe(period_um: np.ndarray) -> None:
    """The sum over parts of texels of BRDF, cosine and light; orders of long periods reach over the mirror image."""
    probe = Probe(drawn(SCENES["room"](20.0), 12), pose(0.2, 0.4))
    coherence, orders = 6.0, orders_of(40.0, longest_period_um=6.0)
    lights = window.lights_of(probe, coherence, 0.38)
    found = np.zeros((SIZE, SIZE, 3), np.float32)
    gratings = prepared_gratings(ORIENTATION, period_um)
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
                period_um=period_um[row, column],
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
@pytest.mark.parametrize(("index", "step_nm", "off"), [(None, 5.0, 1e-3), (1.5, 5.0, 1e-3), (None, 100.0, 0.01)])
def test_look_ups_agree_with_the_reference(tilted: bool, index: float | None, step_nm: float, off: float) -> None:
    """At wide steps but for the mean of 1 / cos over a cell, which look-ups take near the horizon alone."""
    probe = Probe(smooth(64), pose(0.2, 0.5))
    reflectance = 1.0 if index is None else ((index - 1) / (index + 1)) ** 2
    orders = orders_of(step_nm, normal_reflectance=reflectance)
    slopes = SLOPES if tilted else None
    area = area_map(probe, all_around=tilted)
    look_ups = replace(every := ordered.all_look_ups(orders, area, 1.3), level=np.zeros_like(every.level))
    found = np.zeros((SIZE, SIZE, 3), np.float32)
    gratings = prepared_gratings(ORIENTATION, PERIOD)
    ordered.shade_rows(found, (0, SIZE), gratings, view=VIEW, probe=probe, map_=area, look_ups=look_ups, slopes=slopes)
    exact = reference(probe, orders, slopes)
    assert np.abs(found - exact).max() < off * exact.max()
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
    turned = 0.17 * x + 0.2 * y - 1
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


@pytest.mark.parametrize("depth_um", [0.12, 3.0])
def test_shares_of_all_orders_are_those_of_the_field_and_add_up(depth_um: float) -> None:
    orders = orders_of(40.0, depth_um, longest_period_um=30.0)
    assert orders.share[0] + 2 * orders.share[1:].sum(axis=0) == pytest.approx(1, abs=1e-6)
    between = np.arange(orders.share.shape[1] - 1) + 0.5
    exact = jv(np.arange(len(orders.share))[:, None], between / orders.per_phase / 2) ** 2
    assert (orders.share[:, 1:] + orders.share[:, :-1]) / 2 == pytest.approx(exact, abs=1e-4)


def test_a_coarser_map_has_at_least_two_texels_between_wavelengths() -> None:
    area = area_map(Probe(smooth(64), UPRIGHT))
    look_ups = ordered.all_look_ups(orders_of(40.0), area, 1.3)
    apart = np.abs(look_ups.order) * 0.04 / 1.3
    texels = area.texel_rad * 2.0**look_ups.level
    assert look_ups.level.max() > 2
    assert (2 * texels[look_ups.level > 0] <= apart[look_ups.level > 0]).all()
    assert (4 * texels[texels < texels.max()] > apart[texels < texels.max()]).all()


@pytest.mark.parametrize("more", [{"depth_um": 0.0}, {"longest_period_um": 0.15}])
def test_a_sheet_that_does_not_diffract_has_no_look_ups(room: Probe, more: dict[str, float]) -> None:
    orders, area = orders_of(**more), area_map(room)
    look_ups = ordered.all_look_ups(orders, area, 0.15)
    assert len(look_ups) == 0
    found = np.zeros((SIZE, SIZE, 3), np.float32)
    gratings = prepared_gratings(ORIENTATION, np.full((SIZE, SIZE), 0.15))
    ordered.shade_rows(found, (0, SIZE), gratings, view=VIEW, probe=room, map_=area, look_ups=look_ups)
    exact = np.zeros_like(found)
    delta.shade_rows(exact, (0, SIZE), gratings, view=VIEW, probe=room, orders=orders)
    np.testing.assert_allclose(found, exact, rtol=1e-3)


@pytest.mark.parametrize("height_mm", [1.0, 1e-2, 1e-5])
@pytest.mark.parametrize("reflectance", [1.0, 0.04])
def test_a_camera_almost_in_the_sheet_sees_numbers(room: Probe, height_mm: float, reflectance: float) -> None:
    """Where single precision no longer tells a facet that looks along the sheet from one that looks below it."""
    view = rectified(SIZE, SIZE, 30.0, np.array([500.0, 0.3, height_mm]))
    orders, area = orders_of(20.0, normal_reflectance=reflectance), area_map(room)
    look_ups = ordered.all_look_ups(orders, area, 1.3)
    found, exact = (np.zeros((SIZE, SIZE, 3), np.float32) for _ in range(2))
    gratings = prepared_gratings(ORIENTATION, PERIOD)
    delta.shade_rows(exact, (0, SIZE), gratings, view=view, probe=room, orders=orders)
    ordered.shade_rows(found, (0, SIZE), gratings, view=view, probe=room, map_=area, look_ups=look_ups)
    assert np.isfinite(exact).all()
    assert np.isfinite(found).all()


def test_brute_force_takes_light_from_beyond_the_sheet_where_bumps_face_it() -> None:
    """A facet that leans by 45 degrees mirrors what a flat sheet has beside it."""
    behind = (texel_directions(16, 32)[..., 2] < 0).astype(np.float32)
    probe = Probe(np.repeat(behind[..., None], 3, axis=-1), UPRIGHT)
    slopes = np.stack([np.full((SIZE, SIZE), -1.5), np.zeros((SIZE, SIZE))]).astype(np.float32)
    orders = orders_of(40.0, 0.0)
    lights = window.lights_of(probe, 12.0, 0.38, all_around=True)
    found = np.zeros((SIZE, SIZE, 3), np.float32)
    gratings = prepared_gratings(ORIENTATION, PERIOD)
    window.shade_rows(
        found, (0, SIZE), gratings, view=VIEW, lights=lights, orders=orders, coherence_um=12.0, slopes=slopes
    )
    assert found == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("kind", ["delta", "window"])
def test_turning_probe_and_sheet_alike_turns_the_picture(kind: str) -> None:
    """A sheet on a table, seen from straight above, under a probe that is turned by a quarter."""
    rgb = drawn(SCENES["outdoors"](20.0), 24)
    view = rectified(SIZE, SIZE, 30.0, np.array([0.0, 0.0, 400.0]))
    orders = orders_of(40.0)

    def picture(rotation: float, angle: np.ndarray, period: np.ndarray) -> np.ndarray:
        probe, out = Probe(rgb, pose(rotation, np.pi / 2)), np.zeros((SIZE, SIZE, 3), np.float32)
        gratings = prepared_gratings(angle, period)
        if kind == "delta":
            delta.shade_rows(out, (0, SIZE), gratings, view=view, probe=probe, orders=orders)
        else:
            lights = window.lights_of(probe, 6.0, 0.38)
            window.shade_rows(out, (0, SIZE), gratings, view=view, lights=lights, orders=orders, coherence_um=6.0)
        return out

    still = picture(0.0, ORIENTATION, PERIOD)
    turned = picture(np.pi / 2, np.rot90(ORIENTATION) + np.pi / 2, np.rot90(PERIOD))
    np.testing.assert_allclose(turned, np.rot90(still), rtol=1e-3)


def test_too_wide_a_window_is_refused_by_brute_force() -> None:
    with pytest.raises(ValueError, match=r"a window of 60000 um takes .* lights"):
        window.lights_of(Probe(smooth(24), UPRIGHT), 60_000.0, 0.38)


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
