"""The laboratory's rig, with libgphoto2's virtual camera and a simulated drive in the places of real ones."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from virtual_camera import COLUMNS, ROWS, VirtualCamera, connected

from pipeline.bench import Experiment
from pipeline.data.gratings import GratingSample
from pipeline.data.photographs import Photo
from pipeline.devices.gphoto_camera import GphotoCamera
from pipeline.devices.lab import ManualLight, PolarizationBench
from pipeline.devices.protocols import Camera, Light, PolarizationRig
from pipeline.devices.rotation_mount import CanopenRotationMount, SimulatedRotationMount
from pipeline.errors import DeviceError, InputError, InputErrors
from pipeline.optics.angles import axial_difference
from pipeline.stages.capture.polarizer_sequence import polarizer_sequence
from pipeline.stages.fit.cosine import cosine

AXES_DEG = (20.0, 110.0)


@pytest.fixture
def virtual(tmp_path_factory: pytest.TempPathFactory) -> Iterator[VirtualCamera]:
    with connected(tmp_path_factory.getbasetemp()) as camera:
        camera.sees_grey(128)
        yield camera


class Still:
    """A camera that always delivers the same colour photo, and tells when it is open."""

    def __init__(self, image: np.ndarray, diary: list[str]) -> None:
        self.image, self.diary = image, diary

    def expose(self) -> Photo:
        return Photo(self.image, (self.image >= 1).any(axis=-1))

    def __enter__(self) -> Still:
        self.diary.append("camera opened")
        return self

    def __exit__(self, *_: object) -> None:
        self.diary.append("camera closed")


class Broken:
    """A mount that cannot be opened."""

    stops_rad = None

    def move_to(self, angle_rad: float) -> float:
        return angle_rad

    def __enter__(self) -> Broken:
        raise DeviceError("the mount is broken")

    def __exit__(self, *_: object) -> None:
        raise AssertionError("what was not opened is not closed")


COLOURS = np.stack([np.full((2, 3), v, np.float32) for v in (1.0, 0.5, 0.25)], axis=-1)


def test_four_photographs_through_libgphoto2_and_a_canopen_drive(virtual: VirtualCamera) -> None:
    mount = SimulatedRotationMount()
    bench = PolarizationBench(
        camera=GphotoCamera(settings={"shutterspeed": "0.0050s"}, wait_ms=1),
        mount=mount,
        light=ManualLight(),
        wavelength_nm=532.0,
        pixel_mm=0.03,
    )
    assert isinstance(bench, PolarizationRig)
    assert isinstance(bench.camera, Camera)
    bench.check()
    photos = polarizer_sequence(None, rig=bench, count=4)
    assert photos.images.shape == (4, ROWS, COLUMNS)
    assert np.rad2deg(photos.polarizer_rad) == pytest.approx([0, 45, 90, 135], abs=1e-3)
    assert photos.exposure_s == (0.005,) * 4
    assert (photos.wavelength_nm, photos.pixel_mm) == (532.0, 0.03)
    assert photos.metadata["model"] == "Nikon DSC D750"
    assert photos.valid.all()
    assert mount.shaft_rad == pytest.approx(np.deg2rad(135), abs=1e-5)


def test_polarised_light_comes_through_all_of_it(virtual: VirtualCamera) -> None:
    """Two halves behind polarisers at 20 and 110 degrees, photographed as JPEG; the fit finds both."""
    axes = np.deg2rad(np.repeat(AXES_DEG, COLUMNS // 2))[np.newaxis, :].repeat(ROWS, axis=0)

    class Scene(SimulatedRotationMount):
        def move_to(self, angle_rad: float) -> float:
            reached = super().move_to(angle_rad)
            light = 0.1 + 0.8 * np.cos(self.shaft_rad - axes) ** 2
            encoded = np.where(light > 0.0031308, 1.055 * light ** (1 / 2.4) - 0.055, 12.92 * light)
            virtual.sees(np.rint(255 * encoded).astype(np.uint8)[..., np.newaxis].repeat(3, axis=-1))
            return reached

    bench = PolarizationBench(camera=GphotoCamera(wait_ms=1), mount=Scene(), light=ManualLight())
    fitted = cosine(polarizer_sequence(None, rig=bench, count=6), prenormalize=False)
    inside = np.r_[4 : COLUMNS // 2 - 4, COLUMNS // 2 + 4 : COLUMNS - 4]  # JPEG codes blocks of 8, so the seam rings
    error = axial_difference(fitted.orientation_rad, axes.astype(np.float32))[:, inside]
    assert np.rad2deg(np.abs(error)).max() < 1.0
    assert fitted.correlation[:, inside].min() > 0.999


@pytest.mark.parametrize(
    ("channel", "value"),
    [("green", 0.5), ("red", 1.0), ("blue", 0.25), ("auto", 1.0), ("luminance", 0.2126 + 0.7152 / 2 + 0.0722 / 4)],
)
def test_a_spectral_filter_needs_one_channel(channel: str, value: float) -> None:
    bench = PolarizationBench(
        camera=Still(COLOURS, []),
        mount=SimulatedRotationMount(),
        light=ManualLight(),
        channel=channel,
        wavelength_nm=633.0,
    )
    photo = bench.camera.expose()
    assert photo.image == pytest.approx(np.full((2, 3), value), abs=1e-6)
    assert photo.saturated.all() == (value == 1.0 or channel == "luminance")


def test_a_virtual_sample_cannot_be_laid_on_a_real_bench() -> None:
    bench = PolarizationBench(camera=Still(COLOURS, []), mount=SimulatedRotationMount(), light=ManualLight())
    bench.place(None)
    flat = np.zeros((2, 2), np.float32)
    with pytest.raises(InputError, match="'logo' is a virtual sample"):
        bench.place(GratingSample(flat, flat, 0.01, 0.2, 1.0, 0.0, 0.0, 0.0, 0.1, "logo"))


def test_what_was_opened_is_closed_when_the_next_device_fails() -> None:
    diary: list[str] = []
    bench = PolarizationBench(camera=Still(COLOURS, diary), mount=Broken(), light=ManualLight())
    with pytest.raises(DeviceError, match="the mount is broken"), bench:
        pass
    assert diary == ["camera opened", "camera closed"]


def test_a_bench_can_be_opened_again() -> None:
    diary: list[str] = []
    bench = PolarizationBench(camera=Still(COLOURS, diary), mount=SimulatedRotationMount(), light=ManualLight())
    for _ in range(2):
        with bench:
            assert bench.mount.move_to(0.3) == pytest.approx(0.3, abs=1e-4)
    assert diary == ["camera opened", "camera closed"] * 2


def test_all_that_devices_miss_is_found_before_anything_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    class Wrong(Broken):
        def check(self) -> None:
            raise InputError("the mount is set to no bus")

    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    bench = PolarizationBench(camera=GphotoCamera(), mount=Wrong(), light=ManualLight())
    with pytest.raises(InputErrors, match="gphoto2") as caught:
        bench.check()
    assert [error.what for error in caught.value.errors][1:] == ["the mount is set to no bus"]
    assert [error.where for error in caught.value.errors] == ["camera", "mount"]


def test_sizes_that_nothing_has_are_found_beside_what_devices_miss() -> None:
    mount = CanopenRotationMount(heartbeat_s=100.0, tolerance_deg=-1.0)
    bench = PolarizationBench(
        camera=GphotoCamera(wait_ms=0), mount=mount, light=ManualLight(), wavelength_nm=-530.0, pixel_mm=0.0
    )
    with pytest.raises(InputErrors, match="wait_ms is 0") as caught:
        bench.check()
    assert [error.where for error in caught.value.errors] == [
        "camera: wait_ms",
        "mount: tolerance_deg",
        "mount: heartbeat_s",
        "wavelength_nm",
        "pixel_mm",
    ]


def test_a_light_switched_by_hand_is_noted(caplog: pytest.LogCaptureFixture) -> None:
    light = ManualLight(name="tablet")
    assert isinstance(light, Light)
    with caplog.at_level(logging.INFO, "pipeline"):
        light.switch(True)
        light.switch(False)
    assert [r.getMessage() for r in caplog.records] == ["the tablet is switched by hand and was taken to be on"]


def test_photographs_from_a_laboratory_are_sources(tmp_path: Path) -> None:
    words = [
        "+experiment=polarization_logo",
        "rig=polarization_lab",
        "rig.mount.channel=can1",
        f"paths.runs={tmp_path}",
    ]
    graph = Experiment.load(words).graph
    assert graph.nodes["photos"].is_source
    assert {name for name, node in graph.nodes.items() if node.is_source} == {"photos"}
    assert "evaluate" in graph.absent
