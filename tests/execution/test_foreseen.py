"""Settings of two stages that do not go together are found before either runs."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest
from toys import Toys

import pipeline
from pipeline.codebase.source import Sources
from pipeline.errors import InputErrors
from pipeline.graph.catalog import Catalog

CHECKS = """

def _foresee_source(*, size: int, **_: object) -> dict[str, int]:
    return {"size": size}


def _check_scale(*, factor: float, mode: str, maps=None) -> None:
    if (maps or {}).get("size", 0) > factor:
        from pipeline.errors import InputError
        raise InputError(f"size {maps['size']} does not go with {factor}", where="factor, maps.size")


def _check_clip(*, most: float, maps=None) -> None:
    assert maps == {}
"""


def test_a_check_sees_what_the_stage_upstream_foresees(toys: Toys) -> None:
    toys.stages.write_text(toys.stages.read_text() + CHECKS)
    before = sorted(toys.folder.rglob("objects/*/*"))
    place = r"graph\.big \(maps from graph\.raw\): factor, maps\.size"
    with pytest.raises(InputErrors, match=rf"size 4 does not go with 3[\s\S]*{place}"):
        toys.run("graph.raw.size=4")
    assert sorted(toys.folder.rglob("objects/*/*")) == before == []
    assert toys.run().metrics["mean_1_um"] == 3
    with pytest.raises(InputErrors, match="size 3 does not go with 2"):
        toys.run("graph.big.factor=2")


def test_a_pitch_that_does_not_fit_is_refused_by_both_cameras_before_the_sample_is_drawn(tmp_path: Path) -> None:
    with pytest.raises(InputErrors) as caught:
        pipeline.run("polarization_logo", ["graph.sample.pixel_mm=0.01", f"paths.runs={tmp_path}"])
    assert sorted(error.where for error in caught.value.errors) == [
        "graph.photos (sample from graph.sample): sample.pixel_mm, rig.camera.pixel_mm",
        "graph.torch (sample from graph.sample): pixel_mm, sample.pixel_mm",
    ]
    assert all(error.what.endswith("0.02, is 2 times the sample's, 0.01") for error in caught.value.errors)
    assert all(error.expected == "an odd whole multiple, such as 0.03" for error in caught.value.errors)
    assert not list(tmp_path.rglob("objects/*/*"))


def test_every_drawn_sample_is_foreseen() -> None:
    catalog = Catalog(Sources())
    stages = catalog.stages.items()
    drawn = {name: entry for name, entry in stages if entry.type == "GratingSample" and not entry.inputs}
    assert "simulate.logo" in drawn
    for name, entry in drawn.items():
        module = importlib.import_module(entry.module)
        foreseen = getattr(module, "_foresee_" + name.partition(".")[2])
        assert foreseen(pixel_mm=0.25, margin_mm=1.0) == {"pixel_mm": 0.25}
