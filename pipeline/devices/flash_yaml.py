"""What a folder of photographs under a flash says about itself: its ``capture.yaml``.

::

    kind: flash
    camera_mm: [0, 0, 500]          # x right, y up, z towards the camera; origin: the middle of the sheet
    sheet_mm: [297, 210]            # width and height
    corners_px: [[78, 60], ...]     # [column, row] of the sheet's four corners
    lights_mm: [[100, 0, 250], [0, 120, 250]]
    photos:                         # each place of the flash has the same bracket of exposures
      - {file: right_1.jpg, light: 1, exposure_s: 0.004}
      - {file: right_2.jpg, light: 1, exposure_s: 0.016}
      - {file: above_1.jpg, light: 2, exposure_s: 0.004}
      - {file: above_2.jpg, light: 2, exposure_s: 0.016}
    room: room.jpg                  # under the lamps of the room
    linear: false                   # whether values are proportional to light; false of 8 bits unless it says otherwise
    wavelength_nm: 530              # of a filter before the camera, as is bandwidth_nm
    bandwidth_nm: 10
    light_sigma_mm: 4               # of the flash's extent
    metadata: {model: ...}

All but ``kind``, ``photos`` and each photo's ``file`` and ``light`` is optional. Exposures that are left out are those
that the files state.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from pipeline.devices.yaml_reader import YamlReader, described, root_of
from pipeline.errors import InputErrors

KIND = "flash"

Numbers = tuple[float, ...]


@dataclass(frozen=True)
class FlashPhoto:
    """One file: which place the flash was in, counted from 1, and the exposure where it is stated."""

    file: Path
    light: int
    exposure_s: float | None = None


@dataclass(frozen=True)
class FlashCapture:
    """What was photographed, and with which files; every field as in ``capture.yaml``."""

    source: Path
    photos: tuple[FlashPhoto, ...]
    camera_mm: Numbers | None = None
    lights_mm: tuple[Numbers, ...] | None = None
    sheet_mm: Numbers | None = None
    corners_px: tuple[Numbers, ...] | None = None
    room: Path | None = None
    linear: bool | None = None
    wavelength_nm: float | None = None
    bandwidth_nm: float | None = None
    light_sigma_mm: float | None = None
    metadata: Mapping[str, str] = field(default_factory=dict)


def read_flash_yaml(path: Path) -> FlashCapture:
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


class _Reader(YamlReader):
    def capture(self, root: yaml.Node | None) -> FlashCapture | None:
        known: dict[str, Callable[[yaml.Node], Any]] = {
            "kind": self.kind,
            "photos": self.photos,
            "camera_mm": lambda node: self.above(node, self.numbers(node, 3, "[x, y, z] in mm", "camera_mm")),
            "lights_mm": self.lights,
            "sheet_mm": lambda node: self.numbers(node, 2, "[width, height] in mm, above 0", "sheet_mm", least=0.0),
            "corners_px": lambda node: self.places(node, 2, "four [column, row] in pixels", "corners_px", count=4),
            "room": self.file,
            "linear": self.boolean,
            "wavelength_nm": self.positive,
            "bandwidth_nm": self.positive,
            "light_sigma_mm": self.positive,
            "metadata": self.texts,
        }
        values = self.fields(root, known, required=("kind", "photos"))
        if root is None or values is None:
            return None
        capture = FlashCapture(source=self.path, **values)
        lights = sorted({photo.light for photo in capture.photos})
        count = len(lights) if capture.lights_mm is None else len(capture.lights_mm)
        if lights != list(range(1, count + 1)):
            places = "" if capture.lights_mm is None else f", as lights_mm has {count}"
            self.problem(root, f"the photos have the lights {lights}", f"every number from 1 to {count}{places}")
        return capture

    def kind(self, node: yaml.Node) -> str | None:
        text = self.text(node)
        if text is not None and text != KIND:
            self.problem(node, f"'{text}' cannot be replayed as photographs under a flash", KIND)
        return text

    def photos(self, node: yaml.Node) -> tuple[FlashPhoto, ...]:
        if not isinstance(node, yaml.SequenceNode) or not node.value:
            self.problem(node, f"photos is {described(node)}", "a list of {file: ..., light: 1, exposure_s: ...}")
            return ()
        known: dict[str, Callable[[yaml.Node], Any]] = {
            "file": self.file,
            "light": self.number_of_light,
            "exposure_s": self.positive,
        }
        entries = [self.mapping(item, known, required=("file", "light"), what="a photo") for item in node.value]
        return tuple(FlashPhoto(**entry) for entry in entries if entry is not None and None not in entry.values())

    def number_of_light(self, node: yaml.Node) -> int | None:
        text = str(self.text(node))
        if not text.isdecimal() or int(text) < 1:
            self.problem(node, f"'{text}' is no number of a light", "a whole number from 1")
            return None
        return int(text)

    def lights(self, node: yaml.Node) -> tuple[Numbers, ...] | None:
        found = self.places(node, 3, "a list of [x, y, z] in mm", "lights_mm")
        for place in found or ():
            self.above(node, place)
        return found

    def above(self, node: yaml.Node, place: Numbers | None) -> Numbers | None:
        if place is not None and place[2] <= 0:
            self.problem(node, f"{list(place)} is not above the sheet", "[x, y, z] in mm, z towards the camera")
        return place

    def places(
        self, node: yaml.Node, length: int, expected: str, name: str, count: int | None = None
    ) -> tuple[Numbers, ...] | None:
        items = node.value if isinstance(node, yaml.SequenceNode) else []
        if not items or (count is not None and len(items) != count):
            self.problem(node, f"{name} is {described(node)}", expected)
            return None
        found = [self.numbers(item, length, expected, f"one of {name}") for item in items]
        return None if any(place is None for place in found) else tuple(place for place in found if place is not None)

    def numbers(
        self, node: yaml.Node, length: int, expected: str, name: str, least: float = -math.inf
    ) -> Numbers | None:
        items = node.value if isinstance(node, yaml.SequenceNode) else []
        try:
            found = tuple(float(str(self.text(item))) for item in items)
        except ValueError:
            found = ()
        if len(found) != length or not all(math.isfinite(number) and number > least for number in found):
            self.problem(node, f"{name} is {described(node)}", expected)
            return None
        return found
