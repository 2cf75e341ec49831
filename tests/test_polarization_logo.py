"""The experiment as a whole: its figures on the simulated bench, and its map on real photographs."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import polanalyser as pa
import pytest

import pipeline
from pipeline.cli import main
from pipeline.optics.angles import axial_difference
from pipeline.runs import Run

pytestmark = pytest.mark.xdist_group("logo")  # so that its runs at full size are made once

SMALL = ["graph.sample.pixel_mm=0.02", "rig.camera.pixel_mm=0.06", "graph.torch.pixel_mm=0.06"]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs")


def run(results: Path, *overrides: str) -> Run:
    return pipeline.run("polarization_logo", [*overrides, f"paths.runs={results}"])


@pytest.fixture(scope="module")
def default(results: Path) -> Run:
    return run(results)


def test_figures_with_default_noise_and_twelve_photographs(default: Run) -> None:
    assert len(default["photos"].images) == 12
    assert default.metrics["orientation_error_mean_deg"] <= 1.0
    assert default.metrics["correlation_mean"] >= 0.984
    assert default.metrics["period_error_mean_percent"] <= 3.0
    assert default.metrics["masked_share_percent"] <= 0.5


def test_prenormalisation_is_broken_by_a_logo_of_few_facets(results: Path, default: Run) -> None:
    other = run(results, "graph.fit.prenormalize=true")
    assert other.metrics["orientation_error_mean_deg"] > 5 * default.metrics["orientation_error_mean_deg"]
    assert other.nodes["photos"].status == "cached"


def test_the_torch_fixes_the_offset_that_polarisation_leaves_open(default: Run) -> None:
    assert not default["smooth"].absolute
    placed = default["placed"]
    assert placed.absolute
    truth = default["sample"].orientation_rad[1::3, 1::3]
    error = axial_difference(placed.orientation_rad, truth)
    assert abs(np.rad2deg(np.nanmedian(error))) < 1.0


def test_the_map_that_claims_to_be_absolute_is_judged_as_such(default: Run) -> None:
    own = "absolute_error.orientation_error_mean_deg"
    assert default["absolute_error"].offset_rad == 0
    assert default.metrics[own] <= 1.0
    assert default.metrics[own] != default.metrics["orientation_error_mean_deg"]
    left = default.metrics["absolute_error.offset_deg"]
    assert min(left, 180 - left) < 0.5


def test_the_rendering_is_what_the_torch_shows(default: Run) -> None:
    photographed, rendered = default["torch"].rgb, np.clip(default["rendering"].rgb, 0, 1)
    for photo, picture in zip(photographed, rendered, strict=True):
        assert np.corrcoef(photo.ravel(), picture.ravel())[0, 1] > 0.95


def test_three_photographs_give_a_map_whose_fit_is_not_judged(results: Path) -> None:
    three = run(results, *SMALL, "graph.photos.count=3")
    assert "A cosine goes exactly through three photographs" in three.nodes["fit"].warnings[0]
    assert not [name for name in three.metrics if name.endswith("correlation_mean")]
    assert three.metrics["orientation_error_mean_deg"] <= 2.0
    assert three["placed"].absolute


def test_the_report_and_its_outputs_are_there(default: Run) -> None:
    page = default.report.read_text()
    for name in default.nodes:
        assert f'id="node-{name}"' in page
    names = {p.name for p in (default.path / "outputs").iterdir()}
    assert {"fit.exr", "fit.png", "period.exr", "rendering_0.png", "torch_0.exr", "metrics.csv"} <= names


def test_a_small_run_repeats_to_the_last_bit(results: Path, tmp_path: Path) -> None:
    one = run(results, *SMALL)
    other = run(tmp_path, *SMALL, "executor=serial")
    assert {n.name: n.artifact for n in one.nodes.values()} == {n.name: n.artifact for n in other.nodes.values()}


def test_exported_photographs_are_the_same_photographs(results: Path, tmp_path: Path) -> None:
    captured = run(results, *SMALL)
    folder = tmp_path / "photos"
    assert main(["export", str(captured.path), "photos", str(folder)]) == 0
    replayed = run(results, "rig=replay", f"rig.folder={folder}")
    assert replayed.nodes["photos"].artifact == captured.nodes["photos"].artifact
    assert {replayed.nodes[n].status for n in ("aligned", "fit", "smooth", "period")} == {"cached"}
    assert {replayed.nodes[n].status for n in ("evaluate", "absolute_error", "period_error")} == {"absent"}
    assert "logo, 15 mm wide, lies" not in replayed.description
    assert "orientation_error_mean_deg" not in replayed.metrics
    assert "correlation_mean" in replayed.metrics


def test_exported_torch_photographs_make_a_replay_absolute(results: Path, tmp_path: Path) -> None:
    captured = run(results, *SMALL)
    for node in ("photos", "torch"):
        assert main(["export", str(captured.path), node, str(tmp_path / node)]) == 0
    replay = ["rig=replay", f"rig.folder={tmp_path / 'photos'}"]
    relative = run(results, *replay)
    assert relative.nodes["torch"].status == "absent"
    assert not relative["placed"].absolute
    assert "known up to one offset" in relative.nodes["rendering"].warnings[0]
    assert "known up to one offset" in relative["rendering"].caption
    torch = ["graph.torch.stage=capture.recorded_point_light", f"graph.torch.folder={tmp_path / 'torch'}"]
    absolute = run(results, *replay, *torch)
    assert np.array_equal(absolute["torch"].rgb, captured["torch"].rgb)
    assert absolute.nodes["placed"].artifact == captured.nodes["placed"].artifact
    assert absolute.nodes["rendering"].artifact == captured.nodes["rendering"].artifact
    assert not absolute.nodes["rendering"].warnings


@pytest.mark.parametrize("scene", ["glass", "fabrics"])
def test_real_photographs_give_the_angle_that_polanalyser_computes(
    results: Path, measurements: Path, scene: str
) -> None:
    folder = measurements / "polarization" / scene
    found = run(results, "rig=replay", f"rig.folder={folder}", "graph.fit.prenormalize=false", "until=fit")["fit"]
    angles = (0, 45, 90, 135)
    images = [cv2.imread(str(folder / f"NIR_filtre_nir_{a}_aligned.tif"), cv2.IMREAD_UNCHANGED) for a in angles]
    stokes = pa.calcStokes(np.array(images, np.float64), np.deg2rad(angles))
    assert_same_angle(found.orientation_rad, pa.cvtStokesToAoLP(stokes))


def test_a_polarisation_cameras_frame_gives_the_angle_that_polanalyser_computes(
    results: Path, measurements: Path
) -> None:
    folder = measurements / "polarization" / "filters"
    done = run(results, "rig=replay", f"rig.folder={folder}", "graph.fit.prenormalize=false", "until=fit")
    found = done["fit"].orientation_rad
    raw = cv2.imread(str(folder / "raw.png"), cv2.IMREAD_UNCHANGED)
    # 16 bits, since polanalyser rounds interpolated values to whole counts
    frames = np.asarray(pa.demosaicing(raw.astype(np.uint16) * 256), np.float64)
    angle = pa.cvtStokesToAoLP(pa.calcStokes(frames, np.deg2rad([0, 45, 90, 135])))
    assert_same_angle(found, angle)
    assert done["aligned"].valid.sum() == done["photos"].valid.sum()


def assert_same_angle(found: np.ndarray, expected: np.ndarray) -> None:
    known = np.isfinite(found)
    assert known.mean() > 0.3
    assert np.rad2deg(np.median(np.abs(axial_difference(found, expected)[known]))) < 0.5
