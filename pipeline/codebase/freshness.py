"""Code in memory against code on disk: a process that goes on after an edit must not run what it imported before."""

from __future__ import annotations

import marshal
import os
import struct
import sys
import time
from collections.abc import Iterable
from importlib.util import MAGIC_NUMBER, cache_from_source
from pathlib import Path

from pipeline.codebase.source import ROOT, Code, Sources
from pipeline.errors import InputError, PipelineError
from pipeline.storage.files import stamp

_STARTED_NS = time.time_ns()
_seen: dict[str, str] = {}
"""Digest of each module's code when this process first meant to run it."""

_MAY_CHANGE = (f"{ROOT}.stages.", f"{ROOT}.optics.", f"{ROOT}.devices.")


def bring_up_to_date(codes: Iterable[Code], sources: Sources) -> None:
    """Forget imported modules whose code changed since, and those that import them, so that they are imported anew.

    Raises
    ------
    InputError
        A module changed on which the bench itself stands.
    """
    digests = {name: code for one in codes for name, (code, _) in one.modules.items()}
    changed = set()
    for name, code in digests.items():
        compiled_of_another = _drop_outdated(sources.file_of(name))
        if name not in sys.modules:
            _seen[name] = code
        elif name not in _seen:
            _seen[name] = code
            if compiled_of_another or _edited_since_start(name, sources):
                changed.add(name)
        elif _seen[name] != code:
            changed.add(name)
    fixed = sorted(name for name in changed if name.startswith(f"{ROOT}.") and not name.startswith(_MAY_CHANGE))
    if fixed:
        raise InputError(
            f"the code of {', '.join(fixed)} changed since this process imported it",
            expected="a new process: restart Python, or the notebook's kernel",
        )
    stale = {name for name in digests if changed and changed & set(sources.closure([name]))}
    for name in stale:
        module = sys.modules.pop(name, None)
        parent, _, leaf = name.rpartition(".")
        if module is not None and getattr(sys.modules.get(parent), leaf, None) is module:
            delattr(sys.modules[parent], leaf)
        _seen[name] = digests[name]


def check_same(code: Code, sources: Sources) -> None:
    """Make sure that this machine has the code that a task was planned with.

    Raises
    ------
    PipelineError
        It has another.
    """
    for name, (digest, _) in code.modules.items():
        module = sources.module(name)
        if module is None or module.code_digest != digest:
            raise PipelineError(f"the worker's {name} is not the code that the run was planned with")


def _edited_since_start(name: str, sources: Sources) -> bool:
    path = sources.file_of(name)
    return path is not None and max(stamp(path)[1:3]) > _STARTED_NS


def _drop_outdated(path: Path | None) -> bool:
    """Remove a compiled file that Python would take for this source though it was made of another text.

    Python knows it by the size and the time of the source, which an edit may leave as they were; it can be outdated
    where it is older than the last change of the source's status, and then what it holds tells.
    """
    try:
        if path is None:
            return False
        compiled, source = Path(cache_from_source(path)), path.stat()
        if compiled.stat().st_mtime_ns > source.st_ctime_ns:
            return False
        data = compiled.read_bytes()
        header = struct.pack("<4sIII", MAGIC_NUMBER, 0, int(source.st_mtime) & 0xFFFFFFFF, source.st_size & 0xFFFFFFFF)
        if data[: len(header)] != header:
            return False
        if marshal.loads(data[len(header) :]) == compile(path.read_bytes(), path, "exec", dont_inherit=True):
            os.utime(compiled)
            return False
        compiled.unlink()
    except (OSError, NotImplementedError):
        return False
    return True
