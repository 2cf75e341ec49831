"""Points of a surface as light and viewer meet them: directions in tangent frames, and diffraction beside pigment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.diffraction.directions import Directions, relative_gain, schlick
from pipeline.optics.diffraction.patch import frequency_sigma
from pipeline.optics.rasterise import Hits
from pipeline.optics.scales import Texture, pigment, scales_at
from pipeline.optics.shaded_mesh import Float64Array, Mesh, across, frames, plate, unit
from pipeline.optics.snake_body import AROUND, back_of, snake_body

BoolArray = NDArray[np.bool_]
Shape = Literal["snake", "plate"]

_PLATE_MM = (200.0, 120.0)
_GREEN_UM = 0.55


@dataclass(frozen=True)
class ShadedPoints:
    """Points of a surface.

    Attributes
    ----------
    position_mm : ndarray of shape (H, 3)
        Where they are.
    frame : ndarray of shape (H, 3, 3)
        Rows tangent, bitangent and normal, along x, y and z of the height field.
    albedo : ndarray of shape (H, 3)
        Of the pigment, linear sRGB.
    """

    position_mm: Float64Array
    frame: Float64Array
    albedo: Float64Array


def mesh_of(shape: Shape) -> Mesh:
    """A snake's body, or a plate of 200 by 120 mm."""
    return snake_body() if shape == "snake" else plate(*_PLATE_MM)


def middle_of(shape: Shape, share: float) -> Float64Array:
    """What a camera looks at: on the back, a share of the length from the head, or on the plate from the left."""
    return back_of(share) if shape == "snake" else np.array([(share - 0.5) * _PLATE_MM[0], 0.0, 0.0])


def shaded_points(hits: Hits, shape: Shape, texture: Texture, turn_rad: float) -> ShadedPoints:
    """Give every point its frame, on a snake that of its scale, and its pigment.

    Parameters
    ----------
    hits : Hits
        What a camera sees.
    shape : {"snake", "plate"}
        A plate has neither scales nor a pattern: it has the albedo of the snake's back.
    texture : {"iridescent", "blotched", "grey"}
        Pigment.
    turn_rad : float
        By how much the height field lies turned on the surface, anticlockwise from outside.
    """
    if shape == "plate":
        middle = scales_at(np.array([[0.0, AROUND / 2]]), AROUND)
        albedo = pigment(middle, np.zeros((1, 2)), AROUND, texture)
        frame = frames(hits.normal, hits.tangent, turn_rad)
        return ShadedPoints(hits.position_mm, frame, np.broadcast_to(albedo, hits.position_mm.shape))
    smooth = frames(hits.normal, hits.tangent)
    scales = scales_at(hits.uv, AROUND)
    tailwards, sideways = scales.slopes
    # The bitangent points towards the head.
    leaning = unit(np.stack([-sideways, tailwards, np.ones_like(sideways)], axis=-1))
    normal = np.einsum("hi,hij->hj", leaning, smooth)
    frame = frames(normal, across(smooth[:, 0], normal), turn_rad + scales.turn_rad)
    return ShadedPoints(hits.position_mm, frame, pigment(scales, hits.uv, AROUND, texture))


def lit_points(
    points: ShadedPoints, light: Float64Array, eye_mm: Float64Array
) -> tuple[BoolArray, Float64Array, Directions]:
    """The L of H points that have both light and viewer above their surface.

    Parameters
    ----------
    points : ShadedPoints
        Points.
    light : ndarray of shape (3,)
        Unit vector towards the light.
    eye_mm : ndarray of shape (3,)
        Where the viewer is.

    Returns
    -------
    lit : ndarray of shape (H,), bool
        Which they are.
    albedo : ndarray of shape (L, 3)
        Of these.
    directions : Directions
        Light and viewer in their frames, shape (L, 3).
    """
    to_light = points.frame @ light
    to_eye = np.einsum("hij,hj->hi", points.frame, unit(eye_mm - points.position_mm))
    lit = (to_light[:, 2] > 0) & (to_eye[:, 2] > 0)
    return lit, points.albedo[lit], Directions(to_light[lit], to_eye[lit])


def packed(directions: Directions, columns: int) -> Directions:
    """A list of directions, shape (L, 3), as rows of ``columns``, the last one filled up with the last direction."""
    return Directions(*(_filled(part, columns) for part in (directions.light, directions.view)))


def blended(
    response: NDArray[np.floating],
    albedo: Float64Array,
    directions: Directions,
    *,
    diffuse_share: float,
    coherence_um: float,
    refractive_index: float,
    shadowed: bool,
) -> Float64Array:
    """Light from each point relative to that from a white matt surface that faces the light.

    ``(1 - s) R_0 / (sigma_f lambda)^2 C |P|^2 + s (1 - F(i)) albedo cos i``: a mirror spreads the share ``R_0`` of the
    light that it reflects over a solid angle ``pi (sigma_f lambda)^2``, at 550 nm, and the gain ``C`` holds the light's
    cosine already; pigment is lit by what the surface lets through. The weights add up to no more than what arrives.

    Parameters
    ----------
    response : ndarray of shape (L, 3)
        ``|P|^2``, summed over wavelengths to a colour; 1 for a mirror in its direction.
    albedo : ndarray of shape (L, 3)
        Of the pigment.
    directions : Directions
        Of shape (L, 3).
    diffuse_share : float
        The weight ``s`` of the pigment.
    coherence_um : float
        Width 4 sigma_s of the coherence window, with ``sigma_f = 1 / (2 pi sigma_s)``.
    refractive_index : float
        Of the surface.
    shadowed : bool
        Whether V-shaped grooves shadow grazing directions.
    """
    normal_reflectance = ((refractive_index - 1) / (refractive_index + 1)) ** 2
    mirror = normal_reflectance / (frequency_sigma(coherence_um) * _GREEN_UM) ** 2
    gain = relative_gain(directions, refractive_index=refractive_index, shadowed=shadowed)
    upright = Directions(directions.light, directions.light * [-1.0, -1.0, 1.0])
    entering = 1 - schlick(upright, refractive_index)
    surface = (1 - diffuse_share) * mirror * gain[:, None] * response
    body = diffuse_share * entering[:, None] * albedo
    return np.asarray(surface + directions.light[:, 2:] * body)


def _filled(vectors: Float64Array, columns: int) -> Float64Array:
    wanting = -len(vectors) % columns
    return np.pad(vectors, ((0, wanting), (0, 0)), "edge").reshape(-1, columns, 3)
