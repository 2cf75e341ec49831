"""Scans as instruments write them: Gwyddion, Bruker, Igor, Nanosurf, X3P and what else SurfaceTopography reads."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError, nearest

INSTALL = "pip install 'optibench[surfaces]'"


@dataclass(frozen=True, eq=False)
class Scan:
    """Heights of one channel.

    Attributes
    ----------
    height_um : ndarray of shape (M, N), float64
        Row 0 on top; NaN where the instrument had none.
    pitch_um : tuple of float
        Along x and y.
    """

    height_um: NDArray[np.float64]
    pitch_um: tuple[float, float]


def read_instrument_file(path: Path, channel: str = "") -> Scan:
    """Read a scan through the package SurfaceTopography.

    Parameters
    ----------
    path : Path
        The file; its format is found from its content.
    channel : str
        Name of the channel; empty: the first that holds heights.

    Raises
    ------
    InputError
        The package is not installed, the format is not known, the file is damaged, there is no such channel, or it
        holds no lengths over an area.
    """
    try:
        from SurfaceTopography import open_topography
        from SurfaceTopography.Exceptions import CannotDetectFileFormat
    except ImportError:
        raise InputError(
            f"{path.name} needs the package SurfaceTopography, which is not installed", where=str(path), hint=INSTALL
        ) from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            reader = open_topography(str(path))
            chosen = _chosen(reader, channel, path)
            if chosen.physical_sizes is None:
                raise InputError(
                    f"{path.name} does not say how large its map is, nor in which unit",
                    where=str(path),
                    expected="an instrument's file with lengths",
                    hint="np.save('map.npy', heights in um), and pitch_um",
                )
            surface = chosen.topography()
    except CannotDetectFileFormat:
        right = "a picture, .npy, .gwy, .spm, .ibw, .nid, .x3p or another format that SurfaceTopography reads"
        raise InputError(f"{path.name} is of no known format", where=str(path), expected=right) from None
    except InputError:
        raise
    except Exception as error:  # readers of forty formats fail in as many ways
        raise InputError(f"the scan is damaged or cannot be read: {error}", where=str(path)) from None
    if surface.dim != 2 or not surface.is_uniform:
        raise InputError(f"channel '{chosen.name}' is no map", where=str(path), expected="heights over an even grid")
    if surface.unit is None:
        raise InputError(f"channel '{chosen.name}' has no unit of length", where=str(path), expected="heights")
    in_um = surface.to_unit("µm")
    masked = np.ma.asarray(in_um.heights().T, np.float64)
    pitch_x, pitch_y = (
        float(size) / count for size, count in zip(in_um.physical_sizes, in_um.nb_grid_pts, strict=True)
    )
    return Scan(np.asarray(masked.filled(np.nan)), (pitch_x, pitch_y))


def _chosen(reader: Any, channel: str, path: Path) -> Any:
    channels = {str(one.name): one for one in reader.channels}
    if not channel:
        return reader.default_channel
    if channel not in channels:
        right = "a name from: " + ", ".join(channels)
        raise InputError(
            f"there is no channel '{channel}'", where=str(path), expected=right, hint=nearest(channel, channels)
        )
    return channels[channel]
