"""A map of orientation from a file, or from the run of another experiment."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from pipeline.data.gratings import PARAMETER, OrientationMap
from pipeline.devices.map_files import in_range, read_map_file, read_mask
from pipeline.devices.run_outputs import output_of
from pipeline.errors import InputError
from pipeline.limits import above_zero, refuse
from pipeline.optics.angles import wrap_axial

_log = logging.getLogger(__name__)


def orientation_map(
    *,
    file: Path,
    node: str = "",
    range_deg: tuple[float, ...] | None = None,
    mask: Path | None = None,
    pixel_mm: float | None = None,
    absolute: bool | None = None,
) -> OrientationMap:
    """Read a map of the orientation of the grating's tangent.

    Angles count anticlockwise from +x, y up, as the map is displayed; row 0 is on top.

    Parameters
    ----------
    file : Path
        The folder of a run (``runs/polarization_logo/3f2a91c0``); one of the EXR files that runs write, with a channel
        ``orientation_rad``; an array of numpy (``.npy``) or a floating-point picture of one channel, in radians; or a
        grey picture of integers, whose ``range_deg`` has to be told.
    node : str
        Of a run, which node's map; empty: the last one, which no other map of orientation was made from.
    range_deg : [float, float], optional
        What black and full scale (255 of 8 bits, 1 of floating-point numbers) stand for; ``[0, 1]`` reads
        floating-point numbers as degrees.
    mask : Path, optional
        A grey picture of the same size, black where nothing diffracts. NaN diffract nowhere.
    pixel_mm : float, optional
        Pitch, where the file does not say it, or instead of what it says.
    absolute : bool, optional
        Whether the map has no unknown offset; null: what the file says, false where it says nothing.

    Returns
    -------
    OrientationMap
        With all that the file holds; of others no correlation and no intensity.

    Raises
    ------
    InputError
        The file or the run's map is missing, unreadable or no map, its range is not told, or all of it is masked.
    """
    refuse(above_zero(pixel_mm=pixel_mm))
    if file.is_dir():
        file, chosen = output_of(file, OrientationMap.__name__, node, "fit")
        _log.info("the map of node '%s'", chosen)
    found = read_map_file(file, "orientation_rad")
    angles = in_range(found, file, "range_deg", range_deg)
    if range_deg is not None:
        angles = np.deg2rad(angles)
    diffracts = read_mask(mask, angles.shape) & np.isfinite(angles)
    if not diffracts.any():
        raise InputError("no orientation is known: all is masked", where=str(file), expected="a map of orientation")
    wrapped = wrap_axial(np.where(diffracts, angles, 0)).astype(np.float32)
    wrapped[wrapped >= np.float32(np.pi)] = 0
    wrapped[~diffracts] = np.nan
    plain = OrientationMap.of_angles(
        wrapped,
        pixel_mm=found.stated("pixel_mm", pixel_mm),
        absolute=bool(found.attributes.get("absolute")) if absolute is None else absolute,
    )
    return OrientationMap(
        plain.orientation_rad,
        found.channels.get("correlation", plain.correlation),
        found.channels.get("intensity", plain.intensity),
        plain.mask,
        plain.pixel_mm,
        plain.absolute,
        found.channels.get("standard_error_rad"),
        {n.removeprefix(PARAMETER): v for n, v in found.attributes.items() if n.startswith(PARAMETER)},
    )


def _check_orientation_map(
    *,
    file: Path,
    node: str,
    range_deg: tuple[float, ...] | None,
    mask: Path | None,
    pixel_mm: float | None,
    absolute: bool | None,
) -> None:
    """Decode the file before anything runs."""
    orientation_map(file=file, node=node, range_deg=range_deg, mask=mask, pixel_mm=pixel_mm, absolute=absolute)
