"""No stage and no device takes a setting that nothing can have."""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from photo_makers import write_image

import pipeline
from pipeline.codebase.source import Sources
from pipeline.devices.flash_camera import FlashCamera
from pipeline.devices.rotation_mount import SimulatedRotationMount
from pipeline.devices.simulated import Camera, Panel, PolarizationBench
from pipeline.devices.simulated_flash import FlashBench, PhoneFlash
from pipeline.errors import InputError, InputErrors
from pipeline.graph.catalog import Catalog, Entry

CATALOG = Catalog(Sources())
FLASH_RIG = FlashBench(camera=FlashCamera(), light=PhoneFlash())
RIG = PolarizationBench(camera=Camera(), mount=SimulatedRotationMount(), light=Panel())
GIVEN = {
    "width_um": 1.0,
    "electrons": 10_000.0,
    "lights_mm": [[100.0, 0.0, 300.0]],
    "rig": RIG,
    "pitch_um": 0.1,
    "name": "elaphe",
    "period_um": 1.6,
}
OPTICS = {"phase_deg", "retardation_deg", "film_axis_deg"}
EITHER_SIGN = {
    "capture.polarizer_sequence": {"span_deg", "step_deg"},
    "extract.shifted": {"right", "up"},
    "fit.auto": {"film_axis_deg", "threshold"},
    "fit.cosine": {"threshold"},
    "fit.diffraction_peaks": {"azimuth_deg", "order"},
    "fit.jones": {"retardation_deg", "film_axis_deg", "threshold"},
    "fit.offset": {"known_deg"},
    "render.brdf_map": {"light_azimuth_deg"},
    "render.diffraction_shading": {"turn_deg", "light_azimuth_deg", "camera_azimuth_deg"},
    "simulate.blaze": {"orientation_deg"},
    "simulate.bumps": {"orientation_deg"},
    "simulate.cd_tracks": {"orientation_deg"},
    "simulate.cosine_grating": {"orientation_deg"},
    "simulate.scanned": {"tilt_direction_deg"},
    "simulate.banknote_emblem": OPTICS | {"turn_deg"},
    "simulate.circles": OPTICS,
    "simulate.compact_disc": {"phase_deg"},
    "simulate.defects": {"turn_deg"},
    "simulate.misread_distances": {"light_percent", "camera_percent"},
    "simulate.facets": OPTICS,
    "simulate.fireworks": OPTICS | {"twist_deg"},
    "simulate.gradient_stars": OPTICS,
    "simulate.picture_design": OPTICS,
    "simulate.kinematic_tile": OPTICS,
    "simulate.laid_down": {"x_mm", "y_mm", "turn_deg"},
    "simulate.logo": OPTICS,
    "simulate.misread_polarizer": {"stretch"},
    "simulate.polarizer_response": OPTICS,
    "simulate.polygons": OPTICS | {"first_deg"},
    "simulate.spiral": {"turn_deg"},
    "simulate.stochastic_texture": OPTICS,
    "simulate.vector_design": OPTICS,
    "rotation_mount.CanopenRotationMount": {"zero_deg"},
    "rotation_mount.SimulatedRotationMount": {"eccentricity_deg"},
}


def numbers(entry: Entry) -> Iterator[str]:
    """Settings that are numbers, and may not be of either sign."""
    parameters = {**entry.settings, **(entry.inputs if entry.signature.is_class else {})}
    for name, (_, annotation) in parameters.items():
        kinds = {annotation.kind, *(item.kind for item in annotation.items)}
        if kinds & {"int", "float"} and "list" not in kinds and name not in EITHER_SIGN.get(entry.name, ()):
            yield name


def cases(entries: dict[str, Entry], names: tuple[str, ...] = ()) -> list[tuple[str, str]]:
    chosen = {name: entry for name, entry in entries.items() if entry.module.startswith("pipeline.")}
    return [(name, setting) for name in names or chosen for setting in numbers(chosen[name])]


@pytest.mark.parametrize(("name", "setting"), cases(CATALOG.stages))
def test_no_stage_takes_a_negative_number_where_none_makes_sense(
    name: str, setting: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = {**GIVEN, "file": file_for(name, tmp_path)}
    if name == "capture.flash_photographs":
        given["rig"] = FLASH_RIG
    entry = CATALOG.stages[name]
    module, function = importlib.import_module(entry.module), entry.signature.name
    parameters = inspect.signature(getattr(module, function)).parameters.values()
    settings = {p.name: given.get(p.name, p.default) for p in parameters if p.kind == p.KEYWORD_ONLY}
    check = getattr(module, f"_check_{function}")
    if hasattr(module, "published_file"):  # which would have to be downloaded
        monkeypatch.setattr(module, "published_file", lambda _: tmp_path)
    check(**settings)
    with pytest.raises(InputError, match=rf"^{setting} is -1\s+where: +{setting}\s+expected: "):
        check(**{**settings, setting: -1})


def file_for(stage: str, folder: Path) -> Path:
    if stage == "simulate.picture_design":
        return write_image(folder / "map.png", np.uint8(255 * np.eye(4)))
    if stage == "simulate.vector_design":
        file = folder / "map.svg"
        file.write_text('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><circle r="5" fill="red"/></svg>')
        return file
    np.save(folder / "map.npy", np.eye(4))
    return folder / "map.npy"


DEVICES = (
    "simulated.Camera",
    "simulated.Panel",
    "simulated.PolarizationBench",
    "rotation_mount.SimulatedRotationMount",
    "rotation_mount.CanopenRotationMount",
    "gphoto_camera.GphotoCamera",
    "lab.PolarizationBench",
    "replay.PhotoFolder",
    "flash_camera.FlashCamera",
    "simulated_flash.PhoneFlash",
    "simulated_flash.FlashBench",
    "lab_flash.HandHeldFlash",
    "lab_flash.FlashBench",
)


@pytest.mark.parametrize(("name", "setting"), cases(CATALOG.devices, DEVICES))
def test_no_device_takes_a_negative_number_where_none_makes_sense(name: str, setting: str, tmp_path: Path) -> None:
    entry = CATALOG.devices[name]
    given = {
        "camera": Camera(),
        "mount": SimulatedRotationMount(),
        "light": Panel(),
        "folder": photographs(tmp_path),
        "lights_mm": [[100.0, 0.0, 300.0]],
        "sheet_mm": [297.0, 210.0],
    }
    if name.endswith("FlashBench"):
        given |= {"camera": FlashCamera(), "light": PhoneFlash()}
    kind = getattr(importlib.import_module(entry.module), entry.signature.name)
    settings = {n: value for n, value in given.items() if n in inspect.signature(kind).parameters}
    kind(**settings).check()
    with pytest.raises(InputError, match=rf"^{setting} is -1\s+where: +{setting}\s+expected: "):
        kind(**settings, **{setting: -1}).check()


def photographs(folder: Path) -> Path:
    for angle in (0, 45, 90):
        write_image(folder / f"psi_{angle:03}.tif", np.full((4, 4), 1000 + angle, np.uint16))
    return folder


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("graph.rendering.width_mm=-1", r"width_mm is -1[\s\S]*graph.rendering: width_mm"),
        ("graph.period.longest_um=-1", r"longest_um is -1[\s\S]*graph.period: longest_um"),
        ("graph.smooth.sigma_pixel=0", r"sigma_pixel is 0[\s\S]*graph.smooth: sigma_pixel"),
        ("graph.smooth.iterations=-3", r"iterations is -3[\s\S]*graph.smooth: iterations"),
        ("graph.photos.count=-1", r"count is -1[\s\S]*graph.photos[^:]*: count"),
        ("rig.camera.pixel_mm=0.0001", r"pixel_mm is 0.0001[\s\S]*graph.photos.rig: camera: pixel_mm[\s\S]*at least"),
        ("rig.mount.velocity_deg_s=1e9", r"velocity_deg_s is 1e\+09[\s\S]*graph.photos.rig: mount: velocity_deg_s"),
        ("rig.light={device: simulated.Panel, radiance: 0}", r"radiance is 0[\s\S]*graph.photos.rig: light: radiance"),
    ],
)
def test_a_run_is_refused_before_anything_runs(tmp_path: Path, override: str, message: str) -> None:
    with pytest.raises(InputErrors, match=message):
        pipeline.run("polarization_logo", [override, f"paths.runs={tmp_path}"])
    assert not list(tmp_path.rglob("objects/*"))


@pytest.mark.parametrize("setting", ["pixel_mm=-1", "pixel_mm=0", "wavelength_nm=-5"])
def test_a_replay_is_refused_before_anything_runs(tmp_path: Path, setting: str) -> None:
    (tmp_path / "photos").mkdir()
    words = ["rig=replay", f"rig.folder={photographs(tmp_path / 'photos')}", f"rig.{setting}"]
    name, value = setting.split("=")
    with pytest.raises(
        InputErrors, match=rf"{name} is {re.escape(value)}[\s\S]*graph.photos.rig: {name}[\s\S]*above 0"
    ):
        pipeline.run("polarization_logo", [*words, f"paths.runs={tmp_path / 'runs'}"])
    assert not list((tmp_path / "runs").rglob("objects/*"))
