"""The simulation studies as a whole: each YAML run small, and its figures against what theory and paper say."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
import yaml

import pipeline
from pipeline.bench import Experiment
from pipeline.execution.outcome import Silent
from pipeline.graph.config import options
from pipeline.optics.metals import METALS
from pipeline.sweeps import Sweep, run_sweep


def swept(folder: Path, experiment: str, *words: str) -> Sweep:
    return run_sweep([f"+experiment={experiment}", f"paths.runs={folder}", *words], [], Silent())


def test_one_map_as_it_stands_is_figure_14b(tmp_path: Path) -> None:
    run = pipeline.run("polarization_response", [f"paths.runs={tmp_path}"])
    assert run.metrics["deviation_max_deg"] < 1e-9
    assert run["response"].amplitude_ratio == pytest.approx(1.1)
    outputs = {path.name for path in (run.path / "outputs").iterdir()}
    assert {"response.exr", "response.png", "response_normalised_rows.svg", "evaluate_deviation.svg"} <= outputs
    deviation = list(csv.DictReader((run.path / "outputs" / "evaluate.csv").open()))
    assert [float(row["orientation_deg"]) for row in deviation[:3]] == pytest.approx([0, 1, 2])


def test_figure_14_keeps_the_line_without_a_film_and_loses_it_as_zeta_nears_180_with_one(tmp_path: Path) -> None:
    done = swept(tmp_path, "figure_14", "graph.response.metal=copper", "graph.response.phase_deg=45,180")
    found = {
        tuple(point.settings[f"graph.response.{name}_deg"] for name in ("retardation", "phase")): point.run.metrics
        for point in done.points
    }
    assert set(found) == {("0", "45"), ("0", "180"), ("3", "45"), ("3", "180")}
    assert all(found["0", phase]["deviation_mean_deg"] < 1e-9 for phase in ("45", "180"))
    assert found["3", "45"]["deviation_mean_deg"] == pytest.approx(0.47, rel=0.01)
    assert found["3", "180"]["deviation_mean_deg"] == pytest.approx(26, rel=0.01)
    assert found["3", "180"]["prenormalized_deviation_mean_deg"] < 0.05


def test_figure_15_takes_metals_and_given_ratios_over_the_birefringence(tmp_path: Path) -> None:
    done = swept(tmp_path, "figure_15", "reflector=aluminium,figure_15d", "graph.response.retardation_deg=3,10")
    found = {(row["reflector"], row["graph.response.retardation_deg"]): row for row in done.table()}
    assert len(found) == 4
    assert found["figure_15d", "3"]["deviation_mean_deg"] == pytest.approx(32, rel=0.01)
    assert found["figure_15d", "3"]["prenormalized_deviation_mean_deg"] < 0.05
    assert found["aluminium", "10"]["branch_deviation_mean_deg"] == pytest.approx(0.185, rel=0.02)
    page = (done.folder / "report.html").read_text()
    assert "aluminium" in page
    assert "branch deviation, mean" in page


def test_figure_15_sweeps_all_of_its_surfaces_and_figure_14_all_metals() -> None:
    of = {name: yaml.safe_load(options("experiment")[name].read_text()) for name in ("figure_14", "figure_15")}
    swept_in = {name: content["hydra"]["sweeper"]["params"] for name, content in of.items()}
    surfaces = of["figure_15"]["reflectors"]
    assert swept_in["figure_15"]["reflector"].split(",") == list(surfaces)
    assert set(METALS) == {surface["metal"] for surface in surfaces.values()} - {None}
    assert set(METALS) == set(swept_in["figure_14"]["graph.response.metal"].split(",")) - {"null"}
    for surface, expected in surfaces.items():
        if surface.startswith("figure"):
            node = Experiment.load(["+experiment=figure_15", f"reflector={surface}"]).graph.nodes["response"]
            assert {name: node.settings[name] for name in expected} == expected
