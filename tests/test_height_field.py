"""The experiment on height fields, on every surface that it can take."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pipeline
from pipeline.bench import Experiment
from pipeline.errors import InputErrors
from pipeline.graph.config import options
from pipeline.runs import Run

MEASURED = ("elaphe", "elaphe_crop", "xenopeltis", "xenopeltis_crop")
MADE = ("blaze", "bumps", "cd", "cosine")


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs")


def run(results: Path, surface: str, *overrides: str) -> Run:
    return pipeline.run("height_field", [f"surface={surface}", *overrides, f"paths.runs={results}"])


def test_every_surface_is_a_node_of_the_graph() -> None:
    assert set(options("surface")) == {*MEASURED, *MADE, "file"}
    for surface in options("surface"):
        given = ["graph.surface.file=map.npy"] if surface == "file" else []
        node = Experiment.load(["+experiment=height_field", f"surface={surface}", *given]).graph.nodes["surface"]
        assert node.entry.type == "HeightField"


def test_the_default_surface_needs_no_network() -> None:
    assert Experiment.load(["+experiment=height_field"]).graph.nodes["surface"].entry.name == "simulate.blaze"


@pytest.mark.parametrize("surface", MADE)
def test_a_surface_that_is_made_comes_back(results: Path, surface: str) -> None:
    done = run(results, surface, "graph.surface.pitch_um=0.05")
    assert done.metrics["period_1_um"] == pytest.approx(1.6 if surface == "cd" else 2.5, rel=1e-9)
    assert done.metrics["height_difference_percent"] < 0.01
    if surface == "bumps":
        assert done.metrics["period_2_um"] == pytest.approx(2.0, rel=1e-9)
    if surface in ("blaze", "cosine"):
        assert done.metrics["periods"] == 1
    assert {"surface.exr", "level.png", "fit.csv", "fit_spectrum.svg"} <= {p.name for p in done.path.glob("outputs/*")}


def test_a_scans_faults_are_taken_away(results: Path) -> None:
    """A tilt, lines that jump, spikes and noise: 2 percent of the height are left, and the period is known."""
    small = ["graph.surface.pitch_um=0.05", "graph.surface.periodic=false"]
    faults = [
        "tilt_deg=1",
        "tilt_direction_deg=30",
        "line_offset_um=0.02",
        "spikes=100",
        "spike_um=0.5",
        "noise_um=0.001",
    ]
    done = run(results, "blaze", *small, *(f"graph.scan.{fault}" for fault in faults))
    raw = done["scan"].height_um - done["surface"].height_um
    assert raw.std() > 0.08
    assert done.metrics["height_difference_rms_um"] < 0.02 * 0.246
    assert done.metrics["period_1_um"] == pytest.approx(2.5, rel=2e-3)


@pytest.mark.parametrize(("surface", "period_um"), [("elaphe_crop", 1.144), ("xenopeltis", 0.55)])
def test_a_measured_surface_is_levelled(
    results: Path, measurements: Path, monkeypatch: pytest.MonkeyPatch, surface: str, period_um: float
) -> None:
    monkeypatch.setenv("OPTIBENCH_DATA", str(measurements / "afm"))
    done = run(results, surface)
    assert done.metrics["period_1_um"] == pytest.approx(period_um, rel=0.02)
    assert "github.com/simplay/Bachelor-Thesis" in (done.path / "report.html").read_text()


def test_a_map_of_ones_own_is_taken(results: Path, tmp_path: Path) -> None:
    x = np.arange(200) * 0.1
    np.save(tmp_path / "mine.npy", np.tile(0.1 * np.cos(2 * np.pi * x / 1.7), (150, 1)))
    done = run(results, "file", f"graph.surface.file={tmp_path / 'mine.npy'}", "graph.surface.pitch_um=0.1")
    assert done.metrics["period_1_um"] == pytest.approx(1.7, rel=1e-3)


def test_what_a_surface_lacks_is_told_with_its_line(results: Path) -> None:
    with pytest.raises(InputErrors, match=r"'file' is not given\s+where: +.*surface/file.yaml, line 4: graph.surface"):
        run(results, "file")
    with pytest.raises(InputErrors, match=r"there is no file or folder .*none.npy[\s\S]*where: +graph.surface.file"):
        run(results, "file", "graph.surface.file=none.npy", "graph.surface.pitch_um=0.1")
