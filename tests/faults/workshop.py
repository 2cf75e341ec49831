"""A package of stages that write down when they compute, and a folder to drill in, as a user would lay them out."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from pipeline.runs import Run, open_run
from pipeline.storage.store import Store

Tally = Callable[..., None]
"""Takes a kind of fault, how often it was injected, and how often something was lost by it."""

STAGES = '''
from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import numpy as np

from pipeline.data.gratings import PeriodMap
from pipeline.data.metrics import Metrics
from pipeline.data.photographs import Photo


def note(word: str) -> None:
    """Write a line that no other process' line runs into."""
    descriptor = os.open(os.environ["DRILL_DIARY"], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    os.write(descriptor, f"{word}\\n".encode())
    os.close(descriptor)


def made(size: int, seed: int, ms: float) -> Photo:
    time.sleep(ms / 1000)
    values = np.random.default_rng(seed).random(size * size, np.float32)
    return Photo(values, values > 0.9)


def make(*, label: str, size: int = 8, seed: int = 0, ms: float = 0.3) -> Photo:
    """Make a map."""
    note(label)
    return made(size, seed, ms)


def read(*, label: str, table: Path) -> Photo:
    """Read a map from a file."""
    note(label)
    values = np.loadtxt(table, np.float32)
    return Photo(values, values > 0.9)


def blend(maps: list[Photo], *, label: str, size: int = 8, seed: int = 0, ms: float = 0.3) -> Photo:
    """Make a map that depends on others."""
    note(label)
    own = made(size, seed, ms)
    return Photo(own.image + np.float32(sum(m.image.mean() for m in maps)), own.saturated)


def period(maps: Photo, *, label: str) -> PeriodMap:
    """Give a map that has files for people."""
    note(label)
    side = int(np.sqrt(maps.image.size))
    return PeriodMap(maps.image[: side * side].reshape(side, side), np.ones((side, side), bool))


def perish(maps: Photo, *, label: str, once: str, seed: int = 0) -> Photo:
    """Make a map; the first time, the process is killed half way."""
    note(label)
    time.sleep(0.02)
    if not Path(once).exists():
        Path(once).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return made(100, seed, 1)


def mean(maps: list[Photo], *, label: str, ms: float = 0.3) -> Metrics:
    """Take the mean of every map."""
    note(label)
    time.sleep(ms / 1000)
    return Metrics({f"mean_{i}_um": float(m.image.mean()) for i, m in enumerate(maps)})
'''

DEVICES = '''
from __future__ import annotations

import os
import signal
import time
from math import degrees

import numpy as np

from drillbench.stages.drill.maps import note
from pipeline.data.photographs import Photo
from pipeline.devices.rotation_mount import SimulatedRotationMount
from pipeline.errors import DeviceError

STANDS = {"rad": 0.0}
EXPOSED = {"count": 0}


class Mount(SimulatedRotationMount):
    """The simulated mount, slow enough to be met by a fault on its way; the fault is no setting of the capture."""

    def __init__(self) -> None:
        scale = 20 if "DRILL_DRIVE" in os.environ else 200
        super().__init__(time_scale=scale, heartbeat_s=0.02, response_s=0.3, timeout_s=0.3)

    def __enter__(self) -> Mount:
        EXPOSED["count"] = 0
        fault, _, place = os.environ.get("DRILL_DRIVE", "").partition(" at ")
        if fault:
            self.inject(fault, at_deg=float(place))
        super().__enter__()
        return self

    def move_to(self, angle_rad: float) -> float:
        try:
            STANDS["rad"] = super().move_to(angle_rad)
        except BaseException:
            before = self.shaft_rad
            time.sleep(0.02)
            note("standing" if self.shaft_rad == before else "moving")
            raise
        return STANDS["rad"]


class Camera:
    """A camera in a laboratory, which fails or kills its process at a photograph of one attempt if asked to."""

    physical = True

    def expose(self) -> Photo:
        EXPOSED["count"] += 1
        fault, _, number = os.environ.get("DRILL_CAMERA", "").partition(" at ")
        if fault and EXPOSED["count"] == int(number):
            if fault == "kill":
                os.kill(os.getpid(), signal.SIGKILL)
            raise DeviceError("camera Drill does not take the photo: its battery is empty")
        time.sleep(0.03 if "DRILL_DRIVE" in os.environ else 0.003)
        phase = np.linspace(0, np.pi, 12, dtype=np.float32).reshape(3, 4)
        image = 0.5 + 0.4 * np.cos(2 * (STANDS["rad"] - phase))
        note(f"photo_{round(degrees(STANDS['rad']))}")
        return Photo(image.astype(np.float32), np.zeros((3, 4), bool), 0.03)


class Lamp:
    """A lamp that says when it is switched."""

    def switch(self, on: bool) -> None:
        note("light_on" if on else "light_off")
'''

ENTRY_POINTS = """\
[pipeline.stages]
drill = drillbench.stages
[pipeline.devices]
drill = drillbench.devices
"""

RIG = {
    "device": "lab.PolarizationBench",
    "camera": {"device": "drill.Camera"},
    "mount": {"device": "drill.Mount"},
    "light": {"device": "drill.Lamp"},
}

GRAPH = {
    "rough": {"stage": "drill.make", "size": 512, "ms": 5},
    "small": {"stage": "drill.make", "seed": 1},
    "wide": {"stage": "drill.blend", "maps": ["rough"], "size": 512, "seed": 2, "ms": 3},
    "both": {"stage": "drill.blend", "maps": ["rough", "small"], "seed": 3, "ms": 10},
    "light": {"stage": "drill.blend", "maps": ["small"], "seed": 4, "ms": 1},
    "still": {"stage": "drill.blend", "maps": ["small"], "seed": 5, "ms": 20},
    "long": {"stage": "drill.blend", "maps": ["wide"], "size": 512, "seed": 6, "ms": 2},
    "mixed": {"stage": "drill.blend", "maps": ["both", "light"], "seed": 7},
    "late": {"stage": "drill.blend", "maps": ["long", "still"], "seed": 8, "ms": 8},
    "whole": {"stage": "drill.blend", "maps": ["late", "mixed"], "size": 512, "seed": 9},
    "fit": {"stage": "drill.mean", "maps": ["whole", "long"]},
    "evaluate": {"stage": "drill.mean", "maps": ["rough", "small", "whole"], "ms": 1},
}

WITH_TABLE = {
    "plain": {"stage": "drill.make", "size": 20, "seed": 1},
    "both": {"stage": "drill.blend", "maps": ["read", "plain"], "size": 30, "seed": 2},
    "later": {"stage": "drill.blend", "maps": ["both"], "seed": 3},
    "fit": {"stage": "drill.mean", "maps": ["both", "later"]},
    "evaluate": {"stage": "drill.mean", "maps": ["read", "later"]},
}
"""What follows a map that is read from a file."""


class Workshop:
    """The package, an experiment and a folder for results."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.configs = folder / "configs"
        self.runs = folder / "runs"
        self.diary = folder / "diary.txt"
        self.table = folder / "table.txt"

    def write(self) -> Self:
        stages = self.folder / "drillbench" / "stages" / "drill"
        stages.mkdir(parents=True)
        for package in (stages, stages.parent, stages.parent.parent):
            (package / "__init__.py").touch()
        (stages / "maps.py").write_text(STAGES)
        devices = self.folder / "drillbench" / "devices"
        devices.mkdir()
        (devices / "__init__.py").touch()
        (devices / "drill.py").write_text(DEVICES)
        info = self.folder / "drillbench-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: drillbench\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(ENTRY_POINTS)
        self.experiment("drill", GRAPH)
        self.table.write_text("0.25 0.5 0.75\n")
        self.experiment("table", {"read": {"stage": "drill.read", "table": str(self.table)}, **WITH_TABLE})
        return self

    def experiment(self, name: str, graph: Mapping[str, Mapping[str, Any]], *, labelled: bool = True) -> None:
        """Write an experiment; each node is labelled by its name."""
        nodes = {node: {"label": node, **written} if labelled else written for node, written in graph.items()}
        file = self.configs / "experiment" / f"{name}.yaml"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"# @package _global_\n{json.dumps({'graph': nodes})}\n")

    def words(self, *overrides: str, experiment: str = "drill") -> list[str]:
        """What to write on the command line."""
        return [f"--config-dir={self.configs}", f"+experiment={experiment}", f"paths.runs={self.runs}", *overrides]

    def environment(self) -> dict[str, str]:
        """What a process needs in its environment to find the package."""
        path = os.pathsep.join([str(self.folder), *filter(None, [os.environ.get("PYTHONPATH")])])
        return {"PYTHONPATH": path, "DRILL_DIARY": str(self.diary), "OPENBLAS_NUM_THREADS": "1"}

    def computed(self) -> Counter[str]:
        """How often each stage was computed."""
        return Counter(self.diary.read_text().split()) if self.diary.is_file() else Counter()

    def store(self) -> Store:
        """The store, as a process sees it that has read nothing of it yet."""
        return Store(self.runs / ".store")

    def start_again(self, *, forget: bool = False) -> None:
        """Remove all results, and what is remembered of sources and compositions only if asked to."""
        memory, kept = self.runs / ".store" / "memory", self.folder / "memory"
        if not forget and memory.is_dir():
            shutil.rmtree(kept, ignore_errors=True)
            shutil.move(memory, kept)
        shutil.rmtree(self.runs, ignore_errors=True)
        if not forget and kept.is_dir():
            shutil.copytree(kept, memory)
        self.diary.unlink(missing_ok=True)

    def run(self, experiment: str = "drill") -> Run:
        """The only run of an experiment, as its folder tells it."""
        (manifest,) = self.runs.glob(f"{experiment}/*/manifest.json")
        return open_run(manifest.parent)

    def artifacts(self, experiment: str = "drill") -> dict[str, str]:
        """Digest of each node's value, once it has been found to be what its digest says."""
        run, store = self.run(experiment), self.store()
        for node in run.nodes.values():
            store.get(node.artifact)
        return {name: node.artifact for name, node in run.nodes.items()}


class Warm:
    """A process that has imported all that a run imports, and forks one for each run."""

    def __init__(self, workshop: Workshop, experiment: str = "drill") -> None:
        self.workshop, self.experiment = workshop, experiment
        self.output = workshop.folder / "output"
        self.output.mkdir()
        self._count = 0

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("warm.py"))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **self.workshop.environment()},
            text=True,
        )
        elsewhere = [f"paths.runs={self.workshop.folder / 'warming'}", "executor.workers=2"]
        self.run(self.workshop.words(*elsewhere, experiment=self.experiment))
        self.workshop.diary.unlink()
        return self

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait(10)

    def run(self, words: Sequence[str], kill_after_s: float | None = None) -> tuple[int, float, str]:
        """Run the command line; gives its exit status (-9 if killed), the seconds it took, and what it printed.

        Words such as ``DRILL_CAMERA=...`` at the beginning go into its environment.
        """
        return self.run_all([words], kill_after_s)[0]

    def run_all(
        self, commands: Sequence[Sequence[str]], kill_after_s: float | None = None
    ) -> list[tuple[int, float, str]]:
        """Run command lines at the same time."""
        files = [self.output / f"{self._count + index}.txt" for index in range(len(commands))]
        self._count += len(commands)
        for file in files:
            file.touch()
        jobs = [{"words": list(w), "output": str(f)} for w, f in zip(commands, files, strict=True)]
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps({"jobs": jobs, "kill_after_s": kill_after_s}) + "\n")
        self._process.stdin.flush()
        answers = json.loads(self._process.stdout.readline())
        return [(status, seconds, file.read_text()) for (status, seconds), file in zip(answers, files, strict=True)]
