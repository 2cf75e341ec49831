"""Pictures as the bytes of a file, and as text inside the page."""

from __future__ import annotations

import base64

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.errors import PipelineError

WEBP = [cv2.IMWRITE_WEBP_QUALITY, 90]


def png(colours: NDArray[np.floating]) -> bytes:
    """A PNG of grey (M, N), RGB or RGBA values, encoded for a display, in [0, 1]."""
    return _encoded(".png", colours, [])


def png_uri(colours: NDArray[np.floating]) -> str:
    """Exact, for maps."""
    return "data:image/png;base64," + base64.b64encode(png(colours)).decode()


def webp_uri(colours: NDArray[np.floating]) -> str:
    """Small, for photographs."""
    data = _encoded(".webp", colours, WEBP)
    return "data:image/webp;base64," + base64.b64encode(data).decode()


def _encoded(extension: str, colours: NDArray[np.floating], options: list[int]) -> bytes:
    known = np.nan_to_num(colours) if np.isnan(colours).any() else colours
    levels = np.rint(np.clip(known, 0, 1) * 255).astype(np.uint8)
    if levels.ndim == 3:
        levels = levels[..., [2, 1, 0, 3][: levels.shape[2]]]
    done, data = cv2.imencode(extension, np.ascontiguousarray(levels), options)
    if not done:
        raise PipelineError(f"a picture of shape {colours.shape} cannot be encoded as {extension}")
    return bytes(data)
