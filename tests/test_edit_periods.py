"""The config group of maps, and the experiment that edits them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pipeline
from pipeline.bench import Experiment
from pipeline.errors import InputError, InputErrors
from pipeline.graph.compose import compose
from pipeline.graph.config import options
from pipeline.optics.angles import axial_difference
from pipeline.runs import Run
from pipeline.stages.edit.blended_period import blended_period
from pipeline.stages.extract.drawn_orientation import drawn_orientation
from pipeline.stages.simulate.circles import circles

NEEDED = {
    "file": ["graph.orientation.file=map.npy", "graph.period.file=map.npy"],
    "run": ["graph.orientation.file=runs/x"],
    "vector": ["graph.sample.file=design.svg"],
    "picture": ["graph.sample.file=design.png"],
}


@pytest.fixture(scope="module")
def edited(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("runs")
    return pipeline.run("edit_periods", ["graph.sample.pixel_mm=2.0", f"paths.runs={folder}"])


@pytest.mark.parametrize("maps", options("maps"))
def test_every_option_gives_the_two_maps(maps: str) -> None:
    nodes = Experiment.load(["+experiment=edit_periods", f"maps={maps}", *NEEDED.get(maps, [])]).graph.nodes
    assert (nodes["orientation"].entry.type, nodes["period"].entry.type) == ("OrientationMap", "PeriodMap")
    assert ("sample" in nodes) == (maps not in ("file", "run"))


def test_the_files_of_maps_have_to_be_named() -> None:
    given = ["graph.orientation.file=map.npy"]
    with pytest.raises(
        InputErrors, match=r"'file' is not given\s+where: +.*maps/file.yaml, line 11: graph.period.file"
    ):
        Experiment.load(["+experiment=edit_periods", "maps=file", *given])
    with pytest.raises(InputError, match=r"'graph.orientation.file' is not given[\s\S]*graph.orientation.file=VALUE"):
        Experiment.load(["+experiment=edit_periods", "maps=run"])
    with pytest.raises(InputError, match=r"there is no maps 'circle'\s[\s\S]*did you mean 'circles'"):
        Experiment.load(["+experiment=edit_periods", "maps=circle"])


def test_a_study_may_ask_for_heat_maps_beside_the_group_of_that_name(tmp_path: Path) -> None:
    (tmp_path / "experiment").mkdir()
    study = "# @package _global_\ndefaults: [edit_periods, _self_]\nmaps: {rows: graph.sine.bins, metrics: [x]}\n"
    (tmp_path / "experiment" / "study.yaml").write_text(study)
    words = ["experiment=study", "maps=kinematic", "maps.columns=maps"]
    asked = compose(words, [tmp_path])
    assert asked.content["maps"] == {"rows": "graph.sine.bins", "columns": "maps", "metrics": ["x"]}
    assert asked.content["graph"]["sample"]["stage"] == "simulate.kinematic_tile"
    assert asked.where("maps.rows").endswith("study.yaml, line 3: maps.rows")
    assert asked.where("maps.columns") == "override maps.columns=maps"
    assert asked.where("graph.sample.stage").endswith("maps/kinematic.yaml, line 4: graph.sample.stage")


def test_the_maps_are_the_drawn_ones(edited: Run) -> None:
    sample, orientation, period = edited["sample"], edited["orientation"], edited["period"]
    np.testing.assert_array_equal(orientation.orientation_rad, sample.orientation_rad)
    np.testing.assert_array_equal(period.period_um, sample.period_um)
    np.testing.assert_array_equal(orientation.mask, sample.diffracts)
    np.testing.assert_array_equal(period.mask, sample.diffracts)
    assert (orientation.pixel_mm, orientation.absolute, period.pixel_mm, period.relative) == (2.0, True, 2.0, False)


def test_each_edit_is_rendered_and_differs_from_the_original(edited: Run) -> None:
    original = edited["rendering"].rgb
    for name in ("quadratic", "sine"):
        period = edited[name].period_um
        assert np.nanmin(period) == pytest.approx(1.0, rel=1e-3)
        assert 1.95 < np.nanmax(period) <= 2.0  # 179 degrees hardly occur on a coarse map
        assert np.abs(original - edited[f"rendering_{name}"].rgb).max() > 0.5
    assert np.abs(edited["rendering_quadratic"].rgb - edited["rendering_sine"].rgb).max() > 0.1


def test_maps_of_that_run_give_the_same_edit(edited: Run, tmp_path: Path) -> None:
    words = ["maps=run", f"graph.orientation.file={edited.path}", "until=[quadratic,period]"]
    again = pipeline.run("edit_periods", [*words, f"paths.runs={tmp_path}"])
    assert again.nodes["quadratic"].artifact == edited.nodes["quadratic"].artifact
    assert again.nodes["period"].artifact == edited.nodes["period"].artifact


def test_orientations_up_to_an_offset_are_edited_with_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    drawn = drawn_orientation(circles(pixel_mm=0.5))
    blended_period(drawn)
    assert not caplog.records
    blended_period(replace(drawn, absolute=False))
    assert "begins at an orientation that is not known" in caplog.text


def test_no_blend_is_refused() -> None:
    drawn = drawn_orientation(circles(pixel_mm=0.5))
    with pytest.raises(InputError, match=r"shortest_um is 3, and longest_um 2\s"):
        blended_period(drawn, shortest_um=3.0)
    with pytest.raises(InputError, match=r"bins is 1\s[\s\S]*at least 2, one for each end"):
        blended_period(drawn, bins=1)


def at(values: np.ndarray, x_mm: float, y_mm: float, pixel_mm: float) -> float:
    side = len(values)
    return float(values[int(side / 2 - y_mm / pixel_mm), int(side / 2 + x_mm / pixel_mm)])


def test_circles_diffract_along_their_radii() -> None:
    sample = circles(width_mm=20.0, count=2, pixel_mm=0.05, gap_mm=1.0, hub_mm=2.0)
    for angle in (10.0, 80.0, 150.0, 260.0):
        x, y = 5 + 3 * np.cos(np.deg2rad(angle)), -5 + 3 * np.sin(np.deg2rad(angle))
        found = at(sample.orientation_rad, x, y, 0.05)
        assert abs(np.rad2deg(axial_difference(found, np.deg2rad(angle)))) < 1.5
    assert np.isnan(at(sample.orientation_rad, 5.5, -5.0, 0.05))  # the hub
    assert np.isnan(at(sample.orientation_rad, 0.2, -5.0, 0.05))  # the gap
    area = sample.diffracts.sum() * 0.05**2
    assert area == pytest.approx(4 * np.pi * (4.5**2 - 1**2), rel=0.01)


def test_circles_of_a_line_density() -> None:
    sample = circles(count=1, pixel_mm=0.5, lines_per_mm=1000.0)
    np.testing.assert_array_equal(sample.period_um[sample.diffracts], 1.0)
    np.testing.assert_allclose(np.nanmean(circles(pixel_mm=0.5).period_um), 1000 / 600, rtol=1e-6)


def test_circles_that_leave_nothing_are_refused() -> None:
    with pytest.raises(InputError, match=r"gap_mm 3 and hub_mm 3 leave nothing of discs 5 mm apart\s"):
        circles(count=5, gap_mm=3.0, hub_mm=3.0)
