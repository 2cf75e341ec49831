"""Results on disk, by content: what was computed once is found again by anyone who would compute the same.

``objects/`` holds values by the digest of their content, ``recipes/`` says which value came of which stage, code,
settings and inputs. Everything is written under another name and then renamed, so that a killed process leaves nothing
half-written under a name that counts. Locks are per recipe.
"""

from __future__ import annotations

import json
import os
import shutil
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from pipeline.artifact import (
    DamagedArtifact,
    content_of,
    digest_of,
    is_whole,
    read_artifact,
    read_description,
    write_artifact,
)
from pipeline.errors import InputError
from pipeline.files import write_text

FORMAT = 1


@dataclass(frozen=True)
class Record:
    """What is known of one result: the artifact, what it was made of, and what making it took.

    Attributes
    ----------
    key : str
        Digest of the recipe.
    artifact : str
        Digest of the value.
    type : str
        Name of the value's class.
    stage : str
        Name of the stage.
    code : dict of str to (str, str)
        Per module: digest of its code, and digest of its text with comments and docstrings.
    settings : dict
        Settings as they entered the key.
    inputs : dict
        Per parameter, the digests of the values that went in.
    seconds, cpu_seconds, peak_mb : float
        Wall time, CPU time of the stage's own threads, and the process' peak memory while it ran.
    host, finished, commit : str
        Where, when (ISO, UTC) and from which commit.
    versions : dict of str to str
        Versions of the libraries at hand.
    warnings, notes : tuple of str
        What the stage said.
    """

    key: str
    artifact: str
    type: str
    stage: str
    code: Mapping[str, tuple[str, str]]
    settings: Mapping[str, Any]
    inputs: Mapping[str, Any]
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    peak_mb: float = 0.0
    host: str = ""
    finished: str = ""
    commit: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def data_types() -> dict[str, type]:
    """Classes that a stored value may have."""
    import inspect

    import pipeline.data

    return {
        name: kind
        for name, kind in inspect.getmembers(pipeline.data, inspect.isclass)
        if kind.__module__ == pipeline.data.__name__
    }


class Store:
    """A store in a folder; any number of processes may use it at once.

    Parameters
    ----------
    root : Path
        The folder; made when first written to.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self._verified: set[str] = set()

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
        except OSError as error:
            raise InputError(
                f"the store {self.root} cannot be written to: {error.strerror}",
                where="paths.store",
                expected="a folder on a disk that can be written to",
                hint="paths.store=DIR paths.runs=DIR put results elsewhere",
            ) from None

    def object_folder(self, artifact: str) -> Path:
        """Folder of a value."""
        return self.root / "objects" / artifact[:2] / artifact

    def recipe_file(self, key: str) -> Path:
        """File of a recipe."""
        return self.root / "recipes" / key[:2] / f"{key}.json"

    def find(self, key: str) -> Record | None:
        """The record of a recipe whose value is there whole, or None."""
        record = self.record(key)
        if record is None or not is_whole(self.object_folder(record.artifact)):
            return None
        return record

    def record(self, key: str) -> Record | None:
        """The record of a recipe, whether or not its value is still there; None where there is none."""
        try:
            content = json.loads(self.recipe_file(key).read_text())
            if content.pop("format") != FORMAT or content["key"] != key:
                return None
            content["code"] = {name: tuple(pair) for name, pair in content["code"].items()}
            content["warnings"] = tuple(content["warnings"])
            content["notes"] = tuple(content["notes"])
            return Record(**content)
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return None

    def put(self, value: object, *, sync: bool = False) -> str:
        """Keep a value and return the digest of its content; ``sync`` waits until it is on the disk."""
        description, arrays = content_of(value)
        artifact = digest_of(description)
        target = self.object_folder(artifact)
        if is_whole(target):
            return artifact
        temporary = self.root / "objects" / f".{uuid.uuid4().hex}"
        temporary.mkdir(parents=True)
        try:
            write_artifact(temporary, description, arrays)
            if sync:
                _sync(temporary)
            target.parent.mkdir(exist_ok=True)
            if target.exists():
                self.set_aside(artifact)
            try:
                os.rename(temporary, target)
            except OSError:
                if not is_whole(target):
                    raise
            if sync:
                _sync(target.parent)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
        self._verified.add(artifact)
        return artifact

    def keep(self, record: Record) -> None:
        """Keep the record of a recipe whose value has been put."""
        text = json.dumps({"format": FORMAT, **asdict(record)}, indent=1)
        write_text(self.recipe_file(record.key), text)

    def get(self, artifact: str) -> Any:
        """The value of that digest, memory-mapped; checked against its digests when this store first reads it.

        Raises
        ------
        DamagedArtifact
            It is not what it was; it has been set aside, and the next run computes it again.
        """
        try:
            value = read_artifact(self.object_folder(artifact), data_types(), verify=artifact not in self._verified)
            if artifact not in self._verified and digest_of(read_description(self.object_folder(artifact))) != artifact:
                raise DamagedArtifact(f"{self.object_folder(artifact)} is not the value of its name")
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
        folder = self.object_folder(artifact)
        if folder.exists():
            target = self.root / "damaged" / f"{artifact}-{uuid.uuid4().hex[:8]}"
            target.parent.mkdir(parents=True, exist_ok=True)
            os.rename(folder, target)

    @contextmanager
    def lock(self, key: str) -> Iterator[None]:
        """Only one process at a time works on a recipe; the lock ends with the process that holds it."""
        from filelock import FileLock

        folder = self.root / "locks"
        folder.mkdir(parents=True, exist_ok=True)
        with FileLock(folder / f"{key}.lock"):
            yield


def _sync(folder: Path) -> None:
    for path in (*(p for p in folder.iterdir() if p.is_file()), folder):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
