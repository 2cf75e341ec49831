"""What the bench itself costs a stage, for graphs of a hundred to ten thousand stages.

    python benchmarks/many_stages.py [STAGES ...]

Each graph is a chain of two stages and then branches of four, on arrays of 8 x 8 numbers, so that next to nothing is
computed. Each size runs in a process of its own, which has imported everything, on a store of its own, with the
executor of threads. ``composing`` is YAML to one configuration, ``checking`` every name, type and edge, ``planning``
keys and what the store holds, ``running`` everything from there to the last record, stages included, ``manifest`` the
run's folder without the report. ``again`` is the same with nothing to do: what composing gave is remembered by then.

An ext4 file system without a journal shuns the inodes of files deleted within the last minutes, and searches past all
of them for each new file: after a test suite, or after this benchmark itself, wait five minutes or let ``TMPDIR`` point
to another file system.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

STAGES = (100, 1000, 3000, 10_000)
PARTS = ("composing", "checking", "planning", "running", "manifest")

MODULE = '''
from __future__ import annotations

import numpy as np

from pipeline.data.gratings import PeriodMap


def make(*, size: int = 8, seed: int = 0) -> PeriodMap:
    """Make a map."""
    values = np.random.default_rng(seed).random((size, size), np.float32)
    return PeriodMap(values, values > 0.1)


def add(maps: PeriodMap, *, amount: float = 1.0) -> PeriodMap:
    """Add to a map."""
    return PeriodMap(maps.period_um + np.float32(amount), maps.mask)
'''


def lay_out(folder: Path, stages: int) -> Path:
    """Write the package, its declaration and two experiments, ``many`` and ``few``; gives the folder of YAML files."""
    package = folder / "manybench" / "stages" / "tiny"
    package.mkdir(parents=True)
    for part in (package, package.parent, package.parent.parent):
        (part / "__init__.py").touch()
    (package / "maps.py").write_text(MODULE)
    info = folder / "manybench-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: manybench\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[pipeline.stages]\ntiny = manybench.stages\n")
    experiments = folder / "configs" / "experiment"
    experiments.mkdir(parents=True)
    for name, count in (("many", stages), ("few", 6)):
        nodes = "".join(f"  {line}\n" for line in nodes_of(count))
        (experiments / f"{name}.yaml").write_text(f"# @package _global_\ngraph:\n{nodes}")
    return folder / "configs"


def nodes_of(stages: int) -> Iterator[str]:
    """The lines of the graph."""
    yield "first: {stage: tiny.make}"
    yield "second: {stage: tiny.add, maps: first}"
    for number in range(stages - 2):
        branch, depth = divmod(number, 4)
        upstream = f"b{branch}_{depth - 1}" if depth else "second"
        yield f"b{branch}_{depth}: {{stage: tiny.add, maps: {upstream}, amount: {number}}}"


def measure(folder: Path, stages: int) -> None:
    """Print the milliseconds a stage of each part, and those of the same with nothing to do."""
    from pipeline.bench import Experiment, carry_out
    from pipeline.execution.executors import executor_of
    from pipeline.execution.outcome import Silent
    from pipeline.graph.compose import compose

    spent: dict[str, float] = {}

    @contextmanager
    def timed(part: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        spent[part] = 1e3 * (time.perf_counter() - start) / stages

    def once(name: str) -> None:
        with timed("composing"):
            configuration = compose([f"+experiment={name}", f"paths.runs={folder / name}"], [configs])
        with timed("checking"):
            experiment = Experiment.of(configuration)
        with timed("planning"):
            plan = experiment.plan()
        with timed("running"):
            executor = executor_of({"kind": "threads"})
            outcomes = carry_out(plan, experiment.store, experiment.catalog.sources, executor, Silent())
        with timed("manifest"):
            experiment.finish(outcomes, 0.0)

    sys.path.insert(0, str(folder))
    configs = lay_out(folder, stages)
    time.sleep(0.2)  # files that are being written are not remembered
    once("few")
    for label in ("first", "again"):
        once("many")
        figures = [*(spent[part] for part in PARTS), sum(spent.values())]
        print(f"{stages:8}  {label:6}" + "".join(f"{figure:10.3f}" for figure in figures), flush=True)


def main() -> None:
    if sys.argv[1:2] == ["--one"]:
        measure(Path(sys.argv[2]), int(sys.argv[3]))
        return
    print(f"milliseconds a stage, {len(os.sched_getaffinity(0))} cores, load {os.getloadavg()[0]:.1f}")
    print(f"{'stages':>8}  {'run':6}" + "".join(f"{part:>10}" for part in (*PARTS, "in all")), flush=True)
    with tempfile.TemporaryDirectory() as name:
        for stages in [int(word) for word in sys.argv[1:]] or STAGES:
            folder = Path(name) / str(stages)
            subprocess.run([sys.executable, __file__, "--one", str(folder), str(stages)], check=True)


if __name__ == "__main__":
    main()
