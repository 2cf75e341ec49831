"""Opening a bundle that somebody else made: all of it is looked at before any of it is written, and nothing is run."""

from __future__ import annotations

import os
import re
import shutil
import stat
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from pipeline.errors import InputError
from pipeline.review.untrusted import read_value
from pipeline.runs import MANIFEST, Run, open_run
from pipeline.storage.artifact import DamagedArtifact
from pipeline.storage.forms import check_manifest, check_record, read_json
from pipeline.storage.keys import digest
from pipeline.storage.store import Store

CONFIG = "config.yaml"
STORE = "store"

SUSPICIOUS_BYTES = 64 * 2**20
"""From this size on an entry's ratio of compression counts; a small mask of one value shrinks a thousandfold."""

MOST_DIRECTORY_BYTES = 64 * 2**20
MOST_RECORD_BYTES = 4 * 2**20

_NEEDED = re.compile(
    rf"{MANIFEST}|{CONFIG}"
    rf"|{STORE}/objects/[0-9a-f]{{2}}/[0-9a-f]{{40}}/(meta\.json|[\w.]{{1,200}}\.npy)"
    rf"|{STORE}/recipes/[0-9a-f]{{2}}/[0-9a-f]{{40}}\.json"
    rf"|{STORE}/provenance/[0-9a-f]{{40}}\.json",
    re.ASCII,
)
_COMPRESSIONS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_PIECE = 1 << 20
_END, _LOCATOR = 22, 20


@dataclass(frozen=True)
class Limits:
    """How large a bundle may be.

    Attributes
    ----------
    total_bytes : int
        All that it unpacks to.
    entries : int
        Files in it.
    ratio : int
        How many times larger than in the bundle an entry of some size may be.
    """

    total_bytes: int = 20 * 10**9
    entries: int = 100_000
    ratio: int = 200


@contextmanager
def opened(path: Path, limits: Limits | None = None) -> Iterator[Run]:
    """A run in a folder, or one in a bundle, unpacked for as long as the block lasts.

    Raises
    ------
    InputError
        There is no run, or the bundle is not what a bundle should be.
    """
    if path.is_dir() or not path.exists():
        yield open_run(path)
        return
    with tempfile.TemporaryDirectory(prefix="optibench-") as folder:
        unpack(path, Path(folder) / "run", limits or Limits())
        yield open_run(Path(folder) / "run")


def unpack(file: Path, folder: Path, limits: Limits) -> None:
    """Unpack what makes up a run into a new folder: manifest, configuration, values and records, all of them checked.

    What a bundle holds besides, for people to read, stays in it.

    Raises
    ------
    InputError
        The file is no bundle, or holds what no bundle of ours would: then the folder is not there.
    """
    try:
        with file.open("rb") as raw:
            _check_directory(raw, file)
            with zipfile.ZipFile(raw) as bundle:
                wanted = _checked(bundle, file, limits)
                folder.mkdir(parents=True)
                try:
                    _extract(bundle, wanted, folder, limits)
                    _check_run(folder, file)
                except BaseException as error:
                    shutil.rmtree(folder, ignore_errors=True)
                    if isinstance(error, InputError):
                        raise _without(folder, error, file) from None
                    raise
    except (zipfile.BadZipFile, zlib.error, EOFError, struct.error, NotImplementedError, RuntimeError) as error:
        raise InputError(f"{file} is no bundle that can be read: {error}", expected="what `bundle` writes") from None
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror or error}") from None


def _refused(file: Path, name: str, why: str) -> InputError:
    return InputError(f"{why}: {name!r}", where=str(file), expected="a bundle as `bundle` writes it")


def _check_directory(raw: BinaryIO, file: Path) -> None:
    """Refuse a directory so long that reading it would fill the memory."""
    size = raw.seek(0, os.SEEK_END)
    raw.seek(max(0, size - _END - 0xFFFF - _LOCATOR))
    tail = raw.read()
    place = tail.rfind(b"PK\x05\x06")
    if place < 0 or place + _END > len(tail):
        raise InputError(f"{file} is no zip file", expected="a bundle as `bundle` writes it")
    length = struct.unpack_from("<I", tail, place + 12)[0]
    locator = tail[max(0, place - _LOCATOR) : place]
    if locator.startswith(b"PK\x06\x07"):
        raw.seek(min(struct.unpack_from("<Q", locator, 8)[0], size))
        length = struct.unpack_from("<Q", raw.read(56), 40)[0]
    if length > MOST_DIRECTORY_BYTES:
        raise InputError(f"the directory of {file} has {length} bytes", expected=f"at most {MOST_DIRECTORY_BYTES}")


def _checked(bundle: zipfile.ZipFile, file: Path, limits: Limits) -> list[zipfile.ZipInfo]:
    """The entries to unpack, once every entry is known to be harmless."""
    entries = bundle.infolist()
    if len(entries) > limits.entries:
        raise InputError(f"{file} has {len(entries)} entries", expected=f"at most {limits.entries}")
    total = sum(entry.file_size for entry in entries)
    if total > limits.total_bytes:
        raise InputError(
            f"{file} would unpack to {total / 1e9:.3g} GB",
            expected=f"at most {limits.total_bytes / 1e9:.3g} GB",
            hint="--limit-gb=N allows more, if you trust where it comes from",
        )
    seen: set[str] = set()
    for entry in entries:
        _check_entry(entry, file, limits)
        if entry.filename.rstrip("/").casefold() in seen:
            raise _refused(file, entry.filename, "it names a file twice")
        seen.add(entry.filename.rstrip("/").casefold())
    _check_overlaps(entries, file)
    for needed in (MANIFEST, CONFIG):
        if needed not in bundle.namelist():
            raise InputError(f"{file} holds no {needed}", expected="a bundle as `bundle` writes it")
    wanted = [entry for entry in entries if _NEEDED.fullmatch(entry.filename)]
    for entry in entries:
        inside = entry.filename.startswith(f"{STORE}/") and not entry.is_dir()
        if inside and not _NEEDED.fullmatch(entry.filename):
            raise _refused(file, entry.filename, "it has a file in its store that no store has")
    return wanted


def _check_entry(entry: zipfile.ZipInfo, file: Path, limits: Limits) -> None:
    name = entry.orig_filename
    parts = name.removesuffix("/").split("/")
    if name.startswith("/") or "\\" in name or re.match(r"[A-Za-z]:", name):
        raise _refused(file, name, "it names a place outside itself")
    if any(part in {"", ".", ".."} for part in parts):
        raise _refused(file, name, "it names a place outside itself")
    if not name.isprintable() or name != entry.filename or any(len(part.encode()) > 255 for part in parts):
        raise _refused(file, name, "it has a name that no file of ours has")
    kind = stat.S_IFMT(entry.external_attr >> 16)
    if kind not in {0, stat.S_IFDIR if entry.is_dir() else stat.S_IFREG}:
        raise _refused(file, name, "it holds a link or a special file")
    if entry.flag_bits & 0x1 or entry.flag_bits & 0x40:
        raise _refused(file, name, "it holds an encrypted file")
    if entry.compress_type not in _COMPRESSIONS:
        raise _refused(file, name, "it is compressed in a way that ours are not")
    if entry.file_size > SUSPICIOUS_BYTES and entry.file_size > limits.ratio * max(entry.compress_size, 1):
        raise _refused(file, name, f"it holds a file that unpacks to more than {limits.ratio} times its size")


def _check_overlaps(entries: list[zipfile.ZipInfo], file: Path) -> None:
    """Refuse entries that share their bytes, by which a small file can hold a large one many times."""
    end, before = 0, ""
    for entry in sorted(entries, key=lambda entry: entry.header_offset):
        if entry.header_offset < end:
            raise _refused(file, entry.filename, f"it shares its bytes with {before!r}")
        end = entry.header_offset + 30 + len(entry.orig_filename.encode()) + entry.compress_size
        before = entry.filename


def _extract(bundle: zipfile.ZipFile, entries: list[zipfile.ZipInfo], folder: Path, limits: Limits) -> None:
    left = limits.total_bytes
    for entry in entries:
        target = folder / entry.filename
        target.parent.mkdir(parents=True, exist_ok=True)
        with bundle.open(entry) as packed, target.open("xb") as plain:
            while piece := packed.read(_PIECE):
                left -= len(piece)
                if left < 0:
                    raise InputError(f"the bundle unpacks to more than {limits.total_bytes / 1e9:.3g} GB")
                plain.write(piece)


def _check_run(folder: Path, file: Path) -> None:
    """Refuse values that are not what their names say, and records and listings that are none."""
    manifest = read_json(folder / MANIFEST)
    check_manifest(manifest, f"{file}: {MANIFEST}")
    for name, expected in (("store", STORE), ("store_from_here", STORE), ("claims", "")):
        if manifest.get(name, expected) != expected:
            raise _refused(file, manifest[name], "its manifest looks for values elsewhere")
    store = Store(folder / STORE)
    classes: dict[str, str] = {}
    for place in sorted((folder / STORE / "objects").glob("*/*")):
        try:
            if store.object_folder(place.name) != place:
                raise DamagedArtifact(f"{place} lies in the wrong folder")
            classes[place.name] = type(read_value(place, place.name)).__name__
        except DamagedArtifact as error:
            raise InputError(f"a value in it is damaged or forged: {error}", where=str(file)) from None
    for node in manifest["nodes"]:
        if node["artifact"] and node["artifact"] not in classes:
            raise _refused(file, node["name"], "it lacks the value of a node")
    for path in sorted((folder / STORE / "recipes").glob("*/*.json")):
        record = read_json(path, MOST_RECORD_BYTES)
        check_record(record, f"{file}: {path.relative_to(folder)}")
        if record["key"] != path.stem or store.recipe_file(path.stem) != path or store.record(path.stem) is None:
            raise _refused(file, path.name, "it holds a record that is not the one of its name")
        if record["type"] != classes.get(record["artifact"]):
            raise _refused(file, path.name, "it holds a record of a value that it lacks, or that is of another type")
    for path in sorted((folder / STORE / "provenance").glob("*.json")):
        content = read_json(path, MOST_RECORD_BYTES)
        if digest(content) != path.stem:
            raise _refused(file, path.name, "it holds a listing that is not the one of its name")


def _without(folder: Path, error: InputError, file: Path) -> InputError:
    """An error that names the bundle instead of the folder that is gone."""
    what, where = (text.replace(f"{folder}/", "").replace(str(folder), str(file)) for text in (error.what, error.where))
    return InputError(what, where=where or str(file), expected=error.expected, hint=error.hint)
