"""A snake's body: frames, scales and pigment."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics.diffraction.directions import Directions
from pipeline.optics.diffraction.patch import frequency_sigma
from pipeline.optics.rasterise import Hits
from pipeline.optics.scales import pigment, scales_at
from pipeline.optics.shaded_mesh import Mesh, frames, plate, unit
from pipeline.optics.shaded_points import blended, lit_points, shaded_points
from pipeline.optics.snake_body import AROUND, back_of, snake_body

BODY = snake_body(200, 48)


def facets(mesh: Mesh) -> np.ndarray:
    a, b, c = (mesh.position_mm[mesh.triangles[:, i]] for i in range(3))
    return np.asarray(np.cross(b - a, c - a))


def hits(mesh: Mesh) -> Hits:
    return Hits(mesh.position_mm, 3 * mesh.normal, 0.2 * mesh.tangent + mesh.normal, mesh.uv)


@pytest.mark.parametrize("mesh", [BODY, plate(3.0, 2.0)], ids=["snake", "plate"])
def test_frames_are_orthonormal_and_normals_point_where_triangles_do(mesh: Mesh) -> None:
    np.testing.assert_allclose(np.linalg.norm(mesh.normal, axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(mesh.tangent, axis=1), 1, atol=1e-12)
    np.testing.assert_allclose((mesh.normal * mesh.tangent).sum(axis=1), 0, atol=1e-12)
    facing = unit(facets(mesh))
    cosine = np.einsum("tci,ti->tc", mesh.normal[mesh.triangles], facing)
    assert cosine.min() > 0.5
    assert np.median(cosine) > np.cos(np.pi / 47) - 1e-4  # half the angle between neighbours around the body


def test_the_body_lies_on_its_plane_and_its_normals_point_outside() -> None:
    a, b, c = (BODY.position_mm[BODY.triangles[:, i]] for i in range(3))
    assert np.einsum("ti,ti->t", a, np.cross(b, c)).sum() / 6 > 1e5
    assert BODY.position_mm[:, 2].min() == pytest.approx(0, abs=1e-9)
    middle = BODY.position_mm.reshape(200, 48, 3)[:, :-1].mean(axis=1, keepdims=True)
    outwards = BODY.position_mm.reshape(200, 48, 3) - middle
    assert (outwards * BODY.normal.reshape(200, 48, 3)).sum(axis=-1).min() > 0


def test_the_fields_y_runs_along_the_body_towards_the_head_and_its_x_around() -> None:
    head, tail = back_of(0.5 - 1e-4), back_of(0.5 + 1e-4)
    nearest = np.argmin(np.linalg.norm(BODY.position_mm - back_of(0.5), axis=1))
    tangent, bitangent, normal = frames(BODY.normal[nearest], BODY.tangent[nearest])
    along = unit(head - tail)
    assert bitangent @ along > 0.98
    assert normal[2] > 0.98
    assert abs(tangent @ along) < 0.1
    assert abs(tangent[2]) < 0.1


@given(st.lists(st.floats(-1, 1), min_size=6, max_size=6), st.floats(-4, 4))
def test_frames_are_right_handed_and_turn_anticlockwise(numbers: list[float], turn: float) -> None:
    normal, tangent = np.reshape(numbers, (2, 3))
    if np.linalg.norm(np.cross(normal, tangent)) < 1e-3:
        return
    frame, turned = frames(normal, tangent), frames(normal, tangent, turn)
    for each in (frame, turned):
        np.testing.assert_allclose(each @ each.T, np.eye(3), atol=1e-9)
        np.testing.assert_allclose(np.cross(each[0], each[1]), each[2], atol=1e-9)
    np.testing.assert_allclose(turned[2], unit(normal), atol=1e-12)
    np.testing.assert_allclose(frame @ turned[0], [np.cos(turn), np.sin(turn), 0], atol=1e-9)


def test_scales_cover_the_body_and_lie_like_tiles_of_a_roof() -> None:
    random = np.random.default_rng(3)
    uv = random.uniform(0, AROUND, (20_000, 2))
    found = scales_at(uv, AROUND)
    assert (found.along**2 + found.sideways**2 <= 1).all()
    # Where a scale's tail end shows, that of the row behind begins beneath it.
    later = scales_at(np.add(uv, [0.5, 0.0]), AROUND)
    assert (later.row >= found.row).all()
    assert found.along.max() > 0.99
    assert found.along.min() > -0.5


def test_scales_go_round_the_body() -> None:
    uv = np.random.default_rng(3).uniform(0, AROUND, (1000, 2))
    once, again = scales_at(uv, AROUND), scales_at(np.add(uv, [0, AROUND]), AROUND)
    np.testing.assert_array_equal(once.column, again.column)
    np.testing.assert_allclose(once.sideways, again.sideways, atol=1e-9)
    np.testing.assert_array_equal(once.turn_rad, again.turn_rad)


def test_scales_lean_as_their_slopes_say_and_each_lies_turned() -> None:
    mesh = BODY
    points = shaded_points(hits(mesh), "snake", "grey", 0.0)
    smooth, scales = frames(mesh.normal, mesh.tangent), scales_at(mesh.uv, AROUND)
    tailwards, sideways = scales.slopes
    leaning = np.einsum("hij,hj->hi", smooth, points.frame[:, 2])
    np.testing.assert_allclose(leaning[:, 0] / leaning[:, 2], -sideways, atol=1e-9)
    np.testing.assert_allclose(leaning[:, 1] / leaning[:, 2], tailwards, atol=1e-9)
    turned = np.einsum("hi,hi->h", points.frame[:, 0], smooth[:, 1])
    np.testing.assert_allclose(turned, scales.turn_rad, atol=0.02)
    assert len(np.unique(scales.turn_rad.round(6))) > 100


@pytest.mark.parametrize("texture", ["iridescent", "blotched", "grey"])
def test_pigment_reflects_no_more_than_arrives(texture: str) -> None:
    uv = np.random.default_rng(5).uniform(0, [40, AROUND], (3000, 2))
    albedo = pigment(scales_at(uv, AROUND), uv, AROUND, texture)
    assert albedo.min() >= 0
    assert albedo.max() < 1
    back = np.abs(uv[:, 1] - AROUND / 2) < 2
    belly = (uv[:, 1] < 1) | (uv[:, 1] > AROUND - 1)
    if texture == "grey":
        assert (albedo == 0.18).all()
    else:
        assert albedo[belly].mean() > 1.5 * albedo[back].mean()


def test_points_with_light_or_viewer_below_them_are_left_out() -> None:
    points = shaded_points(hits(BODY), "snake", "grey", 0.0)
    light, eye = unit(np.array([0.3, 0.5, 0.4])), np.array([50.0, -300.0, 200.0])
    lit, albedo, directions = lit_points(points, light, eye)
    assert 0.1 < lit.mean() < 0.5
    assert len(albedo) == len(directions.light) == lit.sum()
    assert directions.light[:, 2].min() > 0
    assert directions.view[:, 2].min() > 0
    away = points.frame[~lit, 2]
    assert ((away @ light <= 0) | ((away * (eye - points.position_mm[~lit])).sum(axis=1) <= 0)).all()
    np.testing.assert_allclose(np.linalg.norm(directions.view, axis=1), 1, atol=1e-9)


def test_frames_do_not_mind_how_the_whole_scene_lies() -> None:
    """Body, light and viewer turned together: the same directions in the frames."""
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) @ frames(np.ones(3), np.array([1.0, 0, 0]))
    light, eye = unit(np.array([0.3, 0.5, 0.4])), np.array([50.0, -300.0, 200.0])
    turned = Hits(*(part @ turn.T for part in (BODY.position_mm, BODY.normal, BODY.tangent)), BODY.uv)
    first = lit_points(shaded_points(hits(BODY), "snake", "grey", 0.0), light, eye)
    second = lit_points(shaded_points(turned, "snake", "grey", 0.0), turn @ light, turn @ eye)
    assert first[0].sum() > 1000
    both = first[0] & second[0]
    assert (first[0] != second[0]).sum() <= 2
    np.testing.assert_allclose(first[2].light[both[first[0]]], second[2].light[both[second[0]]], atol=1e-9)
    np.testing.assert_allclose(first[2].view[both[first[0]]], second[2].view[both[second[0]]], atol=1e-9)


@pytest.mark.parametrize("coherence_um", [20.0, 65.0])
def test_a_mirror_sends_on_what_it_reflects_and_no_more(coherence_um: float) -> None:
    """What goes into all directions, of light from above: 4 percent for n = 1.5."""
    sigma = frequency_sigma(coherence_um) * 0.55
    places, step = np.linspace(-5 * sigma, 5 * sigma, 101, retstep=True)
    u, v = (part.ravel() for part in np.meshgrid(places, places))
    view = np.stack([u, v, np.sqrt(1 - u**2 - v**2)], axis=-1)
    directions = Directions(np.tile([0.0, 0.0, 1.0], (len(u), 1)), view)
    response = np.tile(np.exp(-(u**2 + v**2) / sigma**2)[:, None], 3)
    how = {"coherence_um": coherence_um, "refractive_index": 1.5, "shadowed": False}
    for share in (0.0, 0.6):
        seen = blended(response, np.zeros((len(u), 3)), directions, diffuse_share=share, **how)
        np.testing.assert_allclose(seen.sum(axis=0) / np.pi * step**2, (1 - share) * 0.04, rtol=3e-3)
