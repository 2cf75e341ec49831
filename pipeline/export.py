"""Values written out in the form in which devices take them in again."""

from __future__ import annotations

from pathlib import Path

from pipeline.data import PolarizerSequence
from pipeline.errors import InputError
from pipeline.runs import Run


def export_photos(run: Run, node: str, folder: Path) -> Path:
    """Write a node's photographs as a folder with ``capture.yaml``, which the replay rig takes in bit for bit.

    Raises
    ------
    InputError
        The node's value is no sequence of photographs, or the folder holds something already.
    """
    from pipeline.devices.photo_folder_writer import write_polarizer_sequence

    value = run[node]
    if not isinstance(value, PolarizerSequence):
        raise InputError(
            f"node '{node}' gives {type(value).__name__}", where=str(run.path), expected="a node that gives photographs"
        )
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder} is not empty", expected="a new or empty folder")
    return write_polarizer_sequence(value, folder)
