"""Photographs kept as they are taken, so that a capture that failed goes on where it stopped."""

from __future__ import annotations

import os
import shutil
import uuid
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

from pipeline.storage.artifact import DamagedArtifact, content_of, digest_of, read_artifact, write_artifact
from pipeline.storage.disks import writing
from pipeline.storage.files import sync

T = TypeVar("T")


class Journal:
    """What a capture has taken so far, in a folder.

    Parameters
    ----------
    folder : Path
        One folder below it for each step, named by its number and the digest of its value.
    types : mapping of str to type
        Classes that a step's value may have.
    """

    def __init__(self, folder: Path, types: Mapping[str, type]) -> None:
        self.folder = folder
        self.types = types
        self.recalled = 0

    def step(self, index: int, take: Callable[[], T]) -> T:
        """The value of a step: as it was kept, or taken now and kept; on the disk when this returns."""
        for folder in self.folder.glob(f"{index:04d}-*"):
            try:
                value: T = read_artifact(folder, self.types, artifact=folder.name.partition("-")[2])
            except DamagedArtifact:
                shutil.rmtree(folder, ignore_errors=True)
            else:
                self.recalled += 1
                return value
        value = take()
        description, arrays = content_of(value)
        temporary = self.folder / f".{uuid.uuid4().hex}"
        try:
            with writing(temporary):
                temporary.mkdir(parents=True)
                write_artifact(temporary, description, arrays)
                sync(temporary)
                os.rename(temporary, self.folder / f"{index:04d}-{digest_of(description)}")
                sync(self.folder)
        except BaseException:
            shutil.rmtree(temporary, ignore_errors=True)
            raise
        return value

    def discard(self) -> None:
        """Forget it all: the capture is complete and kept elsewhere."""
        shutil.rmtree(self.folder, ignore_errors=True)
