"""Locks between processes that the kernel frees when their holder dies."""

from __future__ import annotations

import fcntl
import hashlib
import os
import struct
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_RANGES = hasattr(fcntl, "F_OFD_SETLKW") and sys.platform == "linux" and sys.maxsize > 2**32


@contextmanager
def locked(folder: str | Path, name: str) -> Iterator[None]:
    """Hold a lock of that name, which no other thread or process can hold at the same time.

    The names share one file, of which each locks a byte of its own: a file made and removed for each would slow down
    whoever makes files afterwards, since ext4 passes over what was removed just now. Other systems than Linux have
    only locks of whole files that threads do not share.
    """
    with _byte(f"{folder}/names", name) if _RANGES else _file(Path(folder, name)):
        yield


@contextmanager
def _byte(path: str, name: str) -> Iterator[None]:
    place = int.from_bytes(hashlib.sha256(name.encode()).digest()[:7], "big")
    descriptor = _opened(path)
    try:
        fcntl.fcntl(descriptor, fcntl.F_OFD_SETLKW, struct.pack("hhqqi4x", fcntl.F_WRLCK, os.SEEK_SET, place, 1, 0))
        yield
    finally:
        os.close(descriptor)


@contextmanager
def _file(path: Path) -> Iterator[None]:
    while True:
        descriptor = _opened(path)
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        if _still_named(descriptor, path):
            break
        os.close(descriptor)
    try:
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(descriptor)


@contextmanager
def shared(path: Path) -> Iterator[None]:
    """Hold a lock that others may share, but that keeps :func:`alone` out."""
    descriptor = _opened(path)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH)
        yield
    finally:
        os.close(descriptor)


@contextmanager
def alone(path: Path, *, wait: bool = True) -> Iterator[None]:
    """Hold a lock that keeps everybody out.

    Raises
    ------
    BlockingIOError
        ``wait`` is false and somebody holds it.
    """
    descriptor = _opened(path)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        yield
    finally:
        os.close(descriptor)


def _opened(path: str | Path) -> int:
    """A descriptor of the lock's file, which is made where it is missing."""
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except FileNotFoundError:
        os.makedirs(os.path.dirname(path), exist_ok=True)
        return os.open(path, os.O_RDWR | os.O_CREAT, 0o666)


def _still_named(descriptor: int, path: Path) -> bool:
    """Whether the locked file is the one that lies there; its last holder may have removed it meanwhile."""
    try:
        return os.fstat(descriptor).st_ino == path.stat().st_ino
    except FileNotFoundError:
        return False
