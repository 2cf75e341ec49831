"""A height map in a folder with its ``capture.yaml``.

::

    kind: height_field
    file: scan.png
    pitch_um: 0.0488                # optional, as is everything below file
    full_height_um: 0.375           # of pictures: height of full scale over zero
    channel: Height                 # of an instrument's file with several
    periodic: false                 # whether the tile repeats
    caption: a shed skin            # what it is
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from pipeline.data.height_fields import HeightField
from pipeline.devices.capture_yaml import CAPTURE_FILE
from pipeline.devices.height_files import MapDescription, read_height_file
from pipeline.devices.yaml_reader import YamlReader, root_of
from pipeline.errors import InputError, InputErrors

KIND = "height_field"


def read_height_folder(folder: Path, told: MapDescription) -> HeightField:
    """Read the map that a folder's ``capture.yaml`` names; what ``told`` says counts instead of what that says.

    Raises
    ------
    InputError, InputErrors
        What is wrong with ``capture.yaml`` or the file.
    """
    path = folder / CAPTURE_FILE
    if not path.is_file():
        right = f"a height map, or a folder with a {CAPTURE_FILE} of kind {KIND}"
        raise InputError(f"the folder has no {CAPTURE_FILE}", where=str(folder), expected=right)
    reader = _Reader(path)
    stated = reader.description(root_of(path))
    if stated is None or reader.problems:
        raise InputErrors(reader.problems)
    file = stated.pop("file")
    given = {name: value for name, value in vars(told).items() if value not in (None, "", False)}
    return read_height_file(file, replace(MapDescription(**stated), **given))


class _Reader(YamlReader):
    def description(self, root: yaml.Node | None) -> dict[str, Any] | None:
        known: dict[str, Callable[[yaml.Node], Any]] = {
            "kind": self.kind,
            "file": self.file,
            "pitch_um": self.positive,
            "full_height_um": self.positive,
            "channel": self.text,
            "periodic": self.boolean,
            "caption": self.text,
        }
        values = self.fields(root, known, required=("kind", "file"))
        if values is None:
            return None
        return values

    def kind(self, node: yaml.Node) -> str | None:
        text = self.text(node)
        if text is not None and text != KIND:
            self.problem(node, f"'{text}' is no height map", KIND)
        return text
