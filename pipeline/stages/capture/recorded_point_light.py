"""Photographs of the sample under a torch, from files."""

from __future__ import annotations

from pathlib import Path

from pipeline.data.pictures import PictureSeries
from pipeline.devices.point_light_folder import read_point_light_folder


def recorded_point_light(*, folder: Path) -> PictureSeries:
    """Take photographs under a torch that was carried around the sample from a folder.

    They show the same pixels of the sample as the photographs through the polariser do: the same camera, which nobody
    moved. What the folder holds is said in :mod:`pipeline.devices.point_light_folder`.

    Parameters
    ----------
    folder : Path
        Photographs, and a ``capture.yaml`` of kind ``point_light``.

    Returns
    -------
    PictureSeries
        Of shape (lights, M, N, 3), linear.

    Raises
    ------
    InputErrors
        What is wrong with ``capture.yaml`` or a file.
    """
    return read_point_light_folder(folder)


def _check_recorded_point_light(*, folder: Path) -> None:
    """Decode all files before anything runs."""
    read_point_light_folder(folder)
