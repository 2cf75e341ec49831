"""The far side of a store that lies on an object store: what is made here goes there, what is missing here comes."""

from __future__ import annotations

import shutil
import uuid
from pathlib import Path

from pipeline.errors import InputError

LAST = "meta.json"
"""Written last into a folder, so that a folder which has it is whole."""


class Mirror:
    """A folder on any file system that fsspec knows.

    Parameters
    ----------
    url : str
        Such as ``s3://bucket/results``.

    Raises
    ------
    InputError
        fsspec does not know the protocol, or the package for it is missing.
    """

    def __init__(self, url: str) -> None:
        import fsspec

        try:
            self._files, self._root = fsspec.core.url_to_fs(url)
        except (ValueError, ImportError) as error:
            raise InputError(
                f"the store {url} cannot be opened: {error}",
                where="paths.store",
                expected="a folder, or a URL of a protocol that fsspec knows",
            ) from None
        self.url = url

    def pull_file(self, name: str, target: Path) -> bool:
        """Bring a file, whole or not at all; returns whether it is there."""
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary = target.with_name(f".{uuid.uuid4().hex}")
        try:
            self._files.get_file(self._place(name), str(temporary))
            temporary.replace(target)
        except FileNotFoundError:
            return False
        finally:
            temporary.unlink(missing_ok=True)
        return True

    def pull_folder(self, name: str, target: Path) -> bool:
        """Bring a folder of files, whole or not at all; returns whether it is there and was written to its end."""
        if not self._files.exists(self._place(f"{name}/{LAST}")):
            return False
        temporary = target.parent.parent / f".{uuid.uuid4().hex}"
        try:
            temporary.mkdir(parents=True)
            for path in self._files.ls(self._place(name), detail=False):
                file = str(path).rstrip("/").rpartition("/")[2]
                self._files.get_file(str(path), str(temporary / file))
            target.parent.mkdir(parents=True, exist_ok=True)
            if not target.exists():
                temporary.replace(target)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
        return True

    def push_file(self, source: Path, name: str) -> None:
        """Send a file."""
        self._files.makedirs(self._place(name).rpartition("/")[0], exist_ok=True)
        self._files.put_file(str(source), self._place(name))

    def push_folder(self, source: Path, name: str) -> None:
        """Send a folder of files, the one that makes it whole last; what is there already is not sent again."""
        if self._files.exists(self._place(f"{name}/{LAST}")):
            return
        for path in sorted(source.iterdir(), key=lambda path: path.name == LAST):
            self.push_file(path, f"{name}/{path.name}")

    def remove_folder(self, name: str) -> None:
        """Remove a folder, the file that makes it whole first."""
        for path in (f"{name}/{LAST}", name):
            if self._files.exists(self._place(path)):
                self._files.rm(self._place(path), recursive=True)

    def check(self) -> None:
        """Find out whether it can be written to.

        Raises
        ------
        OSError
            It cannot.
        """
        name = self._place(f".probe-{uuid.uuid4().hex[:8]}")
        self._files.makedirs(self._root, exist_ok=True)
        self._files.pipe_file(name, b"")
        self._files.rm_file(name)

    def _place(self, name: str) -> str:
        return f"{self._root.rstrip('/')}/{name}"
