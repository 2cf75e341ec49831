"""The experiment that shades a snake or a plate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

import pipeline

SMALL = ["graph.surface.pitch_um=0.1", "graph.shading.size_px=32", "graph.shading.distance_mm=[900,150]"]


@pytest.mark.parametrize("shape", ["snake", "plate"])
def test_a_shape_is_photographed_from_every_distance(tmp_path: Path, shape: str) -> None:
    run = pipeline.run("diffraction_snake", [*SMALL, f"graph.shading.shape={shape}", f"paths.runs={tmp_path}"])
    pictures = run["shading"]
    for k, rgb in enumerate(pictures.rgb):
        written = oiio.ImageBuf(str(run.path / "outputs" / f"shading_{k}.exr")).get_pixels(oiio.FLOAT)
        np.testing.assert_array_equal(written, rgb)
        assert (run.path / "outputs" / f"shading_{k}.png").stat().st_size > 100
        assert rgb.max() > 0
    report = (run.path / "report.html").read_text()
    assert "900 mm away, 317 mm wide" in report
    assert "of a white matt surface that faces the light" in report
