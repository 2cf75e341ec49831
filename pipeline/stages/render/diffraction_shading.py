"""A snake's body or a plate whose skin diffracts, seen by a camera at several distances."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Literal

import numpy as np

from pipeline.data.height_fields import HeightField, Periodicity
from pipeline.data.pictures import Pictures
from pipeline.devices.virtual_surface import automatic_step_nm, check_recipe, recipe_of, responses, unreflecting
from pipeline.errors import InputError
from pipeline.limits import above_zero_up_to, at_least, refuse, within
from pipeline.optics.colour import FIRST_NM, LAST_NM, white_balanced_weights
from pipeline.optics.diffraction.directions import Directions, unit_vector
from pipeline.optics.rasterise import Camera, Fragments, interpolated, rasterised_rows
from pipeline.optics.shaded_mesh import Float64Array, Mesh
from pipeline.optics.shaded_points import blended, lit_points, mesh_of, middle_of, packed, shaded_points
from pipeline.parallel import over_rows
from pipeline.progress import advance

_log = logging.getLogger(__name__)

# Sums are float32, and processors add their terms in different orders; a mirror's direction is hundreds of times white.
_tolerance_diffraction_shading = {"rgb": 1e-2}
_ROWS_OF_COLUMNS = 0.625
_ABREAST = 32
# Roberts' sequence R2, which fills a square evenly at any length.
_PLACES = np.array([0.7548776662466927, 0.5698402909980532])


def diffraction_shading(
    surface: HeightField,
    periods: Periodicity | None = None,
    *,
    shape: Literal["snake", "plate"] = "snake",
    texture: Literal["iridescent", "blotched", "grey"] = "iridescent",
    turn_deg: float = 0.0,
    light_deg: float = 30.0,
    light_azimuth_deg: float = 90.0,
    camera_deg: float = 25.0,
    camera_azimuth_deg: float = -90.0,
    distance_mm: list[float] = [900.0, 300.0, 100.0],  # noqa: B006 - read from the syntax tree, never modified
    field_of_view_deg: float = 20.0,
    looking_at: float = 0.5,
    size_px: int = 360,
    samples: int = 2,
    diffuse_share: float = 0.25,
    evaluator: Literal["chebyshev", "flss", "nmm", "pq", "pq_sinc", "gem", "nufft", "direct"] = "chebyshev",
    wavelength_step: float | None = None,
    illuminant: Literal["D65", "A", "inverse A", "E"] = "D65",
    coherence_um: float = 65.0,
    tolerance: float = 1e-3,
    terms: int | None = None,
    refractive_index: float = 1.5,
    shadowed: bool = True,
) -> Pictures:
    """Photograph a curved, scaled body that diffracts, or a plate, from several distances.

    Each pixel has a tangent frame, in which light and viewer have directions; from these the surface's response gives a
    colour as in :func:`render.brdf_map`, and pigment is added to it. The height field's x lies along the frame's
    tangent: to the right on the plate, around the snake's body, so that what is long along y, such as the fingers of
    Xenopeltis, lies along the body, and scatters across it. Each scale leans, and lies turned by its own small angle.

    The source blends ``(1 - w) diffraction + (1 - alpha) texture + w texture`` with ``alpha`` = 1 where F > 1, which
    never happens, so that its texture weighs ``1 + w`` and all of it more than the light that arrives. Here the weights
    are ``1 - w`` and ``w (1 - F)``, and diffraction has the brightness that a mirror's reflectance gives it.

    Light is shadowed where it comes from below the surface; parts of the body cast no shadows on others.

    Parameters
    ----------
    surface : HeightField
        Without gaps.
    periods : Periodicity, optional
        Needed by ``nmm`` and ``gem``.
    shape : {"snake", "plate"}
        A body 0.3 m long that winds over the plane z = 0, its head at -x, or a plate of 200 by 120 mm in it.
    texture : {"iridescent", "blotched", "grey"}
        Pigment: dark brown with a pale belly, as Xenopeltis; orange with red saddles, as Elaphe; or grey.
    turn_deg : float
        By how much the height field lies turned, anticlockwise seen from outside.
    light_deg, light_azimuth_deg : float
        Where the distant light stands: angle from +z, and anticlockwise from +x.
    camera_deg, camera_azimuth_deg : float
        The same of the camera, seen from what it looks at.
    distance_mm : list of float
        From the camera to that, one picture each.
    field_of_view_deg : float
        Across a picture's width.
    looking_at : float
        What is in the middle: 0 for the head, 1 for the tail; 0 for the left edge of the plate, 1 for its right one.
    size_px : int
        Pixels across a picture, which is 5/8 as high.
    samples : int
        Points in each pixel, each on another place of the height field. Light from a mirror and from each order is
        narrower than what a pixel sees of a curved body, so few samples are grainy.
    diffuse_share : float
        Weight ``w`` of pigment against diffraction.
    evaluator, illuminant, coherence_um, tolerance, terms, refractive_index, shadowed
        As in :func:`render.brdf_map`.
    wavelength_step : float, optional
        In nm; by default the widest that shows every order, from the coherence window and the relief.

    Returns
    -------
    Pictures
        Linear sRGB of shape (distances, 5/8 size, size, 3), relative to a white matt surface that faces the light;
        black where there is nothing.

    Raises
    ------
    InputError
        Heights are missing, or the evaluator needs what is not there.

    References
    ----------
    Single, Diffraction Shader (2014), algorithms 2.2 to 2.4.
    """
    recipe = recipe_of(evaluator, coherence_um, tolerance, terms, periods)
    mesh, target = mesh_of(shape), middle_of(shape, looking_at)
    light = unit_vector(np.deg2rad(light_deg), np.deg2rad(light_azimuth_deg))
    towards = unit_vector(np.deg2rad(camera_deg), np.deg2rad(camera_azimuth_deg))
    up = -unit_vector(np.pi / 2, np.deg2rad(camera_azimuth_deg))
    rows = round(size_px * _ROWS_OF_COLUMNS)
    cameras = [Camera(target + away * towards, target, up, np.deg2rad(field_of_view_deg)) for away in distance_mm]
    rgb = np.zeros((len(cameras), rows, size_px, 3))
    step = wavelength_step
    for sample in range(samples):
        place = (0.5 + sample * _PLACES) % 1
        found = []
        for camera in cameras:
            fragments = _photographed(mesh, camera, rows, size_px, place)
            points = shaded_points(interpolated(mesh, fragments), shape, texture, np.deg2rad(turn_deg))
            found.append((fragments.triangle >= 0, *lit_points(points, light, camera.eye_mm)))
        seen, lit, albedo, directions = (list(part) for part in zip(*found, strict=True))
        every = Directions(*(np.concatenate([getattr(d, end) for d in directions]) for end in ("light", "view")))
        if not len(every.light):
            raise InputError("the camera sees no surface that is lit", expected="light and camera on one side of it")
        step = step or automatic_step_nm(surface, every, coherence_um)
        wavelength_nm, weights = white_balanced_weights(illuminant, step)
        moved, together = _moved(surface, place), packed(every, _ABREAST)
        response = responses(moved, recipe, together, wavelength_nm, weights, tell=sample == 0).sums
        colour = blended(
            response.reshape(3, -1).T[: len(every.light)],
            np.concatenate(albedo),
            every,
            diffuse_share=diffuse_share,
            coherence_um=coherence_um,
            refractive_index=refractive_index,
            shadowed=shadowed,
        )
        where = np.stack(seen)
        where[where] = np.concatenate(lit)
        rgb[where] += colour / samples
        advance(sample + 1, samples)
    if wavelength_step is None:
        _log.info("The wavelength step is %.2g nm.", step)
    labels = tuple(_label(away, field_of_view_deg) for away in distance_mm)
    return Pictures(rgb.astype(np.float32), labels, surface.caption)


def _photographed(mesh: Mesh, camera: Camera, rows: int, columns: int, place: Float64Array) -> Fragments:
    fragments = Fragments.empty(rows, columns)
    seen = camera.seen(mesh.position_mm, rows, columns)
    at = (float(place[0]), float(place[1]))
    over_rows(lambda start, stop: rasterised_rows(seen, mesh, fragments, start, stop, at=at), rows)
    return fragments


def _moved(surface: HeightField, place: Float64Array) -> HeightField:
    """The surface from another place: it repeats, so that any will do."""
    rows, columns = surface.height_um.shape
    shift = (round((place[1] - 0.5) * rows), round((place[0] - 0.5) * columns))
    return replace(surface, height_um=np.roll(surface.height_um, shift, axis=(0, 1)))


def _label(away_mm: float, field_of_view_deg: float) -> str:
    return f"{away_mm:g} mm away, {2 * away_mm * np.tan(np.deg2rad(field_of_view_deg) / 2):.3g} mm wide"


def _check_diffraction_shading(
    *,
    light_deg: float,
    camera_deg: float,
    distance_mm: list[float],
    field_of_view_deg: float,
    looking_at: float,
    size_px: int,
    samples: int,
    diffuse_share: float,
    wavelength_step: float | None,
    coherence_um: float,
    tolerance: float,
    terms: int | None,
    refractive_index: float,
    **_: object,
) -> None:
    """Refuse impossible places, sizes and shares before anything runs."""
    refuse(
        within(0, 89, light_deg=light_deg),
        within(0, 89, camera_deg=camera_deg),
        [problem for away in distance_mm for problem in at_least(20, "clear of the body", distance_mm=away)],
        [] if distance_mm else [InputError("distance_mm is empty", where="distance_mm", expected="a distance or more")],
        above_zero_up_to(120, field_of_view_deg=field_of_view_deg),
        within(0, 1, looking_at=looking_at),
        at_least(8, "a picture of fewer pixels shows nothing", size_px=size_px),
        at_least(1, "a pixel sees one point or more", samples=samples),
        within(0, 1, diffuse_share=diffuse_share),
        [] if wavelength_step is None else within(0.1, (LAST_NM - FIRST_NM) / 2, wavelength_step=wavelength_step),
        unreflecting(refractive_index),
    )
    check_recipe(coherence_um=coherence_um, tolerance=tolerance, terms=terms)
