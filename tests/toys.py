"""A package of toy stages, written to a folder of the test's, so that a test can edit its code."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from textwrap import dedent

import pytest

import pipeline.codebase.source
import pipeline.graph.config
from pipeline.bench import Experiment
from pipeline.execution.outcome import Silent
from pipeline.report import FORMAT, RECORD
from pipeline.runs import Run

HELPER = '''
"""Arithmetic of the toys."""

def scaled(array, factor):
    """Scale."""
    return array * factor  # how it is scaled
'''

STAGES = '''
from __future__ import annotations

import logging
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np

from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.data.metrics import Metrics
from pipeline.parallel import threads
from toybench.arithmetic import scaled


def source(*, size: int = 4, value: float = 1.0, seed: int = 0, folder: Path | None = None) -> PeriodMap:
    """Make a map.

    Second paragraph.
    """
    logging.getLogger("pipeline.toy").warning("made of nothing")
    logging.getLogger("pipeline.toy").info("of %d rows", size)
    return PeriodMap(np.full((size, size), value, np.float32), np.ones((size, size), bool))


def scale(maps: PeriodMap, *, factor: float = 2.0, mode: Literal["up", "down"] = "up") -> PeriodMap:
    """Scale a map."""
    factor = factor if mode == "up" else 1 / factor
    return PeriodMap(scaled(np.asarray(maps.period_um), np.float32(factor)), maps.mask)


def clip(maps: PeriodMap, *, most: float = 100.0) -> PeriodMap:
    """Clip a map."""
    return PeriodMap(np.minimum(maps.period_um, np.float32(most)), maps.mask)


def mean(maps: list[PeriodMap], truth: PeriodMap | None = None) -> Metrics:
    """Take the mean of every map."""
    found = {f"mean_{i}_um": float(np.mean(m.period_um)) for i, m in enumerate(maps)}
    if truth is not None:
        found["truth_um"] = float(np.mean(truth.period_um))
    return Metrics(found)


def compare(maps: PeriodMap, truth: PeriodMap) -> Metrics:
    """Compare with the truth."""
    return Metrics({"difference_um": float(np.mean(maps.period_um) - np.mean(truth.period_um))})


def fails(maps: PeriodMap, *, message: str = "the toy broke") -> PeriodMap:
    """Fail."""
    raise RuntimeError(message)


def kills_its_process(maps: PeriodMap, *, unless: str = "") -> PeriodMap:
    """Kill the process; once only, where a file remembers it."""
    if unless and Path(unless).is_file():
        return maps
    if unless:
        Path(unless).touch()
    os.kill(os.getpid(), signal.SIGKILL)
    return maps


def slow(maps: PeriodMap, *, name: str, log: str) -> PeriodMap:
    """Take a while, and write down from when to when."""
    start = time.time()
    time.sleep(0.3)
    with Path(log, "spans.txt").open("a") as file:
        file.write(f"{name} {start} {time.time()}\\n")
    return maps


def waits_for_others(maps: PeriodMap, *, name: str, folder: str, count: int) -> PeriodMap:
    """Give the threads it may use, once as many stages as that run at the same time."""
    Path(folder, name + ".runs").touch()
    deadline = time.time() + 10
    while len(list(Path(folder).glob("*.runs"))) < count and time.time() < deadline:
        time.sleep(0.01)
    return PeriodMap(np.full((2, 2), threads(), np.float32), np.ones((2, 2), bool))


def turn(maps: PeriodMap) -> OrientationMap:
    """Give another type."""
    a = np.zeros((2, 2), np.float32)
    return OrientationMap(a, a, a, a > 0)
'''

DEVICES = '''
from __future__ import annotations

import numpy as np

from pipeline.data.photographs import Photo
from pipeline.devices.protocols import Light
from pipeline.errors import InputError


class Lamp:
    """A lamp."""

    def __init__(self, *, watts: float = 60.0) -> None:
        self.watts = watts

    def switch(self, on: bool) -> None:
        """Switch."""


class Webcam:
    """A camera in a laboratory."""

    physical = True
    taken = 0

    def __init__(self, *, light: Light, exposure_s: float = 0.1) -> None:
        if exposure_s <= 0:
            raise ValueError(f"exposure_s is {exposure_s}")
        self.light, self.exposure_s = light, exposure_s

    def check(self) -> None:
        if self.exposure_s > 10:
            raise InputError("the exposure is too long", expected="at most 10 s")

    def expose(self) -> Photo:
        Webcam.taken += 1
        return Photo(np.full((2, 2), Webcam.taken, np.float32), np.zeros((2, 2), bool), self.exposure_s)
'''

CAPTURE = '''
from __future__ import annotations

from pipeline.data.gratings import PeriodMap
from pipeline.devices.protocols import Camera
from pipeline.errors import InputError


def photo(sample: PeriodMap | None = None, *, camera: Camera, times: int = 1) -> PeriodMap:
    """Take a photo."""
    taken = camera.expose()
    return PeriodMap(taken.image * times, ~taken.saturated)


def _check_photo(*, camera: Camera, times: int) -> None:
    if times < 1:
        raise InputError("no photo is asked for", expected="times from 1")
'''

EXPERIMENT = """\
# @package _global_
# A toy.
description: A toy.
graph:
  raw: {stage: toy.source, size: 3}
  big:
    stage: toy.scale
    maps: raw
    factor: 3
  cut: {stage: toy.clip, maps: big}
  means: {stage: toy.mean, maps: [raw, cut]}
"""


EXECUTORS = ("executor/processes.yaml", "executor/distributed.yaml")


class Toys:
    """The toy package and an empty folder for results."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.package = folder / "toybench"
        self.configs = folder / "configs"
        self.stages = self.package / "stages" / "toy" / "maps.py"
        self.devices = self.package / "devices" / "lab.py"
        self.helper = self.package / "arithmetic.py"
        self.experiment = self.configs / "experiment" / "toy.yaml"

    def write(self) -> None:
        for path in (self.package, self.package / "devices", self.package / "stages", self.package / "stages" / "toy"):
            path.mkdir()
            (path / "__init__.py").touch()
        self.stages.write_text(STAGES)
        self.helper.write_text(HELPER)
        self.devices.write_text(DEVICES)
        self.stages.with_name("capture.py").write_text(CAPTURE)
        (self.configs / "experiment").mkdir(parents=True)
        (self.configs / "executor").mkdir()
        (self.configs / "rig").mkdir()
        original = pipeline.graph.config.configs_folder()
        for name in ("config.yaml", "executor/threads.yaml", "executor/serial.yaml", *EXECUTORS):
            (self.configs / name).write_text((original / name).read_text())
        self.experiment.write_text(EXPERIMENT)

    def graph(self, text: str) -> None:
        """Replace the graph by a YAML text."""
        self.experiment.write_text("# @package _global_\ngraph:\n" + _indented(dedent(text)))

    def forget(self) -> None:
        """Forget the toy package, so that its code is read anew."""
        for name in [n for n in sys.modules if n.split(".")[0] == "toybench"]:
            del sys.modules[name]

    def load(self, *overrides: str) -> Experiment:
        self.forget()
        words = ["+experiment=toy", f"paths.runs={self.folder / 'runs'}", *overrides]
        return Experiment.load(words)

    def run(self, *overrides: str) -> Run:
        return self.load(*overrides).run(Silent())

    def ran(self, *overrides: str) -> list[str]:
        """Names of the nodes that had to be computed."""
        return sorted(n.name for n in self.run(*overrides).nodes.values() if n.status == "ran")

    def reasons(self, *overrides: str) -> dict[str, str]:
        """What ``why`` says of every node."""
        return {name: f"{s.state}: {s.reason}" for name, s in self.load(*overrides).plan().steps.items()}


def _indented(text: str) -> str:
    return "".join("  " + line + "\n" for line in text.strip().splitlines())


@pytest.fixture
def toys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Toys]:
    made = Toys(tmp_path)
    made.write()
    made.forget()
    monkeypatch.syspath_prepend(str(tmp_path))

    def declared(group: str) -> list[str]:
        return [group.replace("pipeline", "toybench")]

    monkeypatch.setattr("pipeline.codebase.source.declared", declared)
    monkeypatch.setattr("pipeline.graph.catalog.declared", declared)
    monkeypatch.setattr("pipeline.graph.config.configs_folder", lambda: made.configs)
    monkeypatch.setattr("pipeline.graph.compose.configs_folder", lambda: made.configs)
    monkeypatch.setattr("pipeline.report.write", _page, raising=False)
    monkeypatch.setattr("pipeline.report.write_outputs", lambda run: [], raising=False)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    yield made
    made.forget()


def _page(run: Run) -> Path:
    run.report.write_text("a page")
    (run.path / "outputs").mkdir(exist_ok=True)
    (run.path / "outputs" / RECORD).write_text(json.dumps({"format": FORMAT, "nodes": {}}))
    return run.report
