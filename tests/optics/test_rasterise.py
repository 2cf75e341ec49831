"""What a camera sees, against rays that are cut with spheres and planes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from pipeline.optics.rasterise import Camera, Fragments, interpolated, rasterised_rows
from pipeline.optics.shaded_mesh import Mesh, grid_triangles, plate, unit

ROWS, COLUMNS = 40, 56
AT = (0.3, 0.6)


def camera(eye: tuple[float, float, float], target: tuple[float, float, float] = (0, 0, 0)) -> Camera:
    return Camera(np.array(eye, float), np.array(target, float), np.array([0.0, 0.1, 1.0]), np.deg2rad(40))


def rasterised(mesh: Mesh, of: Camera, tile: int = ROWS, at: tuple[float, float] = AT) -> Fragments:
    fragments = Fragments.empty(ROWS, COLUMNS)
    seen = of.seen(mesh.position_mm, ROWS, COLUMNS)
    for start in range(0, ROWS, tile):
        rasterised_rows(seen, mesh, fragments, start, min(start + tile, ROWS), at=at)
    return fragments


def rays(of: Camera, at: tuple[float, float] = AT) -> np.ndarray:
    """Through each pixel, shape (M, N, 3), as long as what they cover along the view is 1."""
    right, up, back = of.axes()
    across = np.tan(of.field_of_view_rad / 2)
    x = (np.arange(COLUMNS) + at[0] - COLUMNS / 2) / (COLUMNS / 2) * across
    y = (ROWS / 2 - np.arange(ROWS) - at[1]) / (COLUMNS / 2) * across
    return x[None, :, None] * right + y[:, None, None] * up - back


def sphere(radius: float = 10.0, count: int = 160) -> Mesh:
    theta, phi = np.meshgrid(np.linspace(0, np.pi, count), np.linspace(0, 2 * np.pi, 2 * count), indexing="ij")
    normal = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1).reshape(-1, 3)
    tangent = np.stack([-np.sin(phi), np.cos(phi), 0 * phi], -1).reshape(-1, 3)
    uv = np.stack([phi, theta], -1).reshape(-1, 2)
    return Mesh(grid_triangles(count, 2 * count)[:, ::-1].copy(), radius * normal, normal, tangent, uv)


def test_a_sphere_is_seen_where_rays_meet_it() -> None:
    of = camera((25.0, 8.0, 12.0), (1.0, -2.0, 0.5))
    found = rasterised(sphere(), of)
    ray = rays(of)
    a, b = (ray**2).sum(-1), ray @ of.eye_mm
    under = b**2 - a * (of.eye_mm @ of.eye_mm - 100)
    inside = under > 0.01 * (b**2).max()
    seen = found.triangle >= 0
    assert inside.sum() > 300
    assert seen[inside].all()
    assert not seen[under < 0].any()
    depth = (-b[inside] - np.sqrt(under[inside])) / a[inside]
    np.testing.assert_allclose(found.depth_mm[inside], depth, atol=0.01)
    hits = interpolated(sphere(), found)
    expected = of.eye_mm + depth[:, None] * ray[inside]
    np.testing.assert_allclose(hits.position_mm[inside[seen]], expected, atol=0.01)
    np.testing.assert_allclose(unit(hits.normal)[inside[seen]], expected / 10, atol=2e-3)


def test_texture_is_right_in_perspective() -> None:
    """A plate seen steeply: an interpolation that is linear in the picture would be off by more than a tenth."""
    of = camera((4.0, -30.0, 6.0), (0.0, 3.0, 0.0))
    mesh = plate(30.0, 40.0)
    found, ray = rasterised(mesh, of), rays(of)
    depth = np.where(ray[..., 2] < 0, -of.eye_mm[2] / np.minimum(ray[..., 2], -1e-9), np.inf)
    met = of.eye_mm + np.where(np.isfinite(depth), depth, 0)[..., None] * ray
    inside = np.isfinite(depth) & (np.abs(met[..., 0]) < 15) & (np.abs(met[..., 1]) < 20)
    np.testing.assert_array_equal(found.triangle >= 0, inside)
    hits = interpolated(mesh, found)
    np.testing.assert_allclose(found.depth_mm[inside], depth[inside], rtol=1e-9)
    np.testing.assert_allclose(hits.uv, met[inside][:, :2] / [30, 40] + 0.5, atol=1e-9)
    assert np.ptp(depth[inside]) > 20


def test_what_is_nearer_hides_what_is_farther() -> None:
    below, above = plate(40.0, 40.0), plate(10.0, 10.0)
    both = Mesh(
        np.concatenate([above.triangles, below.triangles + 4]),
        np.concatenate([np.add(above.position_mm, [0, 0, 5]), below.position_mm]),
        *(np.concatenate([getattr(above, part), getattr(below, part)]) for part in ("normal", "tangent", "uv")),
    )
    of = camera((0.0, 0.0, 50.0))
    near = rasterised(Mesh(above.triangles, np.add(above.position_mm, [0, 0, 5]), *[above.normal] * 2, above.uv), of)
    found = rasterised(both, of)
    assert (near.triangle >= 0).sum() > 100
    np.testing.assert_array_equal((found.triangle >= 0) & (found.triangle < 2), near.triangle >= 0)


def test_no_pixel_falls_between_triangles_that_meet_on_it() -> None:
    """Vertices in the middle of pixels, so that edges run through many."""
    of = camera((0.0, 0.0, 50.0))
    y, x = np.meshgrid(np.linspace(-40, 40, 23), np.linspace(-40, 40, 17), indexing="ij")
    position = np.stack([x, y, 0 * x], -1).reshape(-1, 3)
    mesh = Mesh(grid_triangles(23, 17), position, position, position, position[:, :2])
    seen = of.seen(position, ROWS, COLUMNS)
    seen[:, :2] = np.floor(seen[:, :2]) + 0.5
    found = Fragments.empty(ROWS, COLUMNS)
    rasterised_rows(seen, mesh, found, 0, ROWS)
    assert (found.triangle >= 0).all()


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda e: np.linalg.norm(e) > 0.3))
def test_a_closed_surface_has_no_holes(towards: list[float]) -> None:
    of = camera(tuple(30 * unit(np.array(towards))))
    covered = rasterised(sphere(count=24), of).triangle >= 0
    assert covered.sum() > 200
    np.testing.assert_array_equal(covered, ndimage.binary_fill_holes(covered))


@pytest.mark.parametrize("tile", [1, 7, 39])
def test_tiles_of_rows_make_the_same_picture(tile: int) -> None:
    of = camera((25.0, 8.0, 12.0))
    whole, tiled = rasterised(sphere(count=30), of), rasterised(sphere(count=30), of, tile)
    np.testing.assert_array_equal(whole.triangle, tiled.triangle)
    np.testing.assert_array_equal(whole.weights, tiled.weights)


def test_what_reaches_behind_the_camera_is_left_out() -> None:
    of = camera((0.0, -1.0, 6.0), (0.0, 0.0, 6.0))
    mesh = sphere(count=60)
    found = rasterised(mesh, of)
    assert np.isfinite(found.depth_mm).any()
    assert found.depth_mm.min() > 0
    depth = of.seen(mesh.position_mm, ROWS, COLUMNS)[mesh.triangles, 2]
    assert (depth[found.triangle[found.triangle >= 0]] > 0).all()
