"""What orientations and periods from flash photographs cost, as experiments: each YAML run small."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.bench import Experiment
from pipeline.execution.outcome import Silent
from pipeline.graph.config import options
from pipeline.sweeps import Sweep, run_sweep

SMALL = ("rig.camera.samples=1", "rig.light.wavelength_step_nm=5")
PAPERS = {"polygons": "flash_polygons", "stars": "flash_stars", "kinematic": "flash_kinematic"}
POINTS = {
    "tradeoff_flash": (*SMALL, "paper=polygons", "sheet=3x2", "photographs=1,3", "method=lobe"),
    "tradeoff_flash_camera": (*SMALL, "paper=polygons", "camera=px_600", "photographs=1", "method=threshold_3,lobe"),
    "tradeoff_flash_period": (
        *SMALL,
        "filtered_rig.camera.samples=1",
        "rig.camera.size_px=[600,400]",
        "filtered_rig.camera.size_px=[600,400]",
        "paper=polygons",
        "photographs=1",
        "green=1",
        "period_method=naive,auto",
    ),
}


def swept(folder: Path, study: str) -> Sweep:
    timed = ["tradeoff.repeats=1"] if study.startswith("tradeoff") else []
    done = run_sweep([f"+experiment={study}", f"paths.runs={folder}", *timed, *POINTS[study]], [], Silent())
    assert not done.failed
    return done


def figures(done: Sweep, figure: str, *settings: str) -> dict[tuple[str, ...], float]:
    return {tuple(p.settings[name] for name in settings): p.run.metrics[figure] for p in done.points}


def test_every_tradeoff_of_flash_photographs_is_tried_here() -> None:
    assert {name for name in options("experiment") if name.startswith("tradeoff_flash")} == {
        name for name in POINTS if name.startswith("tradeoff")
    }


@pytest.mark.parametrize(("paper", "experiment"), PAPERS.items())
def test_the_papers_are_those_of_their_experiments(paper: str, experiment: str) -> None:
    study = Experiment.load(["+experiment=tradeoff_flash", f"paper={paper}"]).graph.nodes
    own = Experiment.load([f"+experiment={experiment}"]).graph.nodes
    for name in ("sample", "photos", "tiles", "fit"):
        assert study[name].entry.name == own[name].entry.name
        assert study[name].settings == own[name].settings


def test_more_photographs_light_more_and_the_whole_chain_is_timed(tmp_path: Path) -> None:
    done = swept(tmp_path, "tradeoff_flash")
    unlit = figures(done, "masked_share_percent", "photographs")
    assert unlit["3",] < unlit["1",] - 10
    row = done.table()[0]
    chain = ("merged", "rectified", "tiles", "highlights", "fit")
    assert row["timed_seconds"] == pytest.approx(sum(row[f"{name}_seconds"] for name in chain))


def test_lobes_are_worth_their_seconds_on_a_coarse_picture(tmp_path: Path) -> None:
    errors = figures(swept(tmp_path, "tradeoff_flash_camera"), "orientation_error_median_deg", "method")
    assert errors["lobe",] < 0.3 * errors["threshold_3",]


def test_one_number_for_all_is_nearer_than_each_views_period(tmp_path: Path) -> None:
    errors = figures(swept(tmp_path, "tradeoff_flash_period"), "period_error_mean_percent", "period_method")
    assert errors["auto",] < 0.5
    assert errors["auto",] < 0.5 * errors["naive",]
