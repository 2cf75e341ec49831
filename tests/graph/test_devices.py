"""Devices in a graph: named and checked like stages; what real ones captured is never taken again by itself."""

from __future__ import annotations

import pytest
from toys import Toys

from pipeline.errors import InputErrors

GRAPH = """
photo: {stage: toy.photo, camera: {device: lab.Webcam, light: {device: lab.Lamp, watts: 40}}}
big: {stage: toy.scale, maps: photo}
"""


@pytest.fixture
def lab(toys: Toys) -> Toys:
    toys.graph(GRAPH)
    return toys


def test_a_capture_is_a_source_that_outlives_its_code(lab: Toys) -> None:
    first = lab.run()
    assert first["big"].period_um[0, 0] == 2
    lab.devices.write_text(lab.devices.read_text().replace("taken = 0", "taken = 41"))
    assert "a capture is never taken again" in lab.reasons()["photo"]
    assert lab.ran() == []


def test_a_recapture_is_a_new_session_that_stays(lab: Toys) -> None:
    lab.run()
    lab.devices.write_text(lab.devices.read_text().replace("taken = 0", "taken = 41"))
    again = lab.run("recapture=true")
    assert again["photo"].period_um[0, 0] == 42
    assert lab.run()["photo"].period_um[0, 0] == 42
    assert lab.ran() == []


def test_a_capture_with_other_settings_is_another(lab: Toys) -> None:
    lab.run()
    assert "photo" in lab.ran("graph.photo.camera.light.watts=41")
    reasons = lab.reasons("graph.photo.camera.light.watts=42")
    assert reasons["photo"] == "run: camera.light.watts changed: 41.0 -> 42.0"


def test_a_simulated_capture_is_left_out_where_its_sample_is_and_a_real_one_is_not(toys: Toys) -> None:
    camera = "camera: {device: lab.Webcam, simulated: SIMULATED, light: {device: lab.Lamp, watts: 40}}"
    graph = """
    sample: {stage: toy.source, when: false}
    photo: {stage: toy.photo, sample: sample, CAMERA}
    big: {stage: toy.scale, maps: photo}
    other: {stage: toy.source}
    """.replace("CAMERA", camera)
    toys.graph(graph.replace("SIMULATED", "true"))
    simulated = toys.load().graph
    assert set(simulated.nodes) == {"other"}
    assert simulated.remarks == (
        "photo and what needs it are left out: graph.photo.camera is simulated, and 'sample' absent",
    )
    with pytest.raises(InputErrors, match="no node is left to run: 'sample' is left out here"):
        toys.load("graph.other=null")
    toys.graph(graph.replace("SIMULATED", "false"))
    real = toys.load().graph
    assert set(real.nodes) == {"photo", "big", "other"}
    assert real.remarks == ()


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("graph.photo.camera.device=lab.Webcm", r"no device 'lab.Webcm'[\s\S]*'lab.Webcam'\?"),
        ("graph.photo.camera.light.wats=3", r"lab.Lamp has no setting 'wats'[\s\S]*override[\s\S]*'watts'\?"),
        ("graph.photo.camera.light.watts=much", r"watts is 'much' \(str\)[\s\S]*expected: float"),
        ("graph.photo.camera=null", r"'camera' is None[\s\S]*expected: a Camera: {device: module.Class"),
        ("graph.photo.camera.light=lamp", r"'light' is 'lamp'[\s\S]*a Light"),
    ],
)
def test_wrong_devices_are_found_when_loading(lab: Toys, override: str, message: str) -> None:
    with pytest.raises(InputErrors, match=message):
        lab.load(override)


def test_devices_and_stages_are_asked_before_anything_runs(lab: Toys) -> None:
    with pytest.raises(InputErrors, match=r"exposure is too long[\s\S]*graph.photo.camera[\s\S]*at most 10 s"):
        lab.run("graph.photo.camera.exposure_s=11")
    with pytest.raises(InputErrors, match=r"lab.Webcam: exposure_s is -1.0[\s\S]*graph.photo"):
        lab.run("graph.photo.camera.exposure_s=-1")
    with pytest.raises(InputErrors, match=r"no photo is asked for[\s\S]*graph.photo"):
        lab.run("graph.photo.times=0")
    assert not (lab.folder / "runs" / ".store" / "objects").exists()
