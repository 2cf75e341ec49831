"""What a disk refuses, in words that name it."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pipeline.errors import PipelineError

_FULL = {errno.ENOSPC, errno.EDQUOT}


class DiskError(PipelineError, OSError):
    """A disk is full, or fails; also an :class:`OSError`, for those who go on without what could not be written."""


@contextmanager
def writing(path: str | Path) -> Iterator[None]:
    """Say which disk is full where a file inside the block could not be written, and what to do.

    Raises
    ------
    DiskError
        A disk is full or fails, or a quota is used up.
    """
    try:
        yield
    except DiskError:
        raise
    except OSError as error:
        if error.errno in _FULL:
            raise DiskError(_full(Path(error.filename or path), error)) from error
        if error.errno in {errno.EIO, errno.EROFS}:
            raise DiskError(f"{error.filename or path} cannot be written: {error.strerror}") from error
        raise


def _full(path: Path, error: OSError) -> str:
    disk = disk_of(path)
    free, total = (_size(number) for number in (shutil.disk_usage(disk).free, shutil.disk_usage(disk).total))
    return (
        f"the disk of {disk} is full ({error.strerror}; {free} of {total} are free), so that {path.name} was not kept\n"
        "  hint:     what was finished is kept: the same command goes on from there once there is space; "
        "paths.store=DIR and paths.runs=DIR put results elsewhere"
    )


def disk_of(path: Path) -> Path:
    """The folder on which the disk is mounted that a file is on, or would be."""
    found = path.absolute()
    while not os.path.ismount(found):
        found = found.parent
    return found


def _size(number: float) -> str:
    for unit in ("bytes", "kB", "MB", "GB"):
        if number < 1000:
            return f"{number:.3g} {unit}"
        number /= 1000
    return f"{number:.3g} TB"
