"""A height map from a file."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from pipeline.data.height_fields import HeightField
from pipeline.devices.height_files import MapDescription, read_height_file
from pipeline.devices.height_folder import read_height_folder
from pipeline.limits import above_zero, refuse

_log = logging.getLogger(__name__)
_LEAST_UM = 1e-5
"""A tenth of an atom: no instrument resolves less."""


def height_map(
    *,
    file: Path,
    pitch_um: float | None = None,
    full_height_um: float | None = None,
    channel: str = "",
    periodic: bool = False,
    caption: str = "",
) -> HeightField:
    """Read a measured height map.

    Parameters
    ----------
    file : Path
        A picture whose grey is height, in any format that OpenImageIO reads; an array of numpy (``.npy``) in um; an
        instrument's file, such as ``.gwy``, ``.spm``, ``.ibw``, ``.nid`` and ``.x3p`` (``pip install
        'optibench[surfaces]'``); or a folder with a ``capture.yaml`` of kind ``height_field``, which says what the
        other settings say. Row 0 is on top.
    pitch_um : float, optional
        Distance of neighbouring samples; needed unless the file states it, and used instead where it does.
    full_height_um : float, optional
        Of a picture: height of full scale over zero, of grey 255 in one of 8 bits. Pictures of floating-point numbers
        hold um without it.
    channel : str
        Of an instrument's file with several channels.
    periodic : bool
        Whether the tile repeats.
    caption : str
        What it is and where it comes from, for the report.

    Returns
    -------
    HeightField
        float32; NaN where nothing was measured. Pixels that were not square are resampled to the smaller pitch. Heights
        that look as if they were in another unit than um, deeper than the map is wide or far less than an atom, are
        warned of.

    Raises
    ------
    InputError, InputErrors
        The file is missing, unreadable, in colour, or says too little, or a package that reads it is not installed.
    """
    field = _read(file, MapDescription(pitch_um, full_height_um, channel, periodic, caption))
    relief = float(np.nanmax(field.height_um) - np.nanmin(field.height_um))
    width = max(field.height_um.shape) * field.pitch_um
    if relief > width or 0 < relief < _LEAST_UM:
        _log.warning("Heights span %.3g um on a map %.3g um wide: are heights and pitch both in um?", relief, width)
    return field


def _check_height_map(
    *,
    file: Path,
    pitch_um: float | None,
    full_height_um: float | None,
    channel: str,
    periodic: bool,
    caption: str,
) -> None:
    """Decode the file before anything runs."""
    _read(file, MapDescription(pitch_um, full_height_um, channel, periodic, caption))


def _read(file: Path, told: MapDescription) -> HeightField:
    refuse(above_zero(pitch_um=told.pitch_um, full_height_um=told.full_height_um))
    return read_height_folder(file, told) if file.is_dir() else read_height_file(file, told)
