"""A machine whose libraries round the simulated light otherwise: every value stays within what its stage states."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pipeline
from pipeline.devices import simulated
from pipeline.optics.imaging import seen_by_lens
from pipeline.stages.capture import point_light

SMALL = [
    "graph.sample.pixel_mm=0.02",
    "rig.camera.pixel_mm=0.06",
    "graph.photos.count=6",
    "graph.torch.pixel_mm=0.06",
    "graph.torch.wavelength_step_nm=40",
    "until=[evaluate,period,torch]",
]


def nudged(scene: np.ndarray, **settings: object) -> np.ndarray:
    """The lens, but that every pixel is off by up to a last bit."""
    seen = seen_by_lens(scene, **settings)  # type: ignore[arg-type]
    last_bits = np.random.default_rng(0).integers(-1, 2, seen.shape).astype(np.float32)
    return seen * (1 + np.float32(2**-23) * last_bits)


def test_last_bits_of_the_light_stay_within_tolerance(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = pipeline.run("polarization_logo", [*SMALL, f"paths.runs={tmp_path}"])
    monkeypatch.setattr(simulated, "seen_by_lens", nudged)
    monkeypatch.setattr(point_light, "seen_by_lens", nudged)
    done = pipeline.verify(run.path)
    verdicts = {name: node.verdict for name, node in done.nodes.items()}
    assert done.ok, str(done)
    assert verdicts["sample"] == "identical"
    assert verdicts["photos"] == verdicts["torch"] == verdicts["fit"] == "within tolerance"
    share = {d.field: d.share for d in done.nodes["photos"].differences}
    assert set(share) == {"images"}
    assert share["images"] < 1e-3
