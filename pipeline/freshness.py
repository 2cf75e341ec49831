"""Code in memory against code on disk: a process that goes on after an edit must not run what it imported before."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable

from pipeline.errors import InputError, PipelineError
from pipeline.source import ROOT, Code, Sources

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
        if name not in sys.modules:
            _seen[name] = code
        elif name not in _seen:
            _seen[name] = code
            if _edited_since_start(name, sources):
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
    return path is not None and path.stat().st_mtime_ns > _STARTED_NS
