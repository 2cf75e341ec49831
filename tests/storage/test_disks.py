"""A disk that refuses is named, in the error of the stage or of the command."""

from __future__ import annotations

import errno
import io
import os
from pathlib import Path
from typing import Any

import pytest
from toys import Toys

from pipeline.storage.disks import DiskError, disk_of, writing
from pipeline.storage.files import write_pieces, write_text


def refusing(number: int) -> Any:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    return refuse


def test_a_full_disk_is_named_by_the_stage_that_met_it(toys: Toys, monkeypatch: pytest.MonkeyPatch) -> None:
    toys.run("until=raw")
    with monkeypatch.context() as patch:
        patch.setattr("pipeline.storage.store.write_artifact", refusing(errno.ENOSPC))
        run = toys.run()
    assert {n.name: n.status for n in run.nodes.values()}["big"] == "failed"
    assert f"the disk of {disk_of(toys.folder)} is full (No space left on device; " in run.nodes["big"].error
    assert "Traceback" not in run.nodes["big"].error
    assert toys.ran() == ["big", "cut", "means"]


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (
            errno.ENOSPC,
            r"the disk of \S+ is full \(No space left on device; .* of .* are free\), so that a was not kept",
        ),
        (errno.EDQUOT, r"is full \(Disk quota exceeded"),
        (errno.EROFS, r"a cannot be written: Read-only file system"),
        (errno.EIO, r"a cannot be written: Input/output error"),
    ],
)
def test_what_a_disk_refuses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, words: str) -> None:
    monkeypatch.setattr("os.replace", refusing(number))
    with pytest.raises(DiskError, match=words):
        write_text(tmp_path / "a", "text")
    assert list(tmp_path.iterdir()) == []


def test_what_is_not_the_disks_fault_stays_as_it_is(tmp_path: Path) -> None:
    with pytest.raises(IsADirectoryError, match="Is a directory"), writing(tmp_path):
        tmp_path.open("wb")


def test_a_file_is_whole_though_the_system_takes_it_piece_by_piece(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Slow(io.FileIO):
        def write(self, data: memoryview) -> int:  # type: ignore[override]
            return super().write(data[:7])

    monkeypatch.setattr("builtins.open", lambda path, mode, buffering: Slow(path, mode))
    write_pieces(str(tmp_path / "file"), b"a header, ", b"", memoryview(b"and what follows"))
    assert (tmp_path / "file").read_bytes() == b"a header, and what follows"
