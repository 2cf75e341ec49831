"""The graph of ``workflow_managers.py`` in the words of each manager, as its manual writes such a thing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Protocol


class Stage(Protocol):
    """A stage of the graph."""

    name: str
    before: str
    number: int


SCRIPT = """\
import sys

import numpy as np

before, after, number = sys.argv[1], sys.argv[2], float(sys.argv[3])
values = np.load(before) if before else np.random.default_rng(0).random((64, 64))
np.save(after, np.sqrt(values) + number)
"""

OUR_STAGES = '''\
"""Tiny stages."""

from __future__ import annotations

import numpy as np

from pipeline.data.gratings import PeriodMap


def start(*, number: float = 0.0) -> PeriodMap:
    """Make an array."""
    values = np.random.default_rng(0).random((64, 64))
    return PeriodMap(np.sqrt(values) + number, np.ones((64, 64), bool))


def root(maps: PeriodMap, *, number: float = 0.0) -> PeriodMap:
    """Take the square root and add a number."""
    return PeriodMap(np.sqrt(maps.period_um) + number, maps.mask)
'''

JOBLIB = """\
import numpy as np
from joblib import Memory

memory = Memory("cache", verbose=0)


@memory.cache
def start(number):
    return np.sqrt(np.random.default_rng(0).random((64, 64))) + number


@memory.cache
def root(values, number):
    return np.sqrt(values) + number


results = {}
for name, before, number in GRAPH:
    results[name] = root(results[before], number) if before else start(number)
"""

REDUN = """\
import numpy as np
from redun import File, task

redun_namespace = "tiny"


@task()
def start(number: int, path: str) -> File:
    file = File(path)
    with file.open("wb") as out:
        np.save(out, np.sqrt(np.random.default_rng(0).random((64, 64))) + number)
    return file


@task()
def root(before: File, number: int, path: str) -> File:
    with before.open("rb") as data:
        values = np.load(data)
    file = File(path)
    with file.open("wb") as out:
        np.save(out, np.sqrt(values) + number)
    return file


@task()
def main() -> list[File]:
    results = {}
    for name, before, number in GRAPH:
        path = f"results/{name}.npy"
        results[name] = root(results[before], number, path) if before else start(number, path)
    return list(results.values())
"""


def our_package(folder: Path, stages: list[Stage]) -> None:
    """A package of two stages, declared by an entry point, and an experiment."""
    package = folder / "tinybench" / "stages" / "tiny"
    package.mkdir(parents=True)
    for part in (package, package.parent, package.parent.parent):
        (part / "__init__.py").touch()
    (package / "arrays.py").write_text(OUR_STAGES)
    info = folder / "tinybench-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: tinybench\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[pipeline.stages]\ntiny = tinybench.stages\n")
    lines = [
        f"  {s.name}: {{stage: tiny.root, maps: {s.before}, number: {s.number}}}\n"
        if s.before
        else f"  {s.name}: {{stage: tiny.start, number: {s.number}}}\n"
        for s in stages
    ]
    experiment = folder / "configs" / "experiment"
    experiment.mkdir(parents=True)
    (experiment / "tiny.yaml").write_text("# @package _global_\ngraph:\n" + "".join(lines))


def dvc_pipeline(folder: Path, stages: list[Stage]) -> None:
    """A stage of ``dvc.yaml`` for each stage."""
    (folder / "work.py").write_text(SCRIPT)
    (folder / "results").mkdir()
    lines = ["stages:\n"]
    for stage in stages:
        before = f"results/{stage.before}.npy" if stage.before else ""
        lines.append(f"  {stage.name}:\n    cmd: python work.py '{before}' results/{stage.name}.npy {stage.number}\n")
        lines.append(
            f"    deps: [{', '.join(filter(None, ['work.py', before]))}]\n    outs: [results/{stage.name}.npy]\n"
        )
    (folder / "dvc.yaml").write_text("".join(lines))


def snakefile(folder: Path, stages: list[Stage]) -> None:
    """A rule for each stage."""
    (folder / "work.py").write_text(SCRIPT)
    ends = ", ".join(f'"results/{stage.name}.npy"' for stage in stages)
    lines = [f"rule all:\n    input: {ends}\n"]
    for stage in stages:
        before = f"    input: 'results/{stage.before}.npy'\n" if stage.before else ""
        source = "{input}" if stage.before else "''"
        lines.append(
            f"\nrule {stage.name}:\n{before}    output: 'results/{stage.name}.npy'\n"
            f'    shell: "python work.py {source} {{output}} {stage.number}"\n'
        )
    (folder / "Snakefile").write_text("".join(lines))


def redun_workflow(folder: Path, stages: list[Stage]) -> None:
    """A task for the start, one for the others, and one that makes the graph."""
    (folder / "results").mkdir()
    (folder / "workflow.py").write_text(REDUN.replace("GRAPH", _as_list(stages)))


def joblib_script(folder: Path, stages: list[Stage]) -> None:
    """A script of two cached functions."""
    (folder / "work.py").write_text(JOBLIB.replace("GRAPH", _as_list(stages)))


def _as_list(stages: list[Stage]) -> str:
    return json.dumps([[stage.name, stage.before, stage.number] for stage in stages])
