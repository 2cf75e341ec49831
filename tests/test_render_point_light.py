"""The experiment render_point_light, small."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import pipeline

SMALL = ["graph.sample.pixel_mm=0.25", "graph.oblique.size_px=[80,60]"]


def test_spokes_turn_as_the_torch_moves(tmp_path: Path) -> None:
    done = pipeline.run("render_point_light", [*SMALL, "tiles=[2,2]", f"paths.runs={tmp_path}"])
    series = done["rendering"]
    assert series.rgb.shape == (4, 200, 200, 3)
    assert done["oblique"].rgb.shape == (4, 60, 80, 3)
    lit = series.rgb.max(axis=-1) > 0.1
    assert (lit.mean(axis=(1, 2)) > 0.02).all()
    overlap = (lit[0] & lit[2]).sum() / lit[0].sum()
    assert overlap < 0.3
    written = {path.name for path in done.path.glob("outputs/*")}
    assert {"rendering_0.png", "rendering_3.exr", "oblique_0.png"} <= written
    assert "A field of view of" in (done.path / "report.html").read_text()


def test_all_lights_in_one_picture_are_reported(tmp_path: Path) -> None:
    words = ["graph.rendering.together=true", "until=rendering", "tiles=[1,1]", f"paths.runs={tmp_path}"]
    done = pipeline.run("render_point_light", ["maps=circles", "graph.sample.pixel_mm=2.0", *words])
    series = done["rendering"]
    assert series.rgb.shape == (1, 100, 100, 3)
    assert np.isfinite(series.rgb).all()
    assert "azimuth 45°" in (done.path / "report.html").read_text()
