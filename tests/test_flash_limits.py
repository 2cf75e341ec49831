"""Where flash photographs fail, as experiments: each YAML run small."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.execution.outcome import Silent
from pipeline.graph.config import options
from pipeline.sweeps import Sweep, run_sweep

SMALL = ("size_px=[300,200]", "rig.camera.samples=1", "rig.light.wavelength_step_nm=5")
MAPS = ("until=[evaluate,trust]", "maps.metrics=[error_mean_deg,stated_error_median_deg,bad_flagged_percent]")
POINTS = {
    "limits_flash": (*SMALL, *MAPS, "wide=percent_0,percent_3", "graph.tiles.motion=translation"),
    "limits_flash_bracket": (*SMALL, *MAPS, "bracket=one"),
    "limits_flash_distances": (*SMALL, "graph.written.light_percent=0,20", "graph.written.camera_percent=20"),
    "limits_flash_filter": (*SMALL, "filter=nm_10,white", "graph.period.method=modelled"),
    "limits_flash_light": ("size_px=[300,200]", "scene=polygons", "light_sigma_mm=4,60"),
    "limits_flash_pixels": (*SMALL[1:], *MAPS, "scene=polygons", "tile_px=px_25"),
    "limits_flash_small": (*SMALL, *MAPS, "sheet=tiles_24,tiles_6", "graph.fit.photographs=5"),
    "limits_flash_turn": (*SMALL, "sectors=10", "graph.fit.method=lobe"),
}


def swept(folder: Path, study: str) -> Sweep:
    done = run_sweep([f"+experiment={study}", f"paths.runs={folder}", *POINTS[study]], [], Silent())
    assert not done.failed
    return done


def warned(done: Sweep, node: str, text: str, setting: str) -> set[str]:
    return {
        point.settings[setting]
        for point in done.points
        if any(text in warning for warning in point.run.nodes[node].warnings)
    }


def figures(done: Sweep, setting: str, name: str) -> dict[str, float]:
    return {point.settings[setting]: point.run.metrics[name] for point in done.points}


def test_every_study_of_flash_photographs_is_tried_here() -> None:
    assert {name for name in options("experiment") if name.startswith("limits_flash")} == set(POINTS)


@pytest.mark.parametrize("study", ["limits_flash_bracket", "limits_flash_pixels", "limits_flash_turn"])
def test_studies_chart_what_is_stated_beside_what_is_wrong(study: str, tmp_path: Path) -> None:
    done = swept(tmp_path, study)
    assert {"error_mean_deg", "stated_error_median_deg", "bad_flagged_percent"} <= set(done.metrics)


def test_tiles_that_lie_beside_each_other_err_and_are_warned_of(tmp_path: Path) -> None:
    done = swept(tmp_path, "limits_flash")
    errors = figures(done, "wide", "error_mean_deg")
    assert errors["percent_3"] > 2 * errors["percent_0"]
    assert warned(done, "tiles", "beside the reference", "wide") == {"percent_3"}


def test_the_highlight_or_the_orders_tell_of_wrong_distances(tmp_path: Path) -> None:
    done = swept(tmp_path, "limits_flash_distances")
    errors = figures(done, "graph.written.light_percent", "orientation_error_median_deg")
    assert errors["0"] > 3 * errors["20"]
    assert warned(done, "highlights", "lies", "graph.written.light_percent") == {"0"}
    assert "20" in warned(done, "period", "as far as stated", "graph.written.light_percent")


def test_white_light_tells_no_period_and_is_warned_of(tmp_path: Path) -> None:
    done = swept(tmp_path, "limits_flash_filter")
    errors = figures(done, "filter", "period_error_mean_percent")
    assert errors["white"] > 5
    assert errors["nm_10"] < 1
    assert warned(done, "period", "without a filter", "filter") == {"white"}


def test_a_large_flash_leaves_most_of_the_tile_unread(tmp_path: Path) -> None:
    lost = figures(swept(tmp_path, "limits_flash_light"), "light_sigma_mm", "masked_share_percent")
    assert lost["4"] < 1
    assert lost["60"] > 50


def test_few_tiles_are_doubted(tmp_path: Path) -> None:
    done = swept(tmp_path, "limits_flash_small")
    stated = figures(done, "sheet", "stated_error_median_deg")
    assert stated["tiles_6"] > 2 * stated["tiles_24"]
    assert warned(done, "fit", "half of the tile", "sheet") == {"tiles_6"}
