"""Values written out in the form in which devices take them in again."""

from __future__ import annotations

from pathlib import Path

from pipeline.data.flash import FlashBrackets
from pipeline.data.photographs import PolarizerSequence
from pipeline.data.pictures import PictureSeries
from pipeline.errors import InputError
from pipeline.runs import Run


def export_photos(run: Run, node: str, folder: Path) -> Path:
    """Write a node's photographs as a folder with ``capture.yaml``, which a replay takes in bit for bit.

    Raises
    ------
    InputError
        The node's value is neither a sequence of photographs nor pictures under a torch or brackets under a flash, or
        the folder holds something already.
    """
    from pipeline.devices.photo_folder_writer import write_flash, write_point_light, write_polarizer_sequence

    value = run[node]
    if not isinstance(value, PolarizerSequence | PictureSeries | FlashBrackets):
        raise InputError(
            f"node '{node}' gives {type(value).__name__}",
            where=str(run.path),
            expected="a node that gives photographs",
            hint="what is written of others lies in its folder outputs",
        )
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder} is not empty", expected="a new or empty folder")
    if isinstance(value, FlashBrackets):
        return write_flash(value, folder)
    if isinstance(value, PictureSeries):
        return write_point_light(value, folder)
    return write_polarizer_sequence(value, folder)
