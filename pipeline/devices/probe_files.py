"""Light probes from files that OpenImageIO reads, such as EXR and HDR."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.devices.photo_files import read_photo
from pipeline.errors import InputError

LEAST_ROWS = 4


def read_probe(path: Path) -> NDArray[np.float32]:
    """Read a probe in latitude and longitude, shape (M, 2 M, 3), linear.

    Raises
    ------
    InputError
        The file is missing or unreadable, grey or black, holds what is no light, or is not twice as wide as high.
    """
    image = read_photo(path).image
    if image.ndim != 3:
        raise InputError(f"{path.name} is grey", where=str(path), expected="red, green and blue")
    rows, columns = image.shape[:2]
    if columns != 2 * rows or rows < LEAST_ROWS:
        raise InputError(
            f"{path.name} has {columns} x {rows} pixels",
            where=str(path),
            expected="a picture in latitude and longitude, twice as wide as high",
        )
    wrong = int(np.count_nonzero(~(np.isfinite(image) & (image >= 0)).all(axis=-1)))
    if wrong:
        raise InputError(f"{wrong} pixels hold no light", where=str(path), expected="numbers from 0")
    if not image.any():
        raise InputError(f"{path.name} is black", where=str(path), expected="some light")
    return np.ascontiguousarray(image)
