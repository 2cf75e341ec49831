"""Maps and pictures as pyvista meshes, in millimetres, x right and y up."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from pipeline.errors import InputError


def as_mesh(value: Any) -> Any:
    """A value's images as the cells of one flat ``pyvista.ImageData``.

    Parameters
    ----------
    value : dataclass of pipeline.data
        Its arrays of shape (M, N) become cell data under their names; those of shape (K, M, N) one array each, named
        with their number; those of shape (M, N, 3) and (K, M, N, 3) colours.

    Returns
    -------
    pyvista.ImageData
        Of N x M cells, the pixel pitch wide (1 where it is not known), centred on the origin; the first row is on top.

    Raises
    ------
    InputError
        pyvista is not installed, or the value holds no image.
    """
    try:
        import pyvista
    except ImportError:
        raise InputError("meshes need the package pyvista", expected="pip install pyvista") from None
    arrays = {f.name: np.asarray(getattr(value, f.name)) for f in fields(value)} if is_dataclass(value) else {}
    images = {name: image for name, array in arrays.items() for name, image in _images(name, array)}
    shapes = {image.shape[:2] for image in images.values()}
    if not shapes:
        raise InputError(f"a value of type {type(value).__name__} holds no image", expected="maps or photographs")
    rows, columns = max(shapes)
    pitch = float(getattr(value, "pixel_mm", None) or 1.0)
    mesh = pyvista.ImageData(
        dimensions=(columns + 1, rows + 1, 1),
        spacing=(pitch, pitch, pitch),
        origin=(-columns * pitch / 2, -rows * pitch / 2, 0.0),
    )
    for name, image in images.items():
        if image.shape[:2] == (rows, columns):
            upright = image[::-1]
            mesh.cell_data[name] = upright.reshape(rows * columns, *image.shape[2:])
    return mesh


def _images(name: str, array: np.ndarray) -> list[tuple[str, np.ndarray]]:
    if array.dtype.kind not in "biuf":
        return []
    coloured = array.ndim >= 3 and array.shape[-1] == 3
    depth = array.ndim - 2 - coloured
    if depth == 0:
        return [(name, array)]
    return [(f"{name}_{k}", array[k]) for k in range(len(array))] if depth == 1 else []
