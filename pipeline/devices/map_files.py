"""Maps of gratings from files: our own EXR, arrays of numpy, and grey pictures with a stated range."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tokenize import TokenError

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from pipeline.devices.photo_files import RAW_SUFFIXES, read_photo, readable_suffixes
from pipeline.devices.single_precision import shortest
from pipeline.errors import InputError, nearest

Float32Array = NDArray[np.float32]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class MapFile:
    """What a file of a map holds.

    Attributes
    ----------
    values : ndarray of shape (M, N), float32
        The map, row 0 on top.
    shares : bool
        Whether the values are shares of a full scale, as integers are, and not numbers of a unit.
    channels : mapping of str to ndarray of shape (M, N), float32
        What lies beside it in an EXR file of ours.
    attributes : mapping of str to float
        Numbers that such a file states.
    """

    values: Float32Array
    shares: bool = False
    channels: Mapping[str, Float32Array] = field(default_factory=dict)
    attributes: Mapping[str, float] = field(default_factory=dict)

    def stated(self, name: str, told: float | None) -> float | None:
        """A number that was told, or that the file states."""
        return told if told is not None else self.attributes.get(name)


def read_map_file(path: Path, channel: str) -> MapFile:
    """Read a map from an EXR file with a channel of that name, a grey picture, or a two-dimensional array (``.npy``).

    Raises
    ------
    InputError
        The file is missing, unreadable, in colour, or of another form than a map.
    """
    if not path.is_file():
        siblings = (p.name for p in path.parent.iterdir()) if path.parent.is_dir() else ()
        what = f"{path.name} is a folder" if path.is_dir() else f"there is no file {path.name}"
        raise InputError(what, where=str(path), expected="a map", hint=nearest(path.name, siblings))
    suffix = path.suffix.lower()
    if suffix == ".npy":
        found = MapFile(_array(path))
    elif suffix == ".exr":
        found = _exr(path, channel)
    elif suffix in readable_suffixes() - RAW_SUFFIXES:
        found = grey_picture(path)
    else:
        raise InputError(
            f"{path.name} is no map",
            where=str(path),
            expected="an .exr or .npy file, or a grey picture",
            hint="maps=vector draws shapes" if suffix == ".svg" else "",
        )
    if found.values.ndim != 2 or not found.values.size:
        shape = " x ".join(map(str, found.values.shape))
        raise InputError(f"an array of {shape}", where=str(path), expected="rows and columns")
    return found


def grey_picture(path: Path) -> MapFile:
    """Read a picture in grey, integers as shares of full scale.

    Raises
    ------
    InputError
        It is missing, unreadable or in colour.
    """
    image = read_photo(path, linear=True).image
    if image.ndim == 3:
        if (image != image[..., :1]).any():
            raise InputError("a picture in colour", where=str(path), expected="grey")
        image = image[..., 0]
    source = OpenImageIO.ImageInput.open(str(path))
    assert source is not None
    kind = str(source.spec().format)
    source.close()
    return MapFile(np.ascontiguousarray(image), shares=kind not in {"half", "float", "double"})


def in_range(
    found: MapFile, path: Path, setting: str, ends: Sequence[float] | None, *, or_else: str = ""
) -> Float32Array:
    """The map in its unit: shares of a full scale between two ends, other numbers as they are where none are given.

    Raises
    ------
    InputError
        Shares without ends, or not two ends.
    """
    if ends is None:
        if found.shares:
            right = f"{setting}{or_else}: what black and full scale (grey 255 of 8 bits) stand for"
            raise InputError(f"{path.name} holds shares of a range that is not told", where=setting, expected=right)
        return found.values
    if len(ends) != 2:
        raise InputError(f"{setting} is {list(ends)}", where=setting, expected="two numbers: black, full scale")
    low, high = ends
    return np.asarray(low + (high - low) * found.values.astype(np.float64), np.float32)


def read_mask(path: Path | None, shape: tuple[int, ...]) -> BoolArray:
    """Where a picture of a mask is not black; everywhere without one.

    Raises
    ------
    InputError
        It is no grey picture, or of another shape than the map.
    """
    if path is None:
        return np.ones(shape, bool)
    mask = grey_picture(path).values > 0
    if mask.shape != shape:
        sizes = f"{mask.shape[1]} x {mask.shape[0]} pixels, the map {shape[1]} x {shape[0]}"
        raise InputError(f"the mask has {sizes}", where="mask", expected="a picture as large as the map")
    return mask


def _array(path: Path) -> Float32Array:
    try:
        # Mapped, so that a header which claims more than the file holds asks for no memory.
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, OSError, EOFError, OverflowError, RecursionError, MemoryError, TokenError) as error:
        raise InputError(f"the array cannot be read: {error}", where=str(path)) from None
    if not isinstance(array, np.ndarray):
        raise InputError(f"{path.name} is an archive of arrays", where=str(path), expected="one array")
    if array.dtype.kind not in "iuf":
        raise InputError(f"an array of {array.dtype}", where=str(path), expected="real numbers")
    return np.ascontiguousarray(array, np.float32)


def _complaint() -> str:
    try:
        return str(OpenImageIO.geterror())
    except UnicodeDecodeError:  # it quotes the bytes of a damaged header
        return "its header is damaged"


def _exr(path: Path, channel: str) -> MapFile:
    """The channel of that name with all that lies beside it, or a grey picture."""
    source = OpenImageIO.ImageInput.open(str(path))
    if source is None:
        raise InputError(f"{path.name} cannot be read: {_complaint()}", where=str(path))
    try:
        spec = source.spec()
        pixels = source.read_image(0, 0, 0, spec.nchannels, OpenImageIO.FLOAT)
    finally:
        source.close()
    if pixels is None:
        raise InputError(f"{path.name} is truncated or damaged", where=str(path))
    channels = {name: np.ascontiguousarray(pixels[..., i]) for i, name in enumerate(spec.channelnames)}
    if channel not in channels and list(channels) != ["Y"]:
        names = ", ".join(channels)
        raise InputError(
            f"{path.name} has the channels {names}",
            where=str(path),
            expected=f"a channel '{channel}', or a single one that is called 'Y'",
        )
    values = channels.get(channel, pixels[..., 0])
    numbers = {p.name: shortest(p.value) for p in spec.extra_attribs if str(p.type) == "float"}
    return MapFile(values, False, channels if channel in channels else {}, numbers)
