"""What renderers of sheets cost and where they fail, as experiments: each YAML run small."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.execution.outcome import Silent
from pipeline.graph.config import options
from pipeline.sweeps import Sweep, run_sweep

SMALL = ("tiles=[3,2]", "graph.sample.pixel_mm=0.2")
POINTS = {
    "tradeoff_rendering": (*SMALL, "maps=kinematic", "method=sum_5,table_1", "light_sigma_mm=12", "size_px=[90,60]"),
    "limits_rendering": (*SMALL, "size_px=[90,60]", "depth_um=0.02,0.25"),
    "limits_rendering_distance": (*SMALL, "width=px_60", "graph.reference.samples=16"),
    "limits_rendering_grazing": (*SMALL, "elevation=deg_90,deg_2", "size_px=[60,40]", "method=point,averaged"),
    "limits_rendering_light": (
        *SMALL,
        "size_px=[90,60]",
        "light_sigma_mm=0,5",
        "method=sum_20,table_1",
        "coherence_um=65",
    ),
    "limits_rendering_period": ("graph.sample.pixel_mm=2", "period_um=0.5,3", "depth_um=0.12"),
}


def swept(folder: Path, study: str) -> Sweep:
    timed = ["tradeoff.repeats=1"] if study.startswith("tradeoff") else []
    done = run_sweep([f"+experiment={study}", f"paths.runs={folder}", *timed, *POINTS[study]], [], Silent())
    assert not done.failed
    return done


def errors(done: Sweep, *settings: str, figure: str = "picture_error_max_percent") -> dict[tuple[str, ...], float]:
    return {tuple(p.settings[name] for name in settings): p.run.metrics[figure] for p in done.points}


def warned(done: Sweep, text: str, *settings: str, node: str = "rendering") -> set[tuple[str, ...]]:
    return {
        tuple(point.settings[name] for name in settings)
        for point in done.points
        if any(text in warning for warning in point.run.nodes[node].warnings)
    }


def test_every_study_of_rendering_is_tried_here() -> None:
    mine = ("limits_rendering", "tradeoff_rendering")
    assert {name for name in options("experiment") if name.startswith(mine)} == set(POINTS)


def test_sum_and_table_agree_and_are_timed(tmp_path: Path) -> None:
    done = swept(tmp_path, "tradeoff_rendering")
    assert max(errors(done, "method").values()) < 1
    assert {name for row in done.table() for name in row} >= {"rendering_seconds", "pareto"}


def test_the_expansion_fails_on_deep_gratings_and_says_so(tmp_path: Path) -> None:
    done = swept(tmp_path, "limits_rendering")
    found = errors(done, "method", "depth_um")
    assert found["second_order_5", "0.25"] > 30
    assert warned(done, "Orders expanded", "method", "depth_um") == {("second_order_5", "0.25")}
    told = warned(done, "", "method", "depth_um")
    assert all(error < 1 for point, error in found.items() if point not in told)


def test_small_pictures_need_averages(tmp_path: Path) -> None:
    found = errors(swept(tmp_path, "limits_rendering_distance"), "method", figure="picture_error_rms_percent")
    assert found["point",] > 5
    assert found["averaged",] < 0.3 * found["point",]


def test_flat_views_need_averages(tmp_path: Path) -> None:
    found = errors(
        swept(tmp_path, "limits_rendering_grazing"), "method", "elevation", figure="picture_error_rms_percent"
    )
    for elevation in ("deg_90", "deg_2"):
        assert found["point", elevation] > 2 * found["averaged", elevation]


def test_wide_steps_leave_stripes_under_a_point_of_light_and_are_warned_of(tmp_path: Path) -> None:
    done = swept(tmp_path, "limits_rendering_light")
    found = errors(done, "method", "light_sigma_mm")
    assert found["sum_20", "0"] > 5
    del found["sum_20", "0"]
    assert max(found.values()) < 1
    assert warned(done, "too coarse", "method", "light_sigma_mm") == {("sum_20", "0")}


def test_scalar_theory_loses_light_near_the_wavelength(tmp_path: Path) -> None:
    found = errors(swept(tmp_path, "limits_rendering_period"), "period_um", figure="leaving_percent")
    assert found["3",] == pytest.approx(100, abs=0.1)
    assert found["0.5",] < 60
