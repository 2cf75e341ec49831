"""Counts what the drills injected and what was lost, and prints a table at the end of the session."""

from __future__ import annotations

import os
import sys
from collections import Counter
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


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the table; the counts come with the tests' reports, also from other processes."""
    injected: Counter[str] = Counter()
    lost: Counter[str] = Counter()
    for reports in terminalreporter.stats.values():
        for report in reports:
            for name, value in getattr(report, "user_properties", ()):
                if name == "fault" and getattr(report, "when", "") == "call":
                    injected[value[0]] += value[1]
                    lost[value[0]] += value[2]
    if not injected:
        return
    terminalreporter.section("faults")
    width = max(map(len, injected))
    terminalreporter.write_line(f"{'kind':<{width}} | injected | lost")
    for kind in sorted(injected):
        terminalreporter.write_line(f"{kind:<{width}} | {injected[kind]:8} | {lost[kind]:4}")


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
