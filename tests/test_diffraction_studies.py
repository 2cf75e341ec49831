"""Where evaluators of diffraction fail and what they cost, as experiments: each YAML run small."""

from __future__ import annotations

from pathlib import Path

import pytest

import pipeline
from pipeline.execution.outcome import Silent
from pipeline.graph.config import options
from pipeline.sweeps import Sweep, run_sweep

TINY = ("graph.brdf.size_px=21", "graph.reference.size_px=21")
QUICK = ("graph.brdf.wavelength_step=20", "graph.reference.wavelength_step=20")
POINTS = {
    "limits_diffraction": ("depth_um=0.25,2", "method=chebyshev,flss_30", "size_px=11", "graph.surface.pitch_um=0.05"),
    "limits_diffraction_pitch": ("pitch_um=0.05,0.5", "graph.truth.pitch_um=0.025", *TINY, *QUICK),
    "limits_diffraction_steps": ("bits=3,8", "surface=cosine", *TINY, *QUICK),
    "limits_diffraction_patch": ("width_um=3,10", "coherence_um=16", *TINY, *QUICK),
    "limits_diffraction_windows": ("surface=blaze", "graph.moved.right=0,0.3", "graph.moved.up=0"),
    "limits_diffraction_samples": (
        *("surface=cosine", "distance_mm=900", "samples=1,9", "graph.reference.samples=24"),
        *("graph.shading.size_px=40", "graph.reference.size_px=40"),
    ),
    "limits_diffraction_grazing": ("angle_deg=0,85", "graph.brdf.size_px=41", "graph.brdf.wavelength_step=20"),
    "tradeoff_diffraction": ("surface=blaze", "method=chebyshev_4,flss", "size_px=11", "graph.surface.pitch_um=0.1"),
    "tradeoff_wavelengths": ("surface=blaze", "step_nm=null,50", "coherence_um=16", *TINY),
}


def swept(folder: Path, study: str) -> Sweep:
    timed = ["tradeoff.repeats=2"] if study.startswith("tradeoff") else []
    done = run_sweep([f"+experiment={study}", f"paths.runs={folder}", *timed, *POINTS[study]], [], Silent())
    assert not done.failed
    return done


def test_every_study_of_diffraction_is_tried_here() -> None:
    names = {name for name in options("experiment") if name.startswith(("limits_diffraction", "tradeoff_"))}
    assert {name for name in names if not name.endswith(("polarization", "rendering", "environment"))} == set(POINTS)


def test_thirty_taylor_terms_fail_on_a_deep_blaze_and_say_so(tmp_path: Path) -> None:
    pytest.importorskip("finufft")
    done = swept(tmp_path, "limits_diffraction")
    for point in done.points:
        error, bound = (point.run.metrics[n] for n in ("brdf_error_max_percent", "amplitude_error_bound"))
        fails = point.settings["method"] == "flss_30" and point.settings["depth_um"] == "2"
        assert (error > 100) == fails
        assert (bound > 1e-3) == fails
        assert any("terms leave an amplitude error" in text for text in point.run.nodes["brdf"].warnings) == fails


def test_a_coarse_pitch_errs_and_is_warned_of(tmp_path: Path) -> None:
    done = swept(tmp_path, "limits_diffraction_pitch")
    errors = {p.settings["pitch_um"]: p.run.metrics["brdf_error_rms_percent"] for p in done.points}
    assert errors["0.5"] > 20
    assert errors["0.05"] < 2
    warned = {p.settings["pitch_um"] for p in done.points if p.run.nodes["brdf"].warnings}
    assert warned == {"0.5"}


def test_coarse_steps_of_height_err_and_eight_bits_do(tmp_path: Path) -> None:
    done = swept(tmp_path, "limits_diffraction_steps")
    errors = {p.settings["bits"]: p.run.metrics["brdf_error_rms_percent"] for p in done.points}
    assert errors["3"] > 10 * errors["8"]
    assert errors["8"] < 1


def test_a_square_that_holds_whole_periods_is_as_good_as_the_map(tmp_path: Path) -> None:
    done = swept(tmp_path, "limits_diffraction_patch")
    errors = {p.settings["width_um"]: p.run.metrics["brdf_error_rms_percent"] for p in done.points}
    assert errors["10"] < 1
    assert errors["3"] > 20
    assert not any(point.run.nodes["brdf"].warnings for point in done.points)
    assert all("taken to repeat within it" in " ".join(point.run.nodes["brdf"].notes) for point in done.points)


def test_where_a_blaze_begins_does_not_matter(tmp_path: Path) -> None:
    done = swept(tmp_path, "limits_diffraction_windows")
    first, second = (point.run.metrics["period_um"] for point in done.points)
    assert first == pytest.approx(2.5, abs=1e-5)
    assert second == pytest.approx(first, abs=1e-6)


def test_more_samples_are_nearer_to_many(tmp_path: Path) -> None:
    done = swept(tmp_path, "limits_diffraction_samples")
    one, nine = (point.run.metrics["picture_error_rms_percent"] for point in done.points)
    assert one > 1.3 * nine > 0


def test_grooves_keep_grazing_views_finite(tmp_path: Path) -> None:
    done = swept(tmp_path, "limits_diffraction_grazing")
    largest = {
        (p.settings["angle_deg"], p.settings["graph.brdf.shadowed"]): p.run.metrics["brdf_largest"] for p in done.points
    }
    assert largest["85", "False"] > largest["85", "True"]


@pytest.mark.parametrize("study", [name for name in POINTS if name.startswith("tradeoff_")])
def test_studies_of_accuracy_and_speed_chart_both(study: str, tmp_path: Path) -> None:
    if study == "tradeoff_diffraction":
        pytest.importorskip("finufft")
    done = swept(tmp_path, study)
    assert {"brdf_seconds", "pareto"} <= set(done.table()[0])
    rough, fine = (
        min(
            row["brdf_error_rms_percent"]
            for row in done.table()
            if (row.get("step_nm") == "50" or row.get("method") == "chebyshev_4") == is_rough
        )
        for is_rough in (True, False)
    )
    assert float(fine) < float(rough)


@pytest.mark.parametrize("surface", ["blaze", "cosine", "bumps", "cd"])
def test_every_surface_that_is_made_has_a_brdf_map(surface: str, tmp_path: Path) -> None:
    words = [
        f"surface={surface}",
        "graph.surface.pitch_um=0.1",
        "graph.brdf.size_px=31",
        "graph.brdf.wavelength_step=20",
    ]
    done = pipeline.run("diffraction_brdf_map", [*words, f"paths.runs={tmp_path}"])
    assert done["brdf"].rgb.shape == (3, 31, 31, 3)
    assert done.metrics["brdf_largest"] > 0
    assert {"brdf_0.exr", "brdf_2.png"} <= {p.name for p in done.path.glob("outputs/*")}
    assert "Seen from all directions above" in done.report.read_text()
