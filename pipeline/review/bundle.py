"""A run in one file, for people who were not there: what came out, what it was made of, and what made it."""

from __future__ import annotations

import json
import os
import re
import subprocess
import uuid
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any

from pipeline.codebase.source import Sources, companions
from pipeline.errors import InputError
from pipeline.execution.provenance import CHANGED
from pipeline.graph.config import LOCAL_SECTIONS
from pipeline.review.crate import METADATA, crate_metadata
from pipeline.review.unpack import CONFIG, STORE, SUSPICIOUS_BYTES
from pipeline.review.untrusted import read_value
from pipeline.runs import MANIFEST, Run
from pipeline.storage.artifact import DamagedArtifact
from pipeline.storage.files import as_yaml
from pipeline.storage.forms import plain_yaml, read_json
from pipeline.storage.keys import digest_bytes
from pipeline.storage.record import Record, record_content
from pipeline.storage.sealed import sealed
from pipeline.storage.store import Store

Contents = dict[str, bytes | Path]
"""Files of a bundle by name: their bytes, or where to read them."""

_LEVEL = 1
_MOST_SHRINKING = 100
"""Large arrays that shrink more than this are stored as they are, so that nobody takes them for a trap."""

_README = """\
This is a run of the experiment {name}, bundled by optibench as an RO-Crate 1.1.

Verify it (recompute every stage, and compare each value with the one in here):

    python -m pipeline verify BUNDLE.zip

Rerun it, all of it or changed (what a change does not touch is taken from in here):

    python -m pipeline run BUNDLE.zip
    python -m pipeline run BUNDLE.zip graph.NODE.SETTING=VALUE

where BUNDLE.zip is this file. Both need optibench {version}{commit};
environment.json lists what was installed beside it.

report.html        what came out, to read
outputs/           pictures, maps and tables
config.yaml        the experiment, resolved
manifest.json      what every node is, gave and took
store/objects/     the values: one folder a value, named by the digest of its content; .npy files and meta.json
store/recipes/     which stage, code, settings and inputs gave which value
store/provenance/  digests of the modules of code, and versions of the libraries
source/            the code of the stages and of all that they import, to read; it is never run from here
environment.json   Python, platform, versions, commit

{missing}"""


def write_bundle(run: Run, file: Path) -> Path:
    """Write a run as one zip file; the same run gives the same bytes.

    Parameters
    ----------
    run : Run
        The run; stages that failed are part of it.
    file : Path
        A file that is not there yet.

    Raises
    ------
    InputError
        The file is there already or cannot be written, or a value of the run is lost or damaged.
    """
    if file.exists():
        raise InputError(f"there is a file {file} already", expected="a name that is free")
    manifest = portable_manifest(read_json(run.path / MANIFEST))
    contents = _contents(run, manifest)
    contents[METADATA] = crate_metadata(run, contents, manifest["command"])
    temporary = file.with_name(f".{file.name}.{uuid.uuid4().hex[:8]}")
    try:
        with zipfile.ZipFile(temporary, "x", compresslevel=_LEVEL) as bundle:
            for name in sorted(contents):
                _add(bundle, name, contents[name])
        os.replace(temporary, file)
    except OSError as error:
        raise InputError(f"{file} cannot be written: {error.strerror}") from None
    finally:
        temporary.unlink(missing_ok=True)
    return file


def _contents(run: Run, manifest: Mapping[str, Any]) -> Contents:
    contents: Contents = {}
    records = [r for node in run.nodes.values() if node.key and (r := run.store.record(node.key)) is not None]
    for node in run.nodes.values():
        if node.artifact:
            contents |= _value(run, node.name, node.artifact)
    for record in records:
        name = Store(Path(STORE)).recipe_file(record.key)
        contents[name.as_posix()] = sealed(json.dumps(record_content(record))).encode()
    for listing in sorted({d for r in records for d in (r.code, r.versions)} | {run.environment}):
        if content := run.store.provenance(listing):
            contents[Store(Path(STORE)).provenance_file(listing).as_posix()] = json.dumps(content, indent=1).encode()
    contents[MANIFEST] = sealed(json.dumps(manifest, indent=1)).encode()
    contents[CONFIG] = as_yaml(_shared(plain_yaml(run.config_yaml, run.path / CONFIG))).encode()
    contents["environment.json"] = json.dumps(_environment(run), indent=1).encode()
    if run.report.is_file():
        contents["report.html"] = run.report
    for path in sorted((run.path / "outputs").rglob("*")):
        relative = path.relative_to(run.path)
        if path.is_file() and not any(part.startswith(".") for part in relative.parts):
            contents[relative.as_posix()] = path
    sources, missing = _sources(run, records)
    contents |= sources
    note = "The code has changed since the run; not in here any more: " + ", ".join(missing) + "\n" if missing else ""
    commit = f", commit {run.commit}" if run.commit else ""
    version = run.versions.get("optibench", "")
    text = _README.format(name=run.name, version=version, commit=commit, missing=note)
    contents["README.txt"] = (text.rstrip() + "\n").encode()
    return contents


def _value(run: Run, node: str, artifact: str) -> Contents:
    folder = run.store.object_folder(artifact)
    try:
        read_value(folder, artifact)
    except DamagedArtifact as error:
        raise InputError(
            f"the value of node '{node}' is lost or damaged: {error}",
            where=str(run.path),
            hint=f"run again to compute it anew: {run.command}",
        ) from None
    place = Store(Path(STORE)).object_folder(artifact)
    return {(place / path.name).as_posix(): path for path in folder.iterdir()}


def portable_manifest(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """A manifest without what is of the machine that it was written on: its store, its folders, who computed it."""
    words = [w for w in manifest["overrides"] if w.lstrip("+~").split("=")[0].split(".")[0] not in LOCAL_SECTIONS]
    command = ["python -m pipeline", *(f"+{w}" if w.startswith("experiment=") else w for w in words)]
    return {
        **manifest,
        "store": STORE,
        "store_from_here": STORE,
        "claims": "",
        "overrides": without_places(words),
        "command": " ".join(without_places(command)),
        "raw": _shared(manifest.get("raw", {})),
        "nodes": [{**node, "settings": without_places(node["settings"])} for node in manifest["nodes"]],
    }


def without_places(value: Any) -> Any:
    """Plain values with absolute paths reduced to the names of what they lead to."""
    if isinstance(value, Mapping):
        return {name: without_places(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [without_places(item) for item in value]
    if isinstance(value, str):
        name, equals, path = value.rpartition("=")
        return f"{name}{equals}{Path(path).name}" if Path(path).is_absolute() else value
    return value


def _shared(content: Mapping[str, Any]) -> Any:
    return without_places({name: item for name, item in content.items() if name not in LOCAL_SECTIONS})


def _environment(run: Run) -> dict[str, Any]:
    known = run.store.provenance(run.environment) or {"distributions": dict(run.versions)}
    return {**known, "commit": run.commit.removesuffix(CHANGED), "local_changes": run.commit.endswith(CHANGED)}


def _sources(run: Run, records: list[Record]) -> tuple[Contents, list[str]]:
    """Files of the modules that the stages stood on, and the names of those that cannot be found as they were."""
    sources = Sources()
    found: Contents = {}
    missing = []
    wanted = {
        (name, code, text): record.commit or run.commit
        for record in records
        for name, (code, text) in run.store.provenance(record.code).items()
    }
    for (name, code, text), commit in sorted(wanted.items()):
        module = sources.module(name)
        lines = None if module is None else _as_it_was(module.path, text, commit)
        if module is None or lines is None:
            missing.append(name)
            continue
        base = Path("source", *name.split("."))
        place = base / "__init__.py" if module.path.name == "__init__.py" else base.with_name(base.name + ".py")
        found[place.as_posix()] = lines
        if module.code_digest == code:
            found |= {place.with_name(path.name).as_posix(): path for path in companions(module.path)}
    return found, missing


def _as_it_was(path: Path, text: str, commit: str) -> bytes | None:
    """The file whose text has that digest: as it lies there, or out of its history."""
    lines = path.read_bytes()
    commit = commit.removesuffix(CHANGED)
    if digest_bytes(lines) == text:
        return lines
    if not re.fullmatch("[0-9a-f]{40}", commit):
        return None
    try:
        command = ["git", "show", f"{commit}:./{path.name}"]
        lines = subprocess.run(command, cwd=path.parent, capture_output=True, timeout=10, check=True).stdout
    except (OSError, subprocess.SubprocessError):
        return None
    return lines if digest_bytes(lines) == text else None


def _add(bundle: zipfile.ZipFile, name: str, content: bytes | Path) -> None:
    """Add a file under a fixed time, so that the bundle does not depend on when it was written."""
    size = content.stat().st_size if isinstance(content, Path) else len(content)
    stored = size > SUSPICIOUS_BYTES and size > _MOST_SHRINKING * sum(map(len, _deflated(content)))
    bundle.compression = zipfile.ZIP_STORED if stored else zipfile.ZIP_DEFLATED
    with bundle.open(name, "w", force_zip64=size >= 2**31 - 2**20) as entry:
        for piece in _pieces(content):
            entry.write(piece)


def _pieces(content: bytes | Path) -> Iterator[bytes]:
    if isinstance(content, bytes):
        yield content
        return
    file: IO[bytes]
    with content.open("rb") as file:
        while piece := file.read(1 << 20):
            yield piece


def _deflated(content: bytes | Path) -> Iterator[bytes]:
    packer = zlib.compressobj(_LEVEL)
    for piece in _pieces(content):
        yield packer.compress(piece)
    yield packer.flush()
