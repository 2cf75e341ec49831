"""Where estimators fail, as experiments: each YAML run small."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.execution.outcome import Silent
from pipeline.graph.config import options
from pipeline.sweeps import Sweep, run_sweep

SMALL = ("rig.camera.pixel_mm=0.18", "scenes.facets.sample.pixel_mm=0.06", "rig.camera.blur_mm=0.05")
POINTS = {
    "bunched": ("bunch=three",),
    "misread": ("graph.misread.scatter_deg=0,4",),
    "modulation": ("phase_deg=90,176",),
    "polarization": ("phase_deg=160,45", "retardation_deg=0,15"),
    "saturation": ("rig.camera.full_well_electrons=25000,11000",),
    "shifts": ("rig.camera.shift_px=0,2",),
    "step": ("graph.photos.step_deg=8",),
}


def swept(folder: Path, study: str, *words: str) -> Sweep:
    return run_sweep([f"+experiment=limits_{study}", f"paths.runs={folder}", *SMALL, *words], [], Silent())


def errors(done: Sweep, setting: str) -> dict[tuple[str, str], float]:
    return {
        (point.settings["estimator"], point.settings[setting]): point.run.metrics["error_mean_deg"]
        for point in done.points
    }


def test_every_study_of_limits_is_tried_here() -> None:
    studies = {name.removeprefix("limits_") for name in options("experiment") if name.startswith("limits_")}
    others = ("diffraction", "rendering", "environment", "flash")
    assert {name for name in studies if not name.startswith(others)} == set(POINTS)


@pytest.mark.parametrize("study", POINTS)
def test_every_study_charts_error_and_confidence(study: str, tmp_path: Path) -> None:
    one_map = "maps.metrics=[error_mean_deg]"
    done = swept(tmp_path, study, "estimator=cosine", one_map, *POINTS[study])
    assert not done.failed
    assert done.maps is not None
    assert {"error_mean_deg", "bad_percent", "good_flagged_percent", "bound_mean_deg"} <= set(done.metrics)
    assert "error, mean" in (done.folder / "report.html").read_text()


def test_a_film_turns_the_cosine_and_not_the_curve(tmp_path: Path) -> None:
    words = ("estimator=cosine,jones", "phase_deg=45", "retardation_deg=15")
    found = errors(swept(tmp_path, "polarization", *words), "retardation_deg")
    assert found["cosine", "15"] > 3 * found["jones", "15"]
    assert found["jones", "15"] < 1.0
