"""Flash and polarisation on the same tiles: the experiment composed, and run small."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.bench import Experiment
from pipeline.data.flash import FlashBrackets
from pipeline.data.gratings import OrientationMap
from pipeline.data.photographs import PolarizerSequence
from pipeline.execution.outcome import Silent
from pipeline.stages.evaluate.effort import effort
from pipeline.sweeps import Sweep, run_sweep

STUDY = "+experiment=flash_beside_polarization"
SMALL = (
    "point_mm=0.09333333333333334",
    "rig.camera.samples=1",
    "rig.light.wavelength_step_nm=10",
    "tradeoff.repeats=1",
)
SMALL_SHEET = ("copies.polygons.tiles=[6,4]", "copies.polygons.size_px=[360,229]")
CHAINS = {
    "flash": ["merged", "rectified", "tiles", "highlights", "fit"],
    "cosine": ["aligned", "fit_cosine"],
    "jones": ["aligned", "fit_polarization"],
}


def swept(folder: Path, *words: str) -> Sweep:
    done = run_sweep([STUDY, f"paths.runs={folder}", *SMALL, *words], [], Silent())
    assert not done.failed
    return done


def row_of(done: Sweep, method: str) -> dict[str, object]:
    return next(row for row in done.table() if row["method"] == method)


@pytest.mark.parametrize("scene", ["polygons", "stars", "kinematic", "alone", "film", "weak"])
def test_both_methods_see_one_drawing(scene: str) -> None:
    nodes = Experiment.load([STUDY, f"scene={scene}"]).graph.nodes
    assert nodes["photos"].inputs["sample"] == nodes["polarizer_photos"].inputs["sample"] == ("sample",)
    assert {"fit", "fit_cosine", "fit_polarization", "evaluate"} <= set(nodes)


def test_each_methods_row_has_its_own_photographs_and_seconds(tmp_path: Path) -> None:
    done = swept(tmp_path, *SMALL_SHEET, "scene=polygons", "method=flash,cosine,jones")
    for method, chain in CHAINS.items():
        row = row_of(done, method)
        assert row["timed_seconds"] == pytest.approx(sum(row[f"{name}_seconds"] for name in chain))  # type: ignore[misc]
        others = {name for nodes in CHAINS.values() for name in nodes} - set(chain)
        assert all(row[f"{name}_seconds"] is None for name in others)
        assert row["orientation_error_median_deg"] < 2  # type: ignore[operator]
    assert [row_of(done, method)["photographs"] for method in CHAINS] == [5, 12, 12]
    assert [row_of(done, method)["exposures"] for method in CHAINS] == [26, 12, 12]
    assert [row_of(done, method)["absolute"] for method in CHAINS] == [1, 0, 1]
    assert "each point&#39;s nodes (s)" in (done.folder / "report.html").read_text().replace("'", "&#39;")


def test_a_tile_that_does_not_repeat_is_lost_to_the_flash_alone(tmp_path: Path) -> None:
    done = swept(tmp_path, "scene=alone", "method=flash,cosine")
    assert row_of(done, "flash")["masked_share_percent"] > 80  # type: ignore[operator]
    assert row_of(done, "cosine")["masked_share_percent"] < 5  # type: ignore[operator]
    assert row_of(done, "cosine")["orientation_error_mean_deg"] < 2  # type: ignore[operator]


def test_effort_counts_exposures_and_says_what_is_claimed() -> None:
    angles = np.full((2, 2), 0.5, np.float32)
    known = OrientationMap.of_angles(angles, pixel_mm=0.3, absolute=True)
    unknown = OrientationMap.of_angles(angles, pixel_mm=None, absolute=False)
    images = np.zeros((3, 5, 2, 2, 3), np.uint8)
    brackets = FlashBrackets(images, np.ones(5), False, images[0, 0], np.zeros((3, 3)), np.zeros(3))
    assert effort(known, brackets).metrics == {
        "photographs": 3,
        "exposures": 16,
        "absolute": 1,
        "map_pixel_mm": pytest.approx(0.3),
    }
    through = PolarizerSequence(
        np.zeros((4, 2, 2), np.float32), np.arange(4) * 0.7, np.ones((2, 2), bool), wavelength_nm=530.0, pixel_mm=None
    )
    assert effort(unknown, through).metrics == {"photographs": 4, "exposures": 4, "absolute": 0}
