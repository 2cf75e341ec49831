"""Pictures as the bytes of a file, and as text inside the page."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path

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


def animated_webp(frames: Sequence[NDArray[np.floating]], frames_per_second: float) -> bytes:
    """Pictures (M, N, 3), encoded for a display, one after another without end."""
    animation = cv2.Animation()
    animation.frames = [_levels(frame) for frame in frames]
    animation.durations = [round(1000 / frames_per_second)] * len(frames)
    animation.loop_count = 0
    done, data = cv2.imencodeanimation(".webp", animation, WEBP)
    if not done:
        raise PipelineError(f"{len(frames)} pictures of shape {frames[0].shape} cannot be encoded as one .webp")
    return bytes(data)


def animated_webp_uri(frames: Sequence[NDArray[np.floating]], frames_per_second: float) -> str:
    """The same, for the page."""
    return "data:image/webp;base64," + base64.b64encode(animated_webp(frames, frames_per_second)).decode()


def write_mp4(path: Path, frames: Sequence[NDArray[np.floating]], frames_per_second: float) -> None:
    """Write pictures as a film (VP9 in MP4, which browsers play); an odd row or column is left out."""
    rows, columns = (side // 2 * 2 for side in frames[0].shape[:2])
    partial = path.with_name(f".{path.name}")
    writer = cv2.VideoWriter(str(partial), cv2.VideoWriter.fourcc(*"vp09"), frames_per_second, (columns, rows))
    if not writer.isOpened():
        raise PipelineError(f"{path} cannot be written: OpenCV has no encoder for VP9 here")
    for frame in frames:
        writer.write(np.ascontiguousarray(_levels(frame)[:rows, :columns]))
    writer.release()
    partial.replace(path)


def _encoded(extension: str, colours: NDArray[np.floating], options: list[int]) -> bytes:
    done, data = cv2.imencode(extension, _levels(colours), options)
    if not done:
        raise PipelineError(f"a picture of shape {colours.shape} cannot be encoded as {extension}")
    return bytes(data)


def _levels(colours: NDArray[np.floating]) -> NDArray[np.uint8]:
    """In OpenCV's order of channels."""
    known = np.nan_to_num(colours) if np.isnan(colours).any() else colours
    levels = np.rint(np.clip(known, 0, 1) * 255).astype(np.uint8)
    if levels.ndim == 3:
        levels = levels[..., [2, 1, 0, 3][: levels.shape[2]]]
    return np.ascontiguousarray(levels)
