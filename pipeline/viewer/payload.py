"""A scene as text inside a page: textures deflated, in base64, beside the shader's text and where everything starts."""

from __future__ import annotations

import base64
import json
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.viewer import shader
from pipeline.viewer.scene import Scene
from pipeline.viewer.textures import COLOURS, textures

LEVELS = 2**14 - 1
MOST_STRETCH = 2.0
"""Largest factor to the periods."""
LEAST_DEEPEST_UM = 0.5


def deepest_um(scene: Scene) -> float:
    """Where the slider of the depth ends."""
    return max(LEAST_DEEPEST_UM, 2 * scene.depth_um)


def payload(scene: Scene, *, exposure: float, file: str) -> str:
    """JSON for the page's script, safe within an HTML element.

    Parameters
    ----------
    scene : Scene
        What is shown, and where light and eye are at first.
    exposure : float
        Factor to its radiance at first.
    file : str
        Name of a picture that the reader keeps.
    """
    prepared = textures(scene, levels=LEVELS, deepest_um=deepest_um(scene), stretch=MOST_STRETCH)
    shaders = {"vertex": shader.vertex(shader.WEBGL), "colours": shader.table(shader.WEBGL)}
    for method in shader.METHODS:
        shaders[method] = shader.fragment(shader.WEBGL, method)
    sheet = {
        "file": file,
        "shaders": shaders,
        "constants": prepared.constants,
        "colours": COLOURS,
        "textures": {
            "maps": _texture(prepared.maps, _differences(prepared.maps)),
            "shares": _texture(prepared.shares, prepared.shares),
            "spectrum": _texture(prepared.spectrum, prepared.spectrum),
        },
        "start": {
            "light": scene.light_mm.tolist(),
            "eye": scene.eye_mm.tolist(),
            "size_mm": scene.size_mm,
            "exposure": exposure,
        },
    }
    return json.dumps(sheet).replace("<", "\\u003c")


def _texture(array: NDArray[Any], stored: NDArray[Any]) -> dict[str, Any]:
    packed = zlib.compress(stored.astype(stored.dtype.newbyteorder("<")).tobytes(), 9)
    return {"size": [array.shape[1], array.shape[0]], "data": base64.b64encode(packed).decode()}


def _differences(codes: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Of neighbours, which deflate better; for each map first the high bytes, then the low ones."""
    planes = np.moveaxis(codes, -1, 0).reshape(codes.shape[-1], -1)
    steps = np.diff(planes, axis=1, prepend=np.uint16(0))
    return np.stack([steps >> 8, steps & 255], axis=1).astype(np.uint8)
