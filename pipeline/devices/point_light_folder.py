"""Photographs of a sample under a torch that was carried around it, from a folder with its ``capture.yaml``.

::

    kind: point_light
    camera_mm: [0, 0, 500]          # x right, y up, z towards the camera; origin: the sample at the photo's centre
    pixel_mm: 0.02                  # optional, as is everything below but photos
    photos:
      - {file: torch_1.tif, light_mm: [140, 0, 300]}
      - {file: torch_2.tif, light_mm: [0, 140, 300]}
    dark: [room.tif]                # the torch off, same exposure; their mean is subtracted
    linear: true                    # whether values are proportional to light; see photo_files.read_photo
    saturation: 1.0                 # where the sensor was full, in files of floating-point numbers
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from pipeline.data.photographs import Photo
from pipeline.data.pictures import PictureSeries
from pipeline.devices.capture_yaml import CAPTURE_FILE
from pipeline.devices.photo_files import read_photo
from pipeline.devices.yaml_reader import YamlReader, described, root_of
from pipeline.errors import InputError, InputErrors, nearest

KIND = "point_light"

Place = tuple[float, float, float]

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class LitPhoto:
    """One photograph.

    Attributes
    ----------
    file : Path
        Where it is.
    light_mm : tuple of float
        Where the light stood.
    """

    file: Path
    light_mm: Place


@dataclass(frozen=True)
class PointLightCapture:
    """What was photographed, and with which files; every field as in ``capture.yaml``."""

    source: Path
    photos: tuple[LitPhoto, ...]
    camera_mm: Place
    pixel_mm: float | None = None
    dark: tuple[Path, ...] = ()
    linear: bool | None = None
    saturation: float | None = None


def read_point_light_yaml(path: Path) -> PointLightCapture:
    """Read and check a ``capture.yaml``; whether its files exist is not looked at.

    Raises
    ------
    InputErrors
        Everything that is wrong with it, each with file and line.
    """
    reader = _Reader(path)
    capture = reader.capture(root_of(path))
    if capture is None or reader.problems:
        raise InputErrors(reader.problems)
    return capture


def read_point_light_folder(folder: Path) -> PictureSeries:
    """Photographs of a folder as linear pictures, brought to one exposure where the files state theirs.

    Grey photographs get three equal channels; colours are the camera's own, taken for linear sRGB.

    Raises
    ------
    InputErrors
        What is wrong with ``capture.yaml`` or a file: missing, unreadable, of another size, or with pixels that are no
        numbers.
    """
    capture = read_point_light_yaml(_described_in(folder))
    problems: list[InputError] = []
    photos = list(_readable([p.file for p in capture.photos], capture, problems))
    dark = list(_readable(capture.dark, capture, problems))
    if not problems:
        problems += _different(capture, photos, dark)
    if problems:
        raise InputErrors(problems)
    rgb = np.stack([_coloured(photo) for photo in photos])
    if dark:
        rgb -= np.mean([_coloured(photo) for photo in dark], axis=0, dtype=np.float32)
    _bring_to_one_exposure(rgb, photos)
    return PictureSeries(
        rgb=rgb,
        light_mm=np.array([p.light_mm for p in capture.photos]),
        camera_mm=np.array(capture.camera_mm),
        pixel_mm=capture.pixel_mm,
        caption="Photographed: the sample under a torch",
    )


def _described_in(folder: Path) -> Path:
    path = folder / CAPTURE_FILE
    if not path.is_file():
        siblings = (p.name for p in folder.parent.iterdir() if p.is_dir()) if folder.parent.is_dir() else ()
        raise InputErrors(
            [
                InputError(
                    f"the folder has no {CAPTURE_FILE}" if folder.is_dir() else "the folder does not exist",
                    where=str(folder),
                    expected=f"photographs and a {CAPTURE_FILE} of kind {KIND}",
                    hint="" if folder.is_dir() else nearest(folder.name, siblings),
                )
            ]
        )
    return path


def _readable(
    files: list[Path] | tuple[Path, ...], capture: PointLightCapture, problems: list[InputError]
) -> Iterator[Photo]:
    for file in files:
        try:
            yield read_photo(file, linear=capture.linear, saturation=capture.saturation)
        except InputError as error:
            problems.append(error.at(str(capture.source)))


def _different(capture: PointLightCapture, photos: list[Photo], dark: list[Photo]) -> Iterator[InputError]:
    files = [*(p.file for p in capture.photos), *capture.dark]
    usual = photos[0].image.shape[:2]
    for file, photo in zip(files, [*photos, *dark], strict=True):
        size = photo.image.shape[:2]
        if size != usual:
            yield InputError(
                f"a photo of {size[1]} x {size[0]} pixels",
                where=str(file),
                expected=f"{usual[1]} x {usual[0]} pixels, as {files[0].name} has",
            )
        if not np.isfinite(photo.image).all():
            yield InputError("pixels are NaN or infinite", where=str(file), expected="finite signal everywhere")


def _coloured(photo: Photo) -> NDArray[np.float32]:
    image = np.asarray(photo.image, np.float32)
    return image if image.ndim == 3 else np.repeat(image[..., np.newaxis], 3, axis=2)


def _bring_to_one_exposure(rgb: NDArray[np.float32], photos: list[Photo]) -> None:
    """Scale to the shortest exposure, so that brightness can be compared from light to light."""
    exposures = [photo.exposure_s for photo in photos if photo.exposure_s is not None]
    if len(exposures) < len(photos) or len(set(exposures)) == 1:
        return
    rgb *= np.array([min(exposures) / exposure for exposure in exposures], np.float32)[:, None, None, None]
    log.info("exposures of %g to %g s were brought to the shortest", min(exposures), max(exposures))


class _Reader(YamlReader):
    def capture(self, root: yaml.Node | None) -> PointLightCapture | None:
        known: dict[str, Callable[[yaml.Node], Any]] = {
            "kind": self.kind,
            "camera_mm": self.position,
            "pixel_mm": self.positive,
            "photos": self.photos,
            "dark": self.files,
            "linear": self.boolean,
            "saturation": self.positive,
        }
        values = self.fields(root, known, required=("kind", "camera_mm", "photos"))
        if values is None:
            return None
        return PointLightCapture(source=self.path, **values)

    def kind(self, node: yaml.Node) -> str | None:
        text = self.text(node)
        if text is not None and text != KIND:
            self.problem(node, f"'{text}' cannot be replayed as photographs under a point light", KIND)
        return text

    def photos(self, node: yaml.Node) -> tuple[LitPhoto, ...]:
        if not isinstance(node, yaml.SequenceNode) or not node.value:
            self.problem(node, f"photos is {described(node)}", "a list of {file: ..., light_mm: [x, y, z]}")
            return ()
        known: dict[str, Callable[[yaml.Node], Any]] = {"file": self.file, "light_mm": self.position}
        entries = [self.mapping(item, known, required=tuple(known), what="a photo") for item in node.value]
        return tuple(LitPhoto(**entry) for entry in entries if entry is not None and set(entry) == set(known))

    def position(self, node: yaml.Node) -> Place | None:
        numbers = node.value if isinstance(node, yaml.SequenceNode) else []
        try:
            x, y, z = (float(str(self.text(number))) for number in numbers)
            if not (math.isfinite(x) and math.isfinite(y) and 0 < z < math.inf):
                raise ValueError
        except ValueError:
            self.problem(node, "this is no place before the sample", "[x, y, z] in mm, z above 0")
            return None
        return (x, y, z)
