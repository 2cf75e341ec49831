"""Which maps the page lets a reader turn, in what light, and what it says of them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_run import FakeNode, FakeRun, polygons, run_with, values_of_every_type

from pipeline.data.gratings import GratingSample, OrientationMap, PeriodMap
from pipeline.data.height_fields import HeightField
from pipeline.report.page import page
from pipeline.report.viewer import MOST_TEXELS, _shining_light, viewer

LIGHT = {
    "lights_mm": [[200.0, 40.0, 300.0], [0.0, 90.0, 300.0]],
    "camera_mm": [0.0, 0.0, 400.0],
    "light_sigma_mm": 9.0,
    "depth_um": 0.2,
    "coherence_um": 50.0,
    "illuminant": "A",
    "tiles": [2, 1],
    "width_mm": 12.0,
    "refractive_index": 1.5,
}


def spiral(side: int) -> tuple[np.ndarray, np.ndarray]:
    """Orientations and periods of all kinds, on a disc."""
    y, x = np.mgrid[1 : -1 : side * 1j, -1 : 1 : side * 1j]
    away = np.hypot(x, y)
    theta = np.where(away < 0.95, (np.arctan2(y, x) + away) % np.pi, np.nan).astype(np.float32)
    return theta, np.where(away < 0.95, 0.7 + 0.8 * away, np.nan).astype(np.float32)


def lit_run(path: Path, *, absolute: bool = True, pixel_mm: float | None = None, side: int = 40) -> FakeRun:
    """Maps and a node that renders them."""
    theta, period = spiral(side)
    values = {
        "fit": OrientationMap.of_angles(theta, pixel_mm=pixel_mm, absolute=absolute),
        "period": PeriodMap(period, np.isfinite(period), pixel_mm),
    }
    node = FakeNode(
        "torch", inputs={"orientation": ("fit",), "period": ("period",), "bumps": ()}, settings=LIGHT, artifact=""
    )
    return run_with(values, path).with_node(node)


def shown(run: FakeRun) -> tuple[dict, str]:
    found = viewer(run, run.values)
    assert found is not None
    return json.loads(found.sheets[0].payload), found.sheets[0].caption


def test_it_starts_in_the_light_of_a_node(tmp_path: Path) -> None:
    sheet, caption = shown(lit_run(tmp_path))
    assert sheet["start"]["light"] == LIGHT["lights_mm"][0]
    assert sheet["start"]["eye"] == LIGHT["camera_mm"]
    assert sheet["start"]["size_mm"] == pytest.approx([24.0, 12.0])
    assert sheet["constants"]["tiles"] == [2.0, 1.0]
    assert sheet["constants"]["inverse_reflectance"] == pytest.approx(25.0)
    assert caption.startswith("The maps of fit and period, lit as for torch. 40 × 40 points, repeated 2 × 1")


def test_bumps_are_left_out_and_the_caption_says_so(tmp_path: Path) -> None:
    run = lit_run(tmp_path)
    run = run.with_node(FakeNode("skin", artifact="s"), HeightField(np.zeros((4, 4)), 10.0))
    bumpy = replace(run.nodes["torch"], inputs={**run.nodes["torch"].inputs, "bumps": ("skin",)})
    assert "Its bumps are left out." in shown(run.with_node(bumpy))[1]
    assert "bumps" not in shown(run)[1]


def test_absolute_orientations_come_first_and_others_are_told_of(tmp_path: Path) -> None:
    unknown = lit_run(tmp_path, absolute=False)
    assert "known up to one offset" in shown(unknown)[1]
    fixed = replace(unknown.values["fit"], absolute=True)
    run = unknown.with_node(FakeNode("offset", artifact="o"), fixed)
    run = run.with_node(
        FakeNode("late", inputs={"orientation": ("offset",), "period": ("period",)}, settings=LIGHT, artifact="")
    )
    assert shown(run)[1].startswith("The maps of offset and period, lit as for late.")


def test_where_its_light_shows_nothing_another_is_taken(tmp_path: Path) -> None:
    run, theta = lit_run(tmp_path), np.full((40, 40), np.pi / 2, np.float32)
    dark = run.with_node(run.nodes["fit"], OrientationMap.of_angles(theta, pixel_mm=0.1, absolute=True))
    sheet, _ = shown(dark)
    x, y, z = sheet["start"]["light"]
    assert x == pytest.approx(0.0, abs=1e-3)
    assert np.hypot(y, z) == pytest.approx(400.0)
    assert sheet["start"]["exposure"] != 1.0


def test_measured_maps_without_a_rendering_are_lit_so_that_some_shine(tmp_path: Path) -> None:
    run = run_with(values_of_every_type(), tmp_path)
    sheet, caption = shown(run)
    assert caption.startswith("The maps of fit and period.")
    assert np.linalg.norm(sheet["start"]["light"]) == pytest.approx(400.0)
    assert sheet["start"]["exposure"] != 1.0  # what is lit gives the white level
    assert viewer(run, run.values).pictures == ["torch", "rendering"]


def test_a_drawn_sample_will_do(tmp_path: Path) -> None:
    theta, period = polygons()
    sample = GratingSample(theta, period, 0.1, 0.17, 1.0, 0.0, 0.0, 0.0, 0.0, "wheel")
    run = run_with({"sample": sample}, tmp_path)
    assert shown(run)[1].startswith("The wheel as drawn (sample).")
    assert viewer(run, run.values).depth == 0.17


def test_large_maps_are_thinned_and_the_caption_says_so(tmp_path: Path) -> None:
    side = 2 * MOST_TEXELS + 10
    sheet, caption = shown(lit_run(tmp_path, side=side, pixel_mm=0.01))
    assert sheet["textures"]["maps"]["size"] == [345, 345]
    assert f"One of every 3 × 3 of {side} × {side} points" in caption
    assert sheet["constants"]["pixel_mm"] == pytest.approx(0.03)


@pytest.mark.parametrize("values", [{}, {"fit": "fit alone"}, {"dark": "no gratings"}])
def test_without_maps_there_is_none(tmp_path: Path, values: dict[str, str]) -> None:
    theta, period = polygons()
    kinds = {
        "fit": OrientationMap.of_angles(theta, pixel_mm=0.1, absolute=True),
        "dark": GratingSample(theta * np.nan, period * np.nan, 0.1, 0.1, 1.0, 0.0, 0.0, 0.0, 0.0, "nothing"),
    }
    run = run_with({name: kinds[name] for name in values}, tmp_path)
    assert viewer(run, run.values) is None
    assert "<canvas" not in page(run)


def test_a_camera_beside_the_sheet_is_moved_above_it(tmp_path: Path) -> None:
    run = lit_run(tmp_path)
    low = replace(run.nodes["torch"], settings=LIGHT | {"camera_mm": [8.0, 0.0, 1.0]})
    sheet, _ = shown(run.with_node(low))
    assert sheet["start"]["eye"] == pytest.approx([0.0, 0.0, np.sqrt(65)])


def test_a_sheet_that_nothing_tells_the_light_of_is_lit_along_its_tangents() -> None:
    light = _shining_light(np.full((4, 4), 0.8, np.float32), np.full((4, 4), 1.1, np.float32))
    sine = 0.55 / 1.1
    expected = [sine * np.cos(0.8), sine * np.sin(0.8), np.sqrt(1 - sine**2)]
    np.testing.assert_allclose(light / np.linalg.norm(light), expected, rtol=1e-6)
