"""Every YAML file composes into a checked graph, and travels inside the wheel."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.bench import Experiment
from pipeline.graph.config import configs_folder, options

ROOT = Path(__file__).resolve().parents[2]
RIG_WORDS = {"replay": ["rig.folder=photos"], "flash_replay": ["rig.folder=photos"]}


def takes_photographs(path: Path) -> bool:
    return "override /rig:" in path.read_text()


def of_one_kind() -> Iterator[tuple[str, str]]:
    """Experiments that take photographs, on the rigs that take those."""
    for experiment, path in options("experiment").items():
        if takes_photographs(path):
            for rig in options("rig"):
                if rig.startswith("flash") == experiment.startswith("flash"):
                    yield experiment, rig


@pytest.mark.parametrize(("experiment", "rig"), list(of_one_kind()))
def test_every_experiment_is_right_on_every_rig(experiment: str, rig: str) -> None:
    graph = Experiment.load([f"+experiment={experiment}", f"rig={rig}", *RIG_WORDS.get(rig, [])]).graph
    assert ("fit" in graph.nodes) == (experiment != "flash_stochastic" or rig.endswith("simulated"))  # needs a filter
    assert ("sample" in graph.nodes) == rig.endswith("simulated")
    assert ("evaluate" in graph.nodes) == rig.endswith("simulated")


@pytest.mark.parametrize("experiment", [n for n, path in options("experiment").items() if not takes_photographs(path)])
def test_every_experiment_without_photographs_is_right(experiment: str) -> None:
    assert Experiment.load([f"+experiment={experiment}"]).graph.nodes


@pytest.mark.parametrize("executor", options("executor"))
def test_every_executor_composes(executor: str) -> None:
    assert Experiment.load(["+experiment=polarization_logo", f"executor={executor}"]).graph.nodes


@pytest.mark.parametrize(
    "path",
    [p for g in ("experiment", "rig", "executor", "surface", "maps") for p in options(g).values()],
    ids=lambda p: p.stem,
)
def test_every_file_names_its_own_command(path: Path) -> None:
    assert "python -m pipeline +experiment=" in path.read_text()


def test_the_wheel_carries_the_configs_and_runs_elsewhere(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run([*build, "--wheel-dir", str(tmp_path), str(ROOT)], check=True, capture_output=True)
    (wheel,) = tmp_path.glob("optibench-*.whl")
    installed = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(installed)
    for path in configs_folder().rglob("*.yaml"):
        assert (installed / "pipeline" / "configs" / path.relative_to(configs_folder())).is_file()
    for path in (ROOT / "pipeline").rglob("*"):
        if path.is_file() and path.suffix in {".py", ".eds", ".css", ".j2"}:
            assert (installed / path.relative_to(ROOT)).is_file()
    empty = tmp_path / "empty"
    empty.mkdir()
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    command = [sys.executable, "-m", "pipeline", "why", "+experiment=polarization_logo"]
    done = subprocess.run(command, cwd=empty, env=environment, check=True, capture_output=True, text=True)
    assert "never run" in done.stdout
    assert list(empty.iterdir()) == []
