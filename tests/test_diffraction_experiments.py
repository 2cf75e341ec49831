"""The experiments on diffraction, small."""

from __future__ import annotations

from pathlib import Path

import pytest

import pipeline
from pipeline.runs import Run

COARSE = ("graph.fit.wavelength_step=50", "graph.fit.angle_step_deg=0.1")


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs")


def run(results: Path, experiment: str, *overrides: str) -> Run:
    return pipeline.run(experiment, [*overrides, f"paths.runs={results}"])


@pytest.mark.parametrize("surface", ["blaze", "bumps", "cd", "cosine"])
def test_a_made_surface_diffracts_as_its_period_says(results: Path, surface: str) -> None:
    done = run(results, "diffraction_peaks", f"surface={surface}", *COARSE)
    assert done.metrics["period_um"] == pytest.approx(1.6 if surface == "cd" else 2.5, rel=1e-4)
    assert done.metrics["peaks"] == len(done["fit"].wavelength_nm)
    assert {"fit.exr", "fit.csv", "fit_response.svg", "fit_period.svg"} <= {p.name for p in done.path.glob("outputs/*")}


@pytest.mark.parametrize("evaluator", ["flss", "nmm", "pq", "pq_sinc"])
def test_evaluators_are_swapped_by_name(results: Path, evaluator: str) -> None:
    done = run(results, "diffraction_peaks", *COARSE, f"graph.fit.evaluator={evaluator}")
    assert done.metrics["period_um"] == pytest.approx(2.5, rel=4e-4)
    assert f"Evaluator: {evaluator}" in (done.path / "report.html").read_text()


@pytest.mark.parametrize(("surface", "period_um"), [("elaphe_crop", 6.5 / 6), ("xenopeltis_crop", 0.65)])
def test_a_patch_that_is_repeated_has_whole_cycles(
    results: Path, measurements: Path, monkeypatch: pytest.MonkeyPatch, surface: str, period_um: float
) -> None:
    """Patches of 6.5 um repeat in the coherence window, so all that they can send is a whole part of 6.5 um."""
    monkeypatch.setenv("OPTIBENCH_DATA", str(measurements / "afm"))
    done = run(results, "diffraction_peaks", f"surface={surface}", "graph.fit.azimuth_deg=90", *COARSE)
    assert done.metrics["period_um"] == pytest.approx(period_um, rel=1e-6)


def test_slits(results: Path) -> None:
    done = run(results, "diffraction_slits", "graph.slits.counts=[1,3]")
    assert done.metrics["fringe_mm"] == pytest.approx(1.6667, rel=1e-4)
    written = {p.name for p in done.path.glob("outputs/*")}
    assert {"slits.csv", "slits.exr", "slits.png", "slits_intensity.svg", "slits_colours.svg"} <= written


def test_the_study_tables_periods_by_surface_and_evaluator(results: Path) -> None:
    words = ["surface=blaze,cosine", "graph.fit.evaluator=chebyshev,pq", *COARSE, f"paths.runs={results}"]
    done = pipeline.sweep("diffraction_periods", words)
    assert [point.settings["surface"] for point in done.points] == ["blaze", "blaze", "cosine", "cosine"]
    assert [row["period_um"] for row in done.table()] == pytest.approx([2.5] * 4, rel=4e-4)
    assert [row["spectrum_period_um"] for row in done.table()] == [2.5] * 4
