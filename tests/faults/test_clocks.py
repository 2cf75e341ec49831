"""Clocks that jump, and files whose times lie: what changed is noticed by its content, and no result is stale."""

from __future__ import annotations

import importlib
import os
import random
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from workshop import Tally, Workshop

from pipeline.bench import Experiment
from pipeline.execution.outcome import Silent
from pipeline.runs import Run

DAY_S = 86_400
GRAPH = {
    "read": {"stage": "drill.read", "table": "???"},
    "scaled": {"stage": "scale.times", "maps": "read", "factor": 2.0},
}
STAGE = '''
from __future__ import annotations

from drillbench.stages.drill.maps import note
from pipeline.data.photographs import Photo


def times(maps: Photo, *, label: str, factor: float = 1.0) -> Photo:
    """Scale a map."""
    note(label)
    return Photo(maps.image * factor + 0.0, maps.saturated)
'''


class Bench:
    """A file that is read, a factor in YAML and an offset in code, each changed without a change of its size."""

    def __init__(self, workshop: Workshop) -> None:
        self.workshop = workshop
        self.code = workshop.folder / "drillbench" / "stages" / "scale" / "times.py"
        self.code.parent.mkdir()
        (self.code.parent / "__init__.py").touch()
        self.code.write_text(STAGE)
        workshop.experiment("clock", {**GRAPH, "read": {"stage": "drill.read", "table": str(workshop.table)}})
        self.yaml = workshop.configs / "experiment" / "clock.yaml"
        self.changes = {
            "data": (workshop.table, r"^\d\.\d\d", "{}"),
            "YAML": (self.yaml, r'(?<="factor": )\d\.\d\d?', "{}"),
            "code": (self.code, r"(?<=factor \+ )\d\.\d\d?", "{}"),
        }
        for kind in self.changes:
            self.change(kind, "1.25", lambda path, text: path.write_text(text))

    def change(self, kind: str, number: str, write: Callable[[Path, str], object]) -> None:
        path, pattern, _ = self.changes[kind]
        write(path, re.sub(pattern, number, path.read_text(), count=1))

    def expected(self) -> float:
        """What the first number comes to."""
        found = {k: re.search(p, path.read_text()) for k, (path, p, _) in self.changes.items()}
        data, factor, offset = (float(match[0]) for match in found.values() if match)
        return float(np.float32(data) * factor + offset)

    def run(self) -> Run:
        words = self.workshop.words(experiment="clock")[1:]
        return Experiment.load(words, [self.workshop.configs]).run(Silent())


def in_place(path: Path, text: str) -> None:
    with path.open("r+") as file:
        file.write(text)


def by_another_file(path: Path, text: str) -> None:
    other = path.with_name("another")
    other.write_text(text)
    other.replace(path)


def with_times(write: Callable[[Path, str], None], shift_s: float) -> Callable[[Path, str], None]:
    """Write, and let the file bear the times of before, or others."""

    def written(path: Path, text: str) -> None:
        before = path.stat()
        write(path, text)
        assert path.stat().st_size == before.st_size
        os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns + int(1e9 * shift_s)))

    return written


@contextmanager
def shifted(patch: pytest.MonkeyPatch, shift_s: float) -> Iterator[None]:
    """All clocks of Python's are off by so many seconds."""
    with patch.context() as inner:
        for name in ("time", "monotonic", "perf_counter"):
            clock, in_ns = getattr(time, name), getattr(time, f"{name}_ns")
            inner.setattr(time, name, lambda clock=clock: clock() + shift_s)
            inner.setattr(time, f"{name}_ns", lambda in_ns=in_ns: in_ns() + int(1e9 * shift_s))
        yield


@pytest.fixture
def bench(workshop: Workshop) -> Bench:
    return Bench(workshop)


@pytest.mark.parametrize("kind", ["data", "YAML", "code"])
def test_changes_that_times_do_not_tell(bench: Bench, tally: Tally, monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    rng = random.Random(kind)
    stale = 0
    trials = 12
    for trial in range(trials):
        with shifted(monkeypatch, rng.choice([0, -DAY_S, DAY_S, -400 * DAY_S])):
            stale += bench.run()["scaled"].image[0] != np.float32(bench.expected())
            time.sleep(0.11 * (trial % 2))  # half of the files are old enough for their times to be believed
            bench.run()
        write = with_times(rng.choice([in_place, by_another_file]), rng.choice([0, 0, -DAY_S, DAY_S, -1e-3]))
        bench.change(kind, f"{rng.randint(1, 9)}.{rng.randint(10, 99)}", write)
    stale += bench.run()["scaled"].image[0] != np.float32(bench.expected())
    tally(f"change of {kind} that no time tells, clocks jumping", trials, stale)


def test_code_that_changed_after_python_compiled_it(bench: Bench, tally: Tally) -> None:
    """Python itself knows a compiled file by size and time of its source."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    command = [sys.executable, "-m", "pipeline", "-q", *bench.workshop.words("executor=serial", experiment="clock")]
    trials = 3
    for trial in range(trials):
        subprocess.run(command, check=True, capture_output=True, env=environment)
        bench.change("code", f"{trial + 4}.50", with_times(in_place, 0))
    subprocess.run(command, check=True, capture_output=True, env=environment)
    stale = int(bench.workshop.run("clock")["scaled"].image[0] != np.float32(bench.expected()))
    tally("change of code behind Python's back", trials, stale)


def test_code_that_changed_after_it_was_imported(bench: Bench, tally: Tally) -> None:
    for path in bench.workshop.folder.rglob("*.py"):
        os.utime(path, (time.time() - DAY_S, time.time() - DAY_S))
    importlib.import_module("drillbench.stages.scale.times")
    bench.change("code", "8.75", with_times(in_place, 0))
    stale = bench.run()["scaled"].image[0] != np.float32(bench.expected())
    tally("change of code that was imported, times set back", 1, int(stale))
