"""Files a person opens: EXR with named channels, PNG for the eye, CSV of the figures."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from pipeline.data import GratingSample, OrientationError, OrientationMap, PeriodMap, PictureSeries
from pipeline.errors import PipelineError
from pipeline.files import write_bytes, write_text
from pipeline.optics.colour import encode_srgb
from pipeline.report.naming import labelled
from pipeline.report.shades import orientation_colours
from pipeline.runs import Run

Writer = Callable[[Path, Any], list[Path]]


def write_values(run: Run) -> list[Path]:
    """Write every value that has a form for people into ``outputs/``; returns the files."""
    folder = run.path / "outputs"
    written = []
    for node in run.nodes.values():
        writer = WRITERS.get(node.type)
        if writer is not None and node.artifact:
            written += writer(folder / node.name, run.value(node.name))
    table = io.StringIO()
    rows = csv.writer(table, lineterminator="\n")
    rows.writerow(["name", "value", "unit"])
    rows.writerows((name, repr(value), labelled(name, value).unit) for name, value in run.metrics.items())
    write_text(folder / "metrics.csv", table.getvalue())
    return [*written, folder / "metrics.csv"]


def write_exr(path: Path, channels: Mapping[str, NDArray[Any]], attributes: Mapping[str, float | None]) -> Path:
    """Write float channels of one shape (M, N) under their names, and numbers as attributes.

    Raises
    ------
    PipelineError
        The file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    stack = np.stack([np.asarray(c, dtype=np.float32) for c in channels.values()], axis=-1)
    spec = oiio.ImageSpec(stack.shape[1], stack.shape[0], stack.shape[2], "float")
    spec.channelnames = tuple(channels)
    spec.attribute("compression", "zip")
    for name, number in attributes.items():
        if number is not None:
            spec.attribute(name, float(number))
    temporary = path.with_name(f".{path.stem}.partial.exr")
    out = oiio.ImageOutput.create(str(temporary))
    if out is None or not out.open(str(temporary), spec) or not out.write_image(stack) or not out.close():
        raise PipelineError(f"{path} cannot be written: {oiio.geterror() if out is None else out.geterror()}")
    temporary.replace(path)
    return path


def write_png(path: Path, rgb: NDArray[np.floating]) -> Path:
    """Write a picture whose values are encoded for a display, in [0, 1]."""
    done, data = cv2.imencode(".png", np.rint(rgb[..., ::-1] * 255).astype(np.uint8))
    if not done:
        raise PipelineError(f"{path} cannot be encoded")
    write_bytes(path, data.tobytes())
    return path


def _orientation(stem: Path, value: OrientationMap) -> list[Path]:
    channels = {
        "orientation_rad": value.orientation_rad,
        "correlation": value.correlation,
        "intensity": value.intensity,
        "mask": value.mask,
    }
    exr = write_exr(stem.with_suffix(".exr"), channels, {"pixel_mm": value.pixel_mm})
    return [exr, write_png(stem.with_suffix(".png"), orientation_colours(value.orientation_rad))]


def _period(stem: Path, value: PeriodMap) -> list[Path]:
    channels = {"period_um": value.period_um, "mask": value.mask}
    return [write_exr(stem.with_suffix(".exr"), channels, {"pixel_mm": value.pixel_mm})]


def _sample(stem: Path, value: GratingSample) -> list[Path]:
    channels = {"orientation_rad": value.orientation_rad, "period_um": value.period_um}
    return [write_exr(stem.with_suffix(".exr"), channels, {"pixel_mm": value.pixel_mm})]


def _error(stem: Path, value: OrientationError) -> list[Path]:
    return [write_exr(stem.with_suffix(".exr"), {"error_rad": value.error_rad}, {"offset_rad": value.offset_rad})]


def _pictures(stem: Path, value: PictureSeries) -> list[Path]:
    written = []
    for index, rgb in enumerate(value.rgb):
        path = stem.with_name(f"{stem.name}_{index}")
        channels = {name: rgb[..., i] for i, name in enumerate("RGB")}
        written += [
            write_exr(path.with_suffix(".exr"), channels, {"pixel_mm": value.pixel_mm}),
            write_png(path.with_suffix(".png"), encode_srgb(rgb)),
        ]
    return written


WRITERS: dict[str, Writer] = {
    OrientationMap.__name__: _orientation,
    PeriodMap.__name__: _period,
    GratingSample.__name__: _sample,
    OrientationError.__name__: _error,
    PictureSeries.__name__: _pictures,
}
