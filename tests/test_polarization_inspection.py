"""The inspection as a whole: a damaged logo against a golden one, simulated and replayed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pipeline
from pipeline.cli import main
from pipeline.errors import InputError, InputErrors
from pipeline.runs import Run

SMALL = [
    "graph.sample.pixel_mm=0.02",
    "graph.golden_sample.pixel_mm=0.02",
    "rig.camera.pixel_mm=0.06",
    "golden_rig.camera.pixel_mm=0.06",
]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs")


def run(results: Path, *overrides: str) -> Run:
    return pipeline.run("polarization_inspection", [*overrides, f"paths.runs={results}"])


@pytest.fixture(scope="module")
def small(results: Path) -> Run:
    return run(results, *SMALL)


def test_all_but_a_defect_of_two_pixels_is_found_and_nothing_else(small: Run) -> None:
    assert small.metrics["defects_drawn"] == 10
    assert small.metrics["defects_found"] >= 9
    assert small.metrics["missed_largest_mm"] < 0.15
    assert small.metrics["false_alarms"] == 0
    assert small.metrics["kind_right_percent"] == 100
    assert small.metrics["position_error_max_mm"] < 0.09
    assert small["inspection"].turn_rad == pytest.approx(np.deg2rad(2.4), abs=1e-3)


def test_an_item_without_defects_has_none(results: Path) -> None:
    clean = run(results, *SMALL, "graph.flaws.listed=[]", "rig.camera.seed=7", "graph.item.turn_deg=-6")
    assert clean.metrics["defects_drawn"] == clean.metrics["defects"] == 0
    assert clean.metrics["false_alarms"] == 0


def test_the_list_is_in_the_report_and_in_a_file(small: Run) -> None:
    page = small.report.read_text()
    assert "numbered boxes: the defects" in page
    lines = (small.path / "outputs" / "inspection.csv").read_text().splitlines()
    assert len(lines) == 1 + len(small["inspection"].defects.kind)


def test_either_item_or_both_may_be_replayed(results: Path, small: Run, tmp_path: Path) -> None:
    for node in ("golden_photos", "photos"):
        assert main(["export", str(small.path), node, str(tmp_path / node)]) == 0
    golden = ["rig@golden_rig=replay", f"golden_rig.folder={tmp_path / 'golden_photos'}"]
    item = ["rig=replay", f"rig.folder={tmp_path / 'photos'}"]
    one = run(results, *SMALL[::2], *golden)
    assert one.nodes["inspection"].artifact == small.nodes["inspection"].artifact
    assert one.nodes["evaluate"].status == "cached"
    both = run(results, *golden, *item)
    assert both.nodes["inspection"].artifact == small.nodes["inspection"].artifact
    assert {both.nodes[n].status for n in ("sample", "golden_sample", "flaws", "evaluate")} == {"absent"}


def test_a_second_rig_is_checked_as_the_first(results: Path) -> None:
    with pytest.raises(InputError, match="there is no rig 'replya'"):
        run(results, "rig@golden_rig=replya")
    with pytest.raises((InputError, InputErrors), match="has no setting 'pixl_mm'"):
        run(results, "golden_rig.camera.pixl_mm=0.06")
    with pytest.raises(InputError, match="there is no section 'other_rig'"):
        run(results, "other_rig.folder=photos")
