"""A sheet's reference against the BRDF, and its fast renderer against the reference, on flat and on bumpy sheets."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import Phase, given, reject, settings
from hypothesis import strategies as st

from pipeline.optics.colour import white_balanced_weights
from pipeline.optics.diffraction.directions import Directions
from pipeline.optics.grating_brdf import grating_brdf
from pipeline.optics.rasterise import Camera
from pipeline.optics.sheet import spectral, tabulated
from pipeline.optics.sheet.colour_table import colour_table
from pipeline.optics.sheet.extent import extent
from pipeline.optics.sheet.maps import prepared_gratings
from pipeline.optics.sheet.view import View, photographed, rectified

SIZE = 48
LIGHT = np.array([60.0, 40.0, 250.0])
EYE = np.array([-90.0, 30.0, 350.0])


def random_maps(seed: int, shape: tuple[int, int] = (SIZE, SIZE)) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(0, np.pi, shape).astype(np.float32), rng.uniform(0.8, 2.2, shape).astype(np.float32)


def towards_the_mirror(view: View, light: np.ndarray, slope: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Orientations that are lit, as random ones rarely are."""
    column, row = np.meshgrid(np.arange(view.columns, dtype=float), np.arange(view.rows, dtype=float))
    place = np.concatenate([view.points(column, row), np.zeros((*column.shape, 1))], axis=-1)
    half = sum((p - place) / np.linalg.norm(p - place, axis=-1, keepdims=True) for p in (light, view.eye_mm))
    normal = np.array([-slope[0], -slope[1], 1.0]) / np.sqrt(1 + slope[0] ** 2 + slope[1] ** 2)
    half = half - (half @ normal)[..., None] * normal
    return (np.arctan2(half[..., 1], half[..., 0]) % np.pi).astype(np.float32)


def summed(
    view: View, orientation: np.ndarray, period: np.ndarray, *, light=LIGHT, sigma=10.0, step=2.0, index=None, **optics
) -> np.ndarray:
    slopes, part = optics.pop("slopes", None), optics.pop("part", 0.0)
    settings = {"coherence_um": 65.0, "depth_um": 0.15, "orders": "exact", **optics}
    table = spectral.spectral_table(
        light="D65",
        wavelength_step_nm=step,
        longest_period_um=float(np.nanmax(period)),
        largest_half_vector=extent(view, light, sigma, slopes).across,
        normal_reflectance=1.0 if index is None else ((index - 1) / (index + 1)) ** 2,
        **settings,
    )
    rgb = np.zeros((view.rows, view.columns, 3), np.float32)
    spectral.shade_rows(
        rgb,
        (0, view.rows),
        orientation,
        period,
        view=view,
        light_mm=light,
        light_sigma_mm=sigma,
        table=table,
        slopes=slopes,
        pixel_part=part,
    )
    return rgb


def looked_up(
    view: View, orientation: np.ndarray, period: np.ndarray, *, light=LIGHT, sigma=10.0, index=None, **optics
) -> np.ndarray:
    slopes, part = optics.pop("slopes", None), optics.pop("part", 0.0)
    settings = {"coherence_um": 65.0, "depth_um": 0.15, "orders": "exact", "tolerance": 0.01, **optics}
    table = colour_table(
        extent(view, light, sigma, slopes, part),
        light="D65",
        periods_um=(float(np.nanmin(period)), float(np.nanmax(period))),
        normal_reflectance=1.0 if index is None else ((index - 1) / (index + 1)) ** 2,
        **settings,
    )
    rgb = np.zeros((view.rows, view.columns, 3), np.float32)
    tabulated.shade_rows(
        rgb,
        (0, view.rows),
        prepared_gratings(orientation, period).astype(table.orders.dtype),
        view=view,
        light_mm=light,
        light_sigma_mm=sigma,
        table=table,
        slopes=slopes,
        pixel_part=part,
    )
    return rgb


def brdf_sum(view: View, orientation: np.ndarray, period: np.ndarray, slope: tuple[float, float], index) -> np.ndarray:
    """The BRDF in the frame of a tilted plane, times cosine and inverse square, over wavelengths, up to a factor."""
    column, row = np.meshgrid(np.arange(view.columns, dtype=float), np.arange(view.rows, dtype=float))
    place = np.concatenate([view.points(column, row), np.zeros((*column.shape, 1))], axis=-1)
    normal = np.array([-slope[0], -slope[1], 1.0]) / np.sqrt(1 + slope[0] ** 2 + slope[1] ** 2)
    flat = np.stack([np.cos(orientation), np.sin(orientation)], axis=-1).astype(float)
    tangent = np.concatenate([flat, (flat @ slope)[..., None]], axis=-1)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    across = np.cross(normal, tangent)

    def turned(point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        away = point - place
        length = np.linalg.norm(away, axis=-1)
        unit = away / length[..., None]
        parts = [(unit * axis).sum(axis=-1) for axis in (tangent, across, normal)]
        return np.stack(parts, axis=-1), length

    (light, distance), (view_direction, _) = turned(LIGHT), turned(view.eye_mm)
    nm, weights = white_balanced_weights("D65", 2.0)
    brdf = np.stack(
        [
            grating_brdf(
                Directions(light, view_direction),
                orientation_rad=0.0,
                period_um=period.astype(float),
                depth_um=0.15,
                wavelength_um=wavelength,
                refractive_index=index,
            )
            for wavelength in nm / 1000
        ],
        axis=-1,
    )
    return (light[..., 2] / distance**2)[..., None] * (brdf @ weights)


@pytest.mark.parametrize(("slope", "index"), [((0.0, 0.0), None), ((0.0, 0.0), 1.5), ((0.12, -0.2), 1.5)])
def test_the_reference_is_the_brdf_under_a_point_light(slope: tuple[float, float], index: float | None) -> None:
    view = rectified(12, 16, 6.0, EYE)
    orientation, period = random_maps(1, (12, 16))
    orientation[:, ::2] = towards_the_mirror(view, LIGHT, slope)[:, ::2] + 0.003
    slopes = np.broadcast_to(np.float32(slope)[:, None, None], (2, 12, 16)).copy() if any(slope) else None
    found = summed(view, orientation, period, sigma=0.0, slopes=slopes, index=index)
    expected = brdf_sum(view, orientation, period, slope, index)
    lit = expected.max(axis=-1) > 0.01 * expected.max()
    scale = np.median(found[lit] / expected[lit])
    normal = 1.0 if index is None else ((index - 1) / (index + 1)) ** 2
    sigma_s = 65 / 4
    assert scale == pytest.approx(0.55**2 * 500**2 / (4 * np.pi * sigma_s**2) / normal, rel=1e-3)
    assert lit.sum() > 10
    np.testing.assert_allclose(found / scale, expected, atol=2e-3 * expected.max())


@pytest.mark.parametrize("elevation_deg", [60, 35])
def test_a_wide_light_is_the_mean_of_its_points(elevation_deg: float) -> None:
    """Foreshortened, as a slanting light's extent is; lobes are wide, so that few points will do."""
    elevation, sigma = np.deg2rad(elevation_deg), 12.0
    to_light = np.array([np.cos(elevation) * np.cos(0.7), np.cos(elevation) * np.sin(0.7), np.sin(elevation)])
    across = np.array([-np.sin(0.7), np.cos(0.7), 0.0])
    view = rectified(7, 9, 0.1, np.array([0.0, 0.0, 500.0]))
    turned, sent_um = np.meshgrid(np.linspace(-0.08, 0.08, 9), np.linspace(0.4, 0.7, 7))
    maps = [part.astype(np.float32) for part in (0.7 + turned, sent_um / np.cos(elevation))]
    optics = {"coherence_um": 20.0, "step": 10.0}
    places = np.linspace(-3.5, 3.5, 15)
    shares = np.exp(-(places**2) / 2) / np.exp(-(places**2) / 2).sum()
    mean = sum(
        one
        * other
        * summed(
            view,
            *maps,
            sigma=0.0,
            light=400 * to_light + sigma * (a * across + b * np.cross(to_light, across)),
            **optics,
        )
        for a, one in zip(places, shares, strict=True)
        for b, other in zip(places, shares, strict=True)
    )
    found = summed(view, *maps, sigma=sigma, light=400 * to_light, **optics)
    assert np.abs(found - mean).max() <= 0.03 * mean.max()


def eye_of(view: str, eye: np.ndarray) -> View:
    if view == "rectified":
        return rectified(SIZE, SIZE, 3.0, eye)
    return photographed(Camera(eye, np.zeros(3), np.array([0.0, 1.0, 0.0]), 0.35), SIZE, SIZE)


@settings(max_examples=12, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(
    seed=st.integers(0, 1000),
    light=st.tuples(st.floats(-150, 150), st.floats(-150, 150), st.floats(150, 500)),
    eye=st.tuples(st.floats(-250, 250), st.floats(-250, 250), st.floats(250, 600)),
    sigma=st.sampled_from([3.0, 10.0, 20.0]),
    depth=st.floats(0.0, 0.4),
    view=st.sampled_from(["rectified", "camera"]),
    bumpy=st.booleans(),
    part=st.sampled_from([0.0, 1.0]),
    index=st.sampled_from([None, 1.5]),
    orders=st.sampled_from(["exact", "second order"]),
)
def test_what_is_looked_up_is_the_sum(seed, light, eye, sigma, depth, view, bumpy, part, index, orders) -> None:
    orientation, period = random_maps(seed)
    shown = eye_of(view, np.array(eye))
    orientation[::2] = towards_the_mirror(shown, np.array(light))[::2]
    optics = {"light": np.array(light), "sigma": sigma, "depth_um": depth, "part": part, "index": index}
    if bumpy:
        rng = np.random.default_rng(seed)
        optics["slopes"] = rng.uniform(-0.03, 0.03, (2, SIZE, SIZE)).astype(np.float32)
    exact = summed(shown, orientation, period, orders=orders, step=1.0, **optics)
    try:
        found = looked_up(shown, orientation, period, orders=orders, **optics)
    except ValueError:  # the table would be too large; then the stage sums the spectrum
        reject()
    # A picture may show a lobe's tail alone: errors are relative to the brightest of a sheet that shows its middle.
    flat = {name: value for name, value in optics.items() if name not in ("slopes", "part")}
    wide = rectified(SIZE, SIZE, 9.0, np.array(eye))
    towards = towards_the_mirror(wide, np.array(light))
    brightest = max(exact.max(), summed(wide, towards, np.full_like(towards, 1.5), orders=orders, **flat).max())
    assert np.abs(found - exact).max() <= 0.01 * brightest


def test_single_precision_is_the_double_to_its_rounding() -> None:
    view = rectified(SIZE, SIZE, 6.0, EYE)
    maps = towards_the_mirror(view, LIGHT), random_maps(3)[1]
    single, double = (looked_up(view, *maps, precision=precision) for precision in ("single", "double"))
    apart = np.abs(single - double).max() / double.max()
    assert 1e-8 < apart < 2e-5


def test_a_finer_tolerance_comes_nearer() -> None:
    view = rectified(SIZE, SIZE, 3.0, EYE)
    orientation, period = random_maps(7)
    exact = summed(view, orientation, period, step=1.0)
    rough, fine = (
        np.abs(looked_up(view, orientation, period, tolerance=tolerance) - exact).max() / exact.max()
        for tolerance in (0.1, 0.002)
    )
    assert fine < 0.002 < rough < 0.1


@pytest.mark.parametrize("renderer", [summed, looked_up])
def test_lobes_averaged_over_a_pixel_are_the_mean_of_its_points(renderer) -> None:
    """A grating of one period and pixels of 4 mm, under a light without extent: lobes are narrower than a pixel."""
    size, fine = 24, 16
    coarse_view = rectified(size, size, 4.0, EYE)
    towards = np.arctan2(LIGHT[1] / LIGHT[2] + EYE[1] / EYE[2], LIGHT[0] / LIGHT[2] + EYE[0] / EYE[2])
    maps = [np.full((size, size), value, np.float32) for value in (towards % np.pi, 1.4)]
    fine_maps = [np.full((size * fine, size * fine), value[0, 0], np.float32) for value in maps]
    every = renderer(rectified(size * fine, size * fine, 4.0 / fine, EYE), *fine_maps, sigma=0.0)
    mean = every.reshape(size, fine, size, fine, 3).mean(axis=(1, 3))
    points, averaged = (renderer(coarse_view, *maps, sigma=0.0, part=part) for part in (0.0, 1.0))
    errors = [np.sqrt(((picture - mean) ** 2).mean()) / mean.max() for picture in (points, averaged)]
    assert errors[1] < 0.03
    assert errors[1] < 0.3 * errors[0]
    assert averaged.sum() == pytest.approx(mean.sum(), rel=0.02)


@pytest.mark.parametrize("renderer", [summed, looked_up])
def test_a_point_of_the_sheet_is_as_bright_in_every_picture_from_the_same_eye(renderer) -> None:
    shown = eye_of("camera", EYE)
    picture = renderer(shown, *(np.full((SIZE, SIZE), value, np.float32) for value in (0.4, 1.5)))
    for row, column in ((5, 40), (24, 24), (40, 3)):
        x, y = shown.points(np.array(float(column)), np.array(float(row)))
        flat = View(np.array([[3.0, 0, x], [0, -3.0, y], [0, 0, 1]]), EYE, 1, 1)
        point = renderer(flat, *(np.full((1, 1), value, np.float32) for value in (0.4, 1.5)))[0, 0]
        np.testing.assert_allclose(point, picture[row, column], atol=0.006 * picture.max())


@pytest.mark.parametrize("renderer", [summed, looked_up])
def test_surfaces_that_face_away_stay_dark(renderer) -> None:
    view = rectified(4, 4, 1.0, EYE)
    steep = np.zeros((2, 4, 4), np.float32)
    steep[0, :, 0] = 9.0
    maps = [np.full((4, 4), value, np.float32) for value in (0.3, 1.5)]
    picture = renderer(view, *maps, sigma=200.0, slopes=steep)
    assert (picture[:, 0] == 0).all()
    assert (picture[:, 1:].max(axis=-1) > 0).all()
