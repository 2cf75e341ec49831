"""What a folder of photographs says about itself: its ``capture.yaml``.

::

    kind: polarizer_sequence
    wavelength_nm: 530                            # optional, as is everything but kind and photos
    pixel_mm: 0.02
    photos:
      - {file: psi_000.tif, polarizer_deg: 0.0, exposure_s: 0.01}
      - {file: raw.png, mosaic_deg: [[90, 45], [135, 0]]}   # one frame of a polarisation camera
    mask: mask.png                                # white: pixels to use
    dark: [dark_1.tif, dark_2.tif]                # lens capped, same exposure
    flat: [flat_1.tif]                            # an even, unpolarised white
    linear: true                                  # whether values are proportional to light; see photo_files.read_photo
    saturation: 1.0                               # where the sensor was full: of floats the value; of integers the
                                                  # share of the format's largest number, or the number if above 1
    metadata: {model: ...}                        # instead of what the files say
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from pipeline.devices.decimal_angles import radians_of
from pipeline.devices.yaml_reader import YamlReader, described, root_of
from pipeline.errors import InputErrors, nearest

CAPTURE_FILE = "capture.yaml"
KIND = "polarizer_sequence"
KINDS = (KIND, "point_light", "flash", "sheet_stack", "bispectral", "height_field")

Mosaic = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True)
class PhotoEntry:
    """One file of the capture.

    Attributes
    ----------
    file : Path
        Where it is.
    polarizer_rad : float or None
        Angle of the polariser in front of the camera; None for a mosaic.
    mosaic_rad : tuple of tuple of float, or None
        Angles of the 2 x 2 block of polarisers on the sensor, row by row.
    exposure_s : float or None
        Exposure time, where stated.
    where : str
        Place in ``capture.yaml``, for messages.
    """

    file: Path
    polarizer_rad: float | None = None
    mosaic_rad: Mosaic | None = None
    exposure_s: float | None = None
    where: str = ""


@dataclass(frozen=True)
class Capture:
    """What was photographed, and with which files; every field as in ``capture.yaml``."""

    source: Path
    photos: tuple[PhotoEntry, ...]
    wavelength_nm: float | None = None
    pixel_mm: float | None = None
    mask: Path | None = None
    dark: tuple[Path, ...] = ()
    flat: tuple[Path, ...] = ()
    linear: bool | None = None
    saturation: float | None = None
    metadata: Mapping[str, str] | None = field(default=None)


def read_capture_yaml(path: Path) -> Capture:
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
    def capture(self, root: yaml.Node | None) -> Capture | None:
        known: dict[str, Callable[[yaml.Node], Any]] = {
            "kind": self.kind,
            "photos": self.photos,
            "wavelength_nm": self.positive,
            "pixel_mm": self.positive,
            "mask": self.file,
            "dark": self.files,
            "flat": self.files,
            "linear": self.boolean,
            "saturation": self.positive,
            "metadata": self.texts,
        }
        values = self.fields(root, known, required=("kind", "photos"))
        if values is None:
            return None
        return Capture(source=self.path, **values)

    def kind(self, node: yaml.Node) -> str | None:
        text = self.text(node)
        if text is not None and text != KIND:
            what = "cannot be replayed as photographs through a polariser" if text in KINDS else "is no kind of capture"
            self.problem(node, f"'{text}' {what}", KIND, nearest(text, KINDS) if text not in KINDS else "")
        return text

    def photos(self, node: yaml.Node) -> tuple[PhotoEntry, ...]:
        if not isinstance(node, yaml.SequenceNode) or not node.value:
            self.problem(node, f"photos is {described(node)}", "a list of {file: ..., polarizer_deg: ...}")
            return ()
        return tuple(entry for entry in map(self.photo, node.value) if entry is not None)

    def photo(self, node: yaml.Node) -> PhotoEntry | None:
        known: dict[str, Callable[[yaml.Node], Any]] = {
            "file": self.file,
            "polarizer_deg": self.angle,
            "mosaic_deg": self.mosaic,
            "exposure_s": self.positive,
        }
        values = self.mapping(node, known, required=("file",), what="a photo")
        if values is None:
            return None
        if ("polarizer_deg" in values) == ("mosaic_deg" in values):
            both = "both" if "mosaic_deg" in values else "neither"
            self.problem(
                node,
                f"a photo has {both} of polarizer_deg and mosaic_deg",
                "polarizer_deg: 45, or mosaic_deg: [[90, 45], [135, 0]] for a frame of a polarisation camera",
            )
        if values.get("file") is None:
            return None
        return PhotoEntry(
            file=values["file"],
            polarizer_rad=values.get("polarizer_deg"),
            mosaic_rad=values.get("mosaic_deg"),
            exposure_s=values.get("exposure_s"),
            where=self.place(node),
        )

    def mosaic(self, node: yaml.Node) -> Mosaic | None:
        rows = node.value if isinstance(node, yaml.SequenceNode) else []
        shape = [len(row.value) if isinstance(row, yaml.SequenceNode) else 0 for row in rows]
        if shape != [2, 2]:
            self.problem(node, f"mosaic_deg is {described(node)}", "two rows of two angles: [[90, 45], [135, 0]]")
            return None
        angles = [self.angle(item) for row in rows for item in row.value]
        if any(angle is None for angle in angles):
            return None
        a, b, c, d = (angle or 0.0 for angle in angles)
        return ((a, b), (c, d))

    def angle(self, node: yaml.Node) -> float | None:
        text = self.text(node)
        try:
            return None if text is None else radians_of(text)
        except ValueError:
            self.problem(node, f"'{text}' is no angle", "degrees, such as 22.5")
            return None
