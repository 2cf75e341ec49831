"""Results on disk, by content: what was computed once is found again by anyone who would compute the same.

``objects/`` holds values by the digest of their content, ``recipes/`` says which value came of which stage, code,
settings and inputs. Everything is written under another name and then renamed, so that a killed process leaves nothing
half-written under a name that counts. Locks are per recipe.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
import uuid
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError
from pipeline.storage.artifact import (
    DamagedArtifact,
    content_of,
    digest_of,
    frozen,
    is_whole,
    read_artifact,
    rebuilt,
    write_artifact,
)
from pipeline.storage.disks import writing
from pipeline.storage.files import make_folder, sync, write_text
from pipeline.storage.journal import Journal
from pipeline.storage.keys import digest
from pipeline.storage.locks import locked, shared
from pipeline.storage.record import Record, record_content, record_of
from pipeline.storage.sealed import sealed, unsealed

if TYPE_CHECKING:
    import numpy as np

    from pipeline.storage.mirror import Mirror

REMEMBERED_BYTES = 65_536
"""Values no larger than this are remembered by the process that made them, and not read again."""


@cache
def data_types() -> dict[str, type]:
    """Classes that a stored value may have."""
    import pipeline.data

    modules = [import_module(f"pipeline.data.{found.name}") for found in iter_modules(pipeline.data.__path__)]
    return {
        name: kind
        for module in modules
        for name, kind in vars(module).items()
        if isinstance(kind, type) and kind.__module__ == module.__name__
    }


class Store:
    """A store in a folder; any number of processes may use it at once.

    Parameters
    ----------
    root : Path
        The folder; made when first written to.
    mirror : Mirror, optional
        An object store whose local copy the folder is.
    """

    def __init__(self, root: Path, mirror: Mirror | None = None) -> None:
        self.root = root
        self.mirror = mirror
        self._verified: set[str] = set()
        self._remembered: dict[str, tuple[Mapping[str, Any], Mapping[str, np.ndarray]]] = {}
        self._provenance: dict[str, Mapping[str, Any]] = {}

    @classmethod
    def at(cls, location: str | Path) -> Store:
        """The store in a folder, or at a URL such as ``s3://bucket/results``, which is copied below the user's cache.

        Raises
        ------
        InputError
            The URL cannot be opened.
        """
        if "://" not in str(location):
            return cls(Path(location))
        from pipeline.storage.mirror import Mirror

        cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        return cls(cache / "optibench" / digest(str(location))[:16], Mirror(str(location)))

    @property
    def location(self) -> str:
        """Where it is, for others: the folder's full path, or the URL."""
        return self.mirror.url if self.mirror else str(self.root.absolute())

    @property
    def memory(self) -> Path:
        """Folder for what can be lost: parsed sources, digests of files."""
        return self.root / "memory"

    def check_writable(self) -> None:
        """Find out before work starts whether results can be kept.

        Raises
        ------
        InputError
            The folder cannot be made or written to.
        """
        probe = self.root / f".probe-{uuid.uuid4().hex[:8]}"
        try:
            self.root.mkdir(parents=True, exist_ok=True)
            probe.touch()
            probe.unlink()
            if self.mirror:
                self.mirror.check()
        except OSError as error:
            raise InputError(
                f"the store {self.location} cannot be written to: {error.strerror or error}",
                where="paths.store",
                expected="a folder on a disk that can be written to",
                hint="paths.store=DIR paths.runs=DIR put results elsewhere",
            ) from None

    def object_folder(self, artifact: str) -> Path:
        """Folder of a value."""
        return self.root / _object_name(artifact)

    def recipe_file(self, key: str) -> Path:
        """File of a recipe."""
        return self.root / _recipe_name(key)

    def provenance_file(self, name: str) -> Path:
        """File of what many records share."""
        return self.root / "provenance" / f"{name}.json"

    def find(self, key: str) -> Record | None:
        """The record of a recipe whose value is there whole, or None."""
        record = self.record(key)
        return record if record is not None and self._is_here(record.artifact) else None

    def _is_here(self, artifact: str) -> bool:
        """Whether a value lies here whole, now that it was brought if it could be."""
        folder = self.object_folder(artifact)
        if is_whole(folder):
            return True
        if self.mirror is None:
            return False
        if folder.exists():
            self.set_aside(artifact)
        return self.mirror.pull_folder(_object_name(artifact), folder) and is_whole(folder)

    def record(self, key: str) -> Record | None:
        """The record of a recipe, whether or not its value is still there; None where there is none."""
        path = self.recipe_file(key)
        if self.mirror and not path.is_file():
            self.mirror.pull_file(_recipe_name(key), path)
        try:
            return record_of(unsealed(path.read_bytes()), key)
        except (OSError, ValueError):
            return None

    def put(self, value: object, *, durable: bool = False) -> str:
        """Keep a value and return the digest of its content; ``durable`` waits until it is on the disk."""
        description, arrays = content_of(value)
        artifact = digest_of(description)
        target = self.object_folder(artifact)
        if os.path.isdir(target) and is_whole(target):
            self._push(artifact)
            return artifact
        temporary = f"{self.root}/objects/.{uuid.uuid4().hex}"
        try:
            with writing(temporary):
                make_folder(temporary)
                write_artifact(temporary, description, arrays)
                if durable:
                    sync(Path(temporary))
                self._name(temporary, artifact)
                if durable:
                    sync(target.parent)
        except BaseException:
            shutil.rmtree(temporary, ignore_errors=True)
            raise
        self._push(artifact)
        self._verified.add(artifact)
        if sum(array.nbytes for array in arrays.values()) <= REMEMBERED_BYTES:
            self._remembered[artifact] = description, frozen(arrays)
        return artifact

    def _name(self, temporary: str, artifact: str) -> None:
        """Give a value written whole its name, unless another process was faster."""
        target = self.object_folder(artifact)
        while True:
            try:
                os.rename(temporary, target)
            except FileNotFoundError:
                if not os.path.exists(temporary):
                    raise
                make_folder(target.parent)
            except OSError as error:
                if error.errno not in {errno.ENOTEMPTY, errno.EEXIST}:
                    raise
                if is_whole(target):
                    shutil.rmtree(temporary, ignore_errors=True)
                    return
                self.set_aside(artifact)
            else:
                return

    def _push(self, artifact: str) -> None:
        if self.mirror:
            self.mirror.push_folder(self.object_folder(artifact), _object_name(artifact))

    def journal(self, key: str) -> Journal:
        """Where a capture keeps what it has taken until it is complete."""
        return Journal(self.root / "captures" / key, data_types())

    def keep(self, record: Record) -> None:
        """Keep the record of a recipe whose value has been put."""
        write_text(self.recipe_file(record.key), sealed(json.dumps(record_content(record))))
        if self.mirror:
            self.mirror.push_file(self.recipe_file(record.key), _recipe_name(record.key))

    def keep_provenance(self, content: Mapping[str, Any], name: str = "") -> str:
        """Keep what many records share, such as a listing of code, and return its digest: ``name``, where known."""
        name = name or digest(content)
        if name not in self._provenance:
            path = self.provenance_file(name)
            if not self.provenance(name):
                write_text(path, json.dumps(content, indent=1))
            if self.mirror:
                self.mirror.push_file(path, f"provenance/{name}.json")
            self._provenance[name] = content
        return name

    def provenance(self, name: str) -> Mapping[str, Any]:
        """What was kept under that digest; empty where it is lost."""
        if name not in self._provenance:
            path = self.provenance_file(name)
            if self.mirror and name and not path.is_file():
                self.mirror.pull_file(f"provenance/{name}.json", path)
            try:
                content = json.loads(path.read_bytes())
                self._provenance[name] = content if digest(content) == name else {}
            except (OSError, ValueError, InputError):
                return {}
        return self._provenance[name]

    def get(self, artifact: str) -> Any:
        """The value of that digest, memory-mapped; checked against its digests when this store first reads it.

        Raises
        ------
        DamagedArtifact
            It is not what it was; it has been set aside, and the next run computes it again.
        """
        if artifact in self._remembered:
            description, arrays = self._remembered[artifact]
            return rebuilt(description, data_types(), arrays)
        if self.mirror:
            self._is_here(artifact)
        try:
            expected = None if artifact in self._verified else artifact
            value = read_artifact(self.object_folder(artifact), data_types(), artifact=expected)
        except DamagedArtifact:
            self.set_aside(artifact)
            raise
        self._verified.add(artifact)
        return value

    def sound(self, artifact: str) -> bool:
        """Whether a value can be read and is what its digest says; sets it aside where not."""
        try:
            self.get(artifact)
        except DamagedArtifact:
            return False
        return True

    def set_aside(self, artifact: str) -> None:
        """Move a damaged value out of the way, to ``damaged/``, for whoever wants to look into it."""
        self._verified.discard(artifact)
        self._remembered.pop(artifact, None)
        folder = self.object_folder(artifact)
        if self.mirror:
            self.mirror.remove_folder(_object_name(artifact))
        if folder.exists():
            target = self.root / "damaged" / f"{artifact}-{uuid.uuid4().hex[:8]}"
            target.parent.mkdir(parents=True, exist_ok=True)
            os.rename(folder, target)

    @contextmanager
    def lock(self, key: str) -> Iterator[None]:
        """Only one process at a time works on a recipe; the lock ends with the process that holds it."""
        with locked(f"{self.root}/locks", key):
            yield

    @contextmanager
    def in_use(self) -> Iterator[None]:
        """Keep :mod:`pipeline.commands.clean` away while results are looked up and made; any number may."""
        with ExitStack() as held:
            if self.root.is_dir():
                with suppress(OSError):
                    held.enter_context(shared(self.root / "in-use"))
            yield

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return _store_of_this_process, (self.location,)


@cache
def _store_of_this_process(location: str) -> Store:
    """One store a process, so that what one task has read and checked need not be again by the next."""
    return Store.at(location)


def _object_name(artifact: str) -> str:
    return f"objects/{artifact[:2]}/{artifact}"


def _recipe_name(key: str) -> str:
    return f"recipes/{key[:2]}/{key}.json"
