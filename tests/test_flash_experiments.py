"""The experiments of flash photographs, run small: what the photographs tell of what was drawn."""

from __future__ import annotations

from pathlib import Path

import pytest

import pipeline
from pipeline.commands.export import export_photos
from pipeline.runs import Run

THREE = "[[40.0,20.0,250.0],[-80.0,50.0,250.0],[-30.0,-90.0,250.0]]"


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs")


def run(results: Path, name: str, *overrides: str, size: str = "[450,300]", samples: int = 1) -> Run:
    """Fewer pixels, exposures and places of the flash; as one store is shared, equal photographs are taken once."""
    cameras = ["rig"] if name == "misaligned" else ["rig", "filtered_rig"]
    small = [
        f"{one}.camera.{word}"
        for one in cameras
        for word in (f"size_px={size}", "exposure_s=[0.0005,0.008,0.128]", f"samples={samples}")
    ]
    if name != "stochastic":
        small += [f"rig.light.lights_mm={THREE}", "graph.sample.pixel_mm=0.2"]
    return pipeline.run(f"flash_{name}", [*small, *overrides, f"paths.runs={results}"])


def test_polygons_come_back_with_one_period_and_look_like_the_photographs(results: Path) -> None:
    done = run(
        results,
        "polygons",
        "until=[evaluate,evaluate_threshold,period_error,rendering_difference]",
        size="[600,400]",
    )
    found = done.metrics
    assert found["fit.lit_percent"] == 100
    assert found["masked_share_percent"] == 0
    assert found["orientation_error_median_deg"] < 0.2
    assert found["orientation_error_median_deg"] < 0.2 * found["evaluate_threshold.orientation_error_median_deg"]
    assert found["period_constant"] == 1
    assert found["period_error_mean_percent"] < 0.3
    assert found["picture_correlation"] > 0.9
    assert done["rendering"].rgb.shape == done["photographed"].rgb.shape


@pytest.mark.parametrize(
    ("name", "period_um", "error_deg"), [("circles", 5 / 3, 3.0), ("stars", 1.3, 8.0), ("kinematic", 1.3, 12.0)]
)
def test_tiles_that_turn_come_back_with_one_period(
    results: Path, name: str, period_um: float, error_deg: float
) -> None:
    """A pixel of half a millimetre holds degrees of turn here, so that the orientation is only roughly right."""
    found = run(results, name, "until=[evaluate,period_error]", samples=2).metrics
    assert found["masked_share_percent"] < 1
    assert found["orientation_error_median_deg"] < error_deg
    assert found["period_constant"] == 1
    assert found["period_um"] == pytest.approx(period_um, rel=0.01)


def test_periods_that_vary_are_mapped(results: Path) -> None:
    found = run(results, "varying", "until=[evaluate,period_error]").metrics
    assert found["orientation_error_median_deg"] < 1
    assert found["period_constant"] == 0
    assert found["period_error_median_percent"] < 1.5
    assert "period_um" not in found


def test_the_published_bias_is_in_what_is_divided_and_not_in_what_is_modelled(results: Path) -> None:
    """Toisoul et al. 2018, section 7.1: mean 1.939 um and standard deviation 0.15 of 1.667 um."""
    found = run(results, "periods", "until=[period,period_naive]", size="[600,400]").metrics
    assert found["period_naive.period_mean_um"] == pytest.approx(1.939, abs=0.1)
    assert found["period_naive.period_std_um"] == pytest.approx(0.15, abs=0.05)
    assert found["period.period_mean_um"] == pytest.approx(5 / 3, rel=0.02)
    assert found["period.period_std_um"] < 0.05
    assert found["period_um"] == pytest.approx(5 / 3, rel=0.005)


def test_translated_tiles_err_at_edges_and_aligned_ones_do_not(results: Path) -> None:
    """Toisoul et al. 2018, section 7.2."""
    found = run(results, "misaligned", size="[600,400]").metrics
    assert found["tiles_translated.residual_px"] > 1
    assert found["tiles.residual_px"] < 0.5
    for method in ("", "_threshold"):
        aligned, translated = (f"edges{method}{kind}" for kind in ("", "_translated"))
        assert found[f"{translated}.edge_error_mean_deg"] > 1.7 * found[f"{aligned}.edge_error_mean_deg"]
        assert found[f"{translated}.edge_error_mean_deg"] > 5 * found[f"{translated}.inner_error_mean_deg"]


def test_stochastic_paper_gives_its_distribution_and_needs_a_filter_for_it(results: Path) -> None:
    fits = ("fit", "fit_unfiltered")
    coarse = [f"graph.{fit}.{bins}" for fit in fits for bins in ("orientations=36", "periods=24")]
    found = run(results, "stochastic", *coarse, "until=[evaluate,evaluate_unfiltered,pattern]").metrics
    assert found["distribution_distance_percent"] < 45
    assert found["evaluate_unfiltered.distribution_distance_percent"] > 60
    assert found["pattern_correlation"] > 0.85


def test_photographs_without_filtered_ones_tell_orientation_and_render_with_a_known_period(
    results: Path, tmp_path: Path
) -> None:
    taken = run(results, "polygons", "until=[evaluate]", size="[600,400]")
    export_photos(taken, "photos", tmp_path / "photos")
    replayed = ["rig=flash_replay", f"rig.folder={tmp_path / 'photos'}", f"paths.runs={results}"]
    experiment = pipeline.run("flash_polygons", [*replayed, "until=[fit]"])
    assert {experiment.nodes[name].status for name in ("filtered_photos", "period", "rendering")} == {"absent"}
    assert experiment["fit"].mask.all()
    known = ["graph.period.stage=extract.even_period", "graph.period.period_um=1.6667", "until=[rendering_difference]"]
    assert pipeline.run("flash_polygons", [*replayed, *known]).metrics["picture_correlation"] > 0.9
