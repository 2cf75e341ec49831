"""The same graph of 82 tiny stages here and in DVC, Snakemake, redun and joblib.Memory: first run, and nothing to do.

    python benchmarks/workflow_managers.py [--rounds 3] [NAME ...]

A chain of two stages, then 20 branches of four; each stage takes the square root of a 64 x 64 array, adds a number,
and its result is a file. Every manager is used as its manual does: DVC and Snakemake start a process for each stage,
redun, joblib and optibench call functions. Whole commands are timed, the start of Python and all imports included, each
on a folder of its own that is laid out anew for every first run; the median of the rounds stands. The rivals are
installed into environments of their own below the user's cache (a minute or two, once); one that cannot be
installed is left out, with the reason.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from rivals import dvc_pipeline, joblib_script, our_package, redun_workflow, snakefile

BRANCHES, DEPTH = 20, 4
OURS = "optibench"


@dataclass(frozen=True)
class Stage:
    """A stage of the graph: its name, the stage before it, and the number that it adds."""

    name: str
    before: str
    number: int


def graph() -> Iterator[Stage]:
    """All stages, each after the one it needs."""
    yield Stage("first", "", 0)
    yield Stage("second", "first", 1)
    for branch in range(BRANCHES):
        for depth in range(DEPTH):
            before = f"b{branch}_{depth - 1}" if depth else "second"
            yield Stage(f"b{branch}_{depth}", before, 2 + branch * DEPTH + depth)


@dataclass(frozen=True)
class Manager:
    """A workflow manager.

    Attributes
    ----------
    lay_out : callable
        Writes what it needs into an empty folder.
    command : list of str
        Carries the graph out, in that folder; ``{bin}`` stands for the folder of the environment's programs.
    packages : tuple of str
        What to install.
    once : list of str, optional
        To be run in the folder before the first run, not timed.
    environment : dict of str to str
        Variables that it is run with.
    results : str
        Pattern of the files of results, relative to the folder.
    """

    lay_out: Callable[[Path, list[Stage]], None]
    command: list[str]
    packages: tuple[str, ...] = ()
    once: list[str] = field(default_factory=list)
    environment: dict[str, str] = field(default_factory=dict)
    results: str = "*.npy"


CORES = str(len(os.sched_getaffinity(0)))

MANAGERS = {
    OURS: Manager(
        our_package,
        ["{bin}/python", "-m", "pipeline", "--config-dir", "configs", "+experiment=tiny", "paths.runs=runs"],
        environment={"PYTHONPATH": "."},
        results="runs/.store/objects/*/*/period_um.npy",
    ),
    "joblib": Manager(joblib_script, ["{bin}/python", "work.py"], ("joblib", "numpy"), results="cache/**/output.pkl"),
    "redun": Manager(
        redun_workflow, ["{bin}/redun", "run", "workflow.py", "main"], ("redun", "numpy"), results="results/*.npy"
    ),
    "snakemake": Manager(
        snakefile,
        ["{bin}/snakemake", "--cores", CORES, "--quiet", "all"],
        ("snakemake", "numpy"),
        results="results/*.npy",
    ),
    "dvc": Manager(
        dvc_pipeline,
        ["{bin}/dvc", "repro", "--quiet"],
        ("dvc", "numpy"),
        once=["{bin}/dvc", "init", "--no-scm", "--quiet"],
        environment={"DVC_NO_ANALYTICS": "1", "DVC_STUDIO_OFFLINE": "1"},
        results="results/*.npy",
    ),
}


def programs(name: str, packages: tuple[str, ...]) -> Path:
    """Folder of the programs of an environment in which the packages are installed.

    Raises
    ------
    RuntimeError
        They cannot be.
    """
    if not packages:
        return Path(sys.executable).parent
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = cache / "optibench" / "benchmarks" / name
    done = folder / ".installed"
    if not done.is_file():
        print(f"installing {name} into {folder}", file=sys.stderr, flush=True)
        shutil.rmtree(folder, ignore_errors=True)
        venv.create(folder, with_pip=True)
        pip = [str(folder / "bin" / "python"), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        tried = subprocess.run([*pip, *packages], check=False, capture_output=True, text=True)
        if tried.returncode:
            raise RuntimeError(f"pip install {' '.join(packages)}: {last_line(tried.stderr)}")
        done.touch()
    return folder / "bin"


def version(bin_folder: Path, name: str) -> str:
    code = f"import importlib.metadata as m; print(m.version({name!r}))"
    return subprocess.run(
        [bin_folder / "python", "-c", code], check=True, capture_output=True, text=True
    ).stdout.strip()


def seconds(command: list[str], folder: Path, environment: dict[str, str]) -> float:
    """Wall seconds of a command.

    Raises
    ------
    RuntimeError
        It fails.
    """
    start = time.perf_counter()
    done = subprocess.run(command, check=False, cwd=folder, env=environment, capture_output=True, text=True)
    taken = time.perf_counter() - start
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {last_line(done.stderr or done.stdout)}")
    return taken


def last_line(text: str) -> str:
    return next((line for line in reversed(text.splitlines()) if line.strip()), "it failed without a word")


def measured(manager: Manager, bin_folder: Path, place: Path, rounds: int) -> tuple[float, float]:
    """Median seconds of a first run and of one with nothing to do."""
    stages = list(graph())
    environment = {**os.environ, **manager.environment}
    environment["PATH"] = f"{bin_folder}{os.pathsep}{environment['PATH']}"
    fill = [[word.format(bin=bin_folder) for word in words] for words in (manager.command, manager.once)]
    first, again = [], []
    for number in range(rounds):
        folder = place / str(number)
        folder.mkdir(parents=True)
        manager.lay_out(folder, stages)
        if fill[1]:
            seconds(fill[1], folder, environment)
        time.sleep(0.2)  # files that are being written are read anew by whoever is careful
        first.append(seconds(fill[0], folder, environment))
        found = sum(path.stat().st_size > 0 for path in folder.glob(manager.results))
        if found != len(stages):
            raise RuntimeError(f"{found} results instead of {len(stages)}")
        again.append(seconds(fill[0], folder, environment))
    return statistics.median(first), statistics.median(again)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(MANAGERS)}; all of them if none")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", type=Path, help="a file for the figures")
    chosen = parser.parse_args()
    load = os.getloadavg()[0]
    print(f"{len(list(graph()))} stages, {CORES} cores, load {load:.1f}, median of {chosen.rounds} rounds, seconds\n")
    figures: dict[str, tuple[float, float]] = {}
    left_out = {}
    header = (
        f"{'manager':<12}{'version':>12}{'first run':>12}{'nothing to do':>16}{'first/ours':>13}{'nothing/ours':>15}"
    )
    print(header, flush=True)
    with tempfile.TemporaryDirectory() as name:
        for manager in [OURS, *(n for n in chosen.names or MANAGERS if n != OURS)]:
            kind = MANAGERS[manager]
            try:
                bin_folder = programs(manager, kind.packages)
                figures[manager] = measured(kind, bin_folder, Path(name) / manager, chosen.rounds)
            except (RuntimeError, subprocess.CalledProcessError) as error:
                left_out[manager] = str(error)
                continue
            first, again = figures[manager]
            ratios = [a / b for a, b in zip(figures[manager], figures.get(OURS, (first, again)), strict=True)]
            line = f"{manager:<12}{version(bin_folder, manager):>12}{first:>12.2f}{again:>16.2f}"
            print(line + f"{ratios[0]:>13.1f}{ratios[1]:>15.1f}", flush=True)
    for manager, reason in left_out.items():
        print(f"{manager}: left out: {reason}")
    if chosen.json:
        chosen.json.write_text(json.dumps(figures))


if __name__ == "__main__":
    main()
