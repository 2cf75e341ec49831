"""Height maps from files: pictures whose grey is height, arrays of numpy, and the formats of instruments."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from pipeline.data.height_fields import HeightField
from pipeline.devices.instrument_files import read_instrument_file
from pipeline.devices.photo_files import RAW_SUFFIXES, read_photo, readable_suffixes
from pipeline.devices.single_precision import shortest
from pipeline.errors import InputError, nearest
from pipeline.optics.height_sampling import squared

LEAST_SIDE = 2


@dataclass(frozen=True)
class MapDescription:
    """What a file of heights does not say itself, or what counts instead of what it says.

    Attributes
    ----------
    pitch_um : float or None
        Distance of neighbouring samples.
    full_height_um : float or None
        Of pictures: height of full scale over zero, which is 255 in 8 bits and 1 among floating-point numbers.
    channel : str
        Which channel of an instrument's file; empty: the first with heights.
    periodic : bool
        Whether the tile repeats.
    caption : str
        What it is.
    """

    pitch_um: float | None = None
    full_height_um: float | None = None
    channel: str = ""
    periodic: bool = False
    caption: str = ""


def read_height_file(path: Path, told: MapDescription) -> HeightField:
    """Read a height map.

    ``.npy`` holds heights in um. Pictures of integers hold shares of the full height, which has to be told; pictures of
    floating-point numbers hold um, or shares where a full height is told. Our own EXR files carry their pitch. All else
    is taken for an instrument's file, see :mod:`pipeline.devices.instrument_files`. Pixels that are not square are
    brought to square ones of the smaller pitch.

    Parameters
    ----------
    path : Path
        The file.
    told : MapDescription
        What it does not say.

    Returns
    -------
    HeightField
        float32; NaN where the file has none.

    Raises
    ------
    InputError
        The file is missing, unreadable, in colour, of another form than a map, or says too little.
    """
    if not path.is_file():
        siblings = (p.name for p in path.parent.iterdir()) if path.parent.is_dir() else ()
        what = f"{path.name} is a folder" if path.is_dir() else f"there is no file {path.name}"
        raise InputError(what, where=str(path), expected="a height map", hint=nearest(path.name, siblings))
    suffix = path.suffix.lower()
    if suffix == ".npy":
        height, pitch = _of_array(path, told)
    elif suffix in readable_suffixes() - RAW_SUFFIXES:
        height, pitch = _of_picture(path, told)
    else:
        height, pitch = _of_instrument(path, told)
    if height.ndim != 2 or min(height.shape) < LEAST_SIDE:
        shape = " x ".join(map(str, height.shape))
        raise InputError(f"an array of {shape}", where=str(path), expected=f"rows and columns, {LEAST_SIDE} or more")
    if not np.isfinite(height).any():
        raise InputError("no height is known: all are NaN", where=str(path), expected="a height map")
    height = np.where(np.isfinite(height), height, np.nan).astype(np.float32)
    return HeightField(height, pitch, told.periodic, told.caption or "Height map")


def _of_array(path: Path, told: MapDescription) -> tuple[NDArray[Any], float]:
    try:
        array = np.load(path, allow_pickle=False)
    except (ValueError, OSError, EOFError) as error:
        raise InputError(f"the array cannot be read: {error}", where=str(path)) from None
    if array.dtype.kind not in "iuf":
        raise InputError(f"an array of {array.dtype}", where=str(path), expected="heights in um, as real numbers")
    if told.full_height_um is not None:
        raise InputError(
            f"full_height_um is {told.full_height_um:g}, but an array holds heights",
            where="full_height_um",
            expected="null: the numbers are um",
        )
    return array, _told_pitch(path, told)


def _of_picture(path: Path, told: MapDescription) -> tuple[NDArray[Any], float]:
    photo = read_photo(path, linear=True)
    image = photo.image
    if image.ndim == 3:
        if (image != image[..., :1]).any():
            raise InputError(
                "a picture in colour", where=str(path), expected="grey, or red, green and blue that are the same"
            )
        image = image[..., 0]
    numbers, stated = _spec(path)
    if told.full_height_um is None:
        if numbers != "float":
            raise InputError(
                f"{path.name} holds shares of a height that is not told",
                where="full_height_um",
                expected="full_height_um: height of full scale (grey 255 of 8 bits, 65535 of 16) over zero, in um",
            )
        return image, _told_pitch(path, told, stated)
    return image.astype(np.float64) * told.full_height_um, _told_pitch(path, told, stated)


def _spec(path: Path) -> tuple[str, float | None]:
    """Kind of numbers in a picture, and the pitch that ours carry."""
    source = OpenImageIO.ImageInput.open(str(path))
    assert source is not None
    spec = source.spec()
    source.close()
    kind = "float" if str(spec.format) in {"half", "float", "double"} else "integer"
    pitch = spec.get_float_attribute("pitch_um", 0.0)
    return kind, shortest(pitch) if pitch > 0 else None


def _told_pitch(path: Path, told: MapDescription, stated: float | None = None) -> float:
    pitch = told.pitch_um if told.pitch_um is not None else stated
    if pitch is None:
        raise InputError(
            f"{path.name} does not say how far its samples lie apart",
            where="pitch_um",
            expected="pitch_um: the distance in um",
        )
    return pitch


def _of_instrument(path: Path, told: MapDescription) -> tuple[NDArray[Any], float]:
    if told.full_height_um is not None:
        raise InputError(
            f"full_height_um is {told.full_height_um:g}, but {path.name} states its heights",
            where="full_height_um",
            expected="null",
        )
    scan = read_instrument_file(path, told.channel)
    pitch_x, pitch_y = scan.pitch_um
    height, pitch = scan.height_um, pitch_x
    if not np.isclose(pitch_x, pitch_y, rtol=1e-5, atol=0):
        height, pitch = squared(scan.height_um, pitch_x, pitch_y)
    return height, told.pitch_um or pitch
