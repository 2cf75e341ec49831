"""Rendered pictures."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.data.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class PictureSeries:
    """Colour pictures of one sample under a point light at several places.

    Attributes
    ----------
    rgb : ndarray of shape (L, M, N, 3), float32
        Linear, sRGB primaries, white (1, 1, 1); of shape (1, M, N, 3) where all lights shine together.
    light_mm : ndarray of shape (L, 3), float64
        Position of the light: x right, y up, z towards the camera, origin at the centre of the sample.
    camera_mm : ndarray of shape (3,), float64
        Position of the camera in the same frame.
    pixel_mm : float or None
        Pixel pitch on the sample.
    caption : str
        What the pictures show.
    together : bool
        True where all lights are on in one picture.
    """

    rgb: FloatArray
    light_mm: FloatArray
    camera_mm: FloatArray
    pixel_mm: float | None = None
    caption: str = ""
    together: bool = False


@dataclass(frozen=True, eq=False)
class Pictures:
    """Pictures of one scene, each with what it shows.

    Attributes
    ----------
    rgb : ndarray of shape (K, M, N, 3), float32
        Linear sRGB, relative to a white matt surface that faces the light; 0 where there is nothing.
    labels : tuple of str
        What each shows.
    caption : str
        Of what.
    """

    rgb: FloatArray
    labels: tuple[str, ...]
    caption: str = ""
