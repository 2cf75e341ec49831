"""Counts what the drills injected and what was lost; the table is printed at the end of the session."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from workshop import Tally, Warm, Workshop


@pytest.fixture
def tally(record_property: Callable[[str, object], None]) -> Tally:
    """Note how often a kind of fault was injected, and how often something was lost by it; fails if anything was."""

    def note(kind: str, injected: int, lost: int = 0) -> None:
        record_property("fault", [kind, int(injected), int(lost)])
        assert lost == 0, f"{lost} of {injected} {kind} lost something"

    return note


@pytest.fixture
def workshop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Workshop]:
    """A package of stages that this process and those it starts can import, and an experiment."""
    made = Workshop(tmp_path).write()
    for name, value in made.environment().items():
        monkeypatch.setenv(name, value)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield made
    for name in [n for n in sys.modules if n.split(".")[0] == "drillbench"]:
        del sys.modules[name]


@pytest.fixture
def warm(workshop: Workshop) -> Iterator[Warm]:
    """A process that forks one for each run."""
    if not hasattr(os, "pidfd_open"):
        pytest.skip("this system has no descriptors of processes")
    with Warm(workshop) as process:
        yield process
