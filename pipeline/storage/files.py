"""Files written whole or not at all, and digests of files remembered by their size and time."""

from __future__ import annotations

import json
import os
import time
import uuid
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from pipeline.errors import InputError, nearest
from pipeline.storage.disks import writing
from pipeline.storage.keys import digest, digest_file
from pipeline.storage.sealed import sealed, unsealed

_SETTLING_NS = 100_000_000

MOST_FILES = 10_000
"""A folder given as a setting may hold at most this many files."""


def write_text(path: Path, text: str) -> None:
    """Write a text file so that a reader sees the old content or the new, never a part."""
    write_bytes(path, text.encode())


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file so that a reader sees the old content or the new, never a part."""
    folder, name = os.path.split(path)
    temporary = os.path.join(folder, f".{name}.{uuid.uuid4().hex[:8]}")
    try:
        with writing(path):
            try:
                write_pieces(temporary, data)
            except FileNotFoundError:
                make_folder(folder)
                write_pieces(temporary, data)
            os.replace(temporary, path)
    except BaseException:
        with suppress(OSError):
            os.unlink(temporary)
        raise


def write_pieces(path: str, *pieces: bytes | memoryview) -> None:
    """Write a file of these pieces under a name that does not count yet.

    Each piece goes to the disk as it is: a buffer would cost four system calls more than opening, writing and closing.
    """
    with open(path, "wb", buffering=0) as file:
        for piece in pieces:
            left = memoryview(piece)
            while left:
                left = left[file.write(left) :]


def make_folder(path: str | Path) -> None:
    """Make a folder and those above it, where they are missing."""
    try:
        os.mkdir(path)
    except FileExistsError:
        return
    except FileNotFoundError:
        os.makedirs(path, exist_ok=True)


def sync(folder: Path) -> None:
    """Wait until a folder and the files in it are on the disk."""
    for path in (*(p for p in folder.iterdir() if p.is_file()), folder):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def as_yaml(content: object) -> str:
    """Plain values as YAML, in their order."""
    import yaml

    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    return str(yaml.dump(content, Dumper=dumper, sort_keys=False, allow_unicode=True, width=120))


def stamp(path: Path) -> list[int]:
    """What changes when a file does, found without reading it: size, both times, and place on disk.

    The time at which its status changed counts too, which no copy and no ``touch`` can set back.
    """
    status = path.stat()
    return [status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino]


def settled(stamps: Iterable[Sequence[int]]) -> bool:
    """Whether files changed so long ago that another change would have given them another stamp.

    Times of files are as coarse as the kernel's clock tick; a time in the future settles nothing.
    """
    return all(max(times) < time.time_ns() - _SETTLING_NS for _, *times, _ in stamps)


class FileDigests:
    """Content digests of files and folders; a file is read again only when its :func:`stamp` changed.

    Parameters
    ----------
    memory : Path, optional
        File that keeps the digests for the next process.
    """

    def __init__(self, memory: Path | None = None) -> None:
        self._memory = memory
        self._fresh = False
        self._known: dict[str, list[object]] = {}
        with suppress(OSError, ValueError):
            self._known = unsealed(memory.read_bytes()) if memory else {}

    def of(self, path: Path) -> str:
        """Digest of a file's bytes, or of a folder's files by their relative names; hidden files do not count.

        Raises
        ------
        InputError
            There is no such file or folder, or it cannot be read.
        """
        try:
            if path.is_dir():
                return digest({name: self._file(path / name) for name in _files_below(path)})
            return self._file(path)
        except FileNotFoundError:
            raise InputError(f"there is no file or folder {path}", hint=_neighbour(path)) from None
        except OSError as error:
            raise InputError(f"{path} cannot be read: {error.strerror}") from None

    def stamp(self, path: Path) -> str:
        """What changes when a file or any file of a folder does, found without reading them."""
        names = _files_below(path) if path.is_dir() else ["."]
        return digest({name: stamp(path / name) for name in names})

    def remember(self) -> None:
        """Keep the digests for the next process."""
        if self._memory is not None and self._fresh:
            write_text(self._memory, sealed(json.dumps(self._known)))
            self._fresh = False

    def _file(self, path: Path) -> str:
        now = stamp(path)
        key = str(path.resolve())
        known = self._known.get(key)
        if known is not None and known[:-1] == now:
            return str(known[-1])
        lasting = settled([now])
        found = digest_file(path)
        if lasting:
            self._known[key] = [*now, found]
            self._fresh = True
        return found


def _files_below(folder: Path) -> list[str]:
    """Names of the files of a folder and the folders in it, links followed, hidden ones left out."""
    names: list[str] = []
    been: set[Path] = set()
    for place, folders, files in os.walk(folder, followlinks=True):
        here = Path(place)
        folders[:] = sorted(f for f in folders if not f.startswith(".") and (here / f).resolve() not in been)
        been |= {(here / f).resolve() for f in folders}
        relative = here.relative_to(folder)
        names += [(relative / f).as_posix() for f in files if not f.startswith(".") and (here / f).is_file()]
        if len(names) > MOST_FILES:
            raise InputError(f"{folder} holds more than {MOST_FILES} files", expected="a folder of one capture")
    return sorted(names)


def _neighbour(path: Path) -> str:
    parent = path.parent
    return nearest(path.name, (p.name for p in parent.iterdir())) if parent.is_dir() else f"{parent} is missing too"
