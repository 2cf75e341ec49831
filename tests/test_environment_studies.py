"""Where rendering in light probes fails and what it costs, as experiments: each YAML run small."""

from __future__ import annotations

from pathlib import Path

from pipeline.execution.outcome import Silent
from pipeline.graph.config import options
from pipeline.sweeps import Sweep, run_sweep

POINTS = {
    "limits_environment": ("lamp_deg=8,0.5", "coherence_um=16", "size_px=[12,12]", "graph.probe.rows=128"),
    "limits_environment_grazing": ("period_um=3,0.6", "camera=0_deg,85_deg", "graph.sample.pixel_mm=2.0"),
    "tradeoff_environment": (
        *("environment=room", "method=sum_40,ordered_1", "size_px=[60,30]", "graph.sample.pixel_mm=4.0"),
        *("graph.probe.rows=64", "graph.reference.wavelength_step_nm=5", "tradeoff.repeats=2"),
    ),
}


def swept(folder: Path, study: str) -> Sweep:
    done = run_sweep([f"+experiment={study}", f"paths.runs={folder}", *POINTS[study]], [], Silent())
    assert not done.failed
    return done


def test_every_study_of_light_probes_is_tried_here() -> None:
    assert {name for name in options("experiment") if name.endswith(("_environment", "_environment_grazing"))} == {
        *POINTS,
        "render_environment",
    }


def test_a_sun_as_narrow_as_the_window_shows_what_the_delta_response_leaves_out(tmp_path: Path) -> None:
    done = swept(tmp_path, "limits_environment")
    errors = {p.settings["lamp_deg"]: p.run.metrics["picture_error_max_percent"] for p in done.points}
    assert errors["0.5"] > 2 * errors["8"] > 0
    assert all(abs(p.run.metrics["picture_light_percent"] - 100) < 15 for p in done.points)


def test_scalar_theory_keeps_energy_from_above_and_loses_it_at_grazing_views(tmp_path: Path) -> None:
    done = swept(tmp_path, "limits_environment_grazing")
    light = {
        (p.settings["period_um"], p.settings["camera"]): p.run.metrics["picture_light_percent"] for p in done.points
    }
    assert abs(light["3", "0_deg"] - 100) < 3
    assert abs(light["0.6", "85_deg"] - 100) > 30


def test_fewer_look_ups_are_charted_against_coarser_sums(tmp_path: Path) -> None:
    table = swept(tmp_path, "tradeoff_environment").table()
    assert {"rendering_seconds", "pareto"} <= set(table[0])
    errors = {row["method"]: float(row["picture_error_rms_percent"]) for row in table}
    assert errors["ordered_1"] < errors["sum_40"]
