"""A flash in somebody's hand, and brackets through libgphoto2's virtual camera."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import numpy as np
import pytest
from virtual_camera import COLUMNS, ROWS, VirtualCamera, connected

from pipeline.devices.gphoto_camera import GphotoCamera
from pipeline.devices.lab_flash import FlashBench, HandHeldFlash
from pipeline.devices.protocols import BracketingCamera, FlashRig
from pipeline.errors import DeviceError, InputError, InputErrors
from pipeline.stages.capture.flash_photographs import flash_photographs
from pipeline.stages.simulate.polygons import polygons

LIGHTS = [[100.0, 0.0, 250.0], [0.0, 100.0, 250.0]]


@pytest.fixture
def virtual(tmp_path_factory: pytest.TempPathFactory) -> Iterator[VirtualCamera]:
    with connected(tmp_path_factory.getbasetemp()) as camera:
        camera.sees_grey(128)
        yield camera


def bench(**camera: object) -> FlashBench:
    settings = {"wait_ms": 1, "exposure_s": [0.005, 0.02], "room_exposure_s": 0.01} | camera
    return FlashBench(
        camera=GphotoCamera(**settings),
        light=HandHeldFlash(lights_mm=LIGHTS, pause_s=0.0),
        sheet_mm=[297.0, 210.0],
        camera_mm=[0.0, 0.0, 500.0],
        raw=False,
    )


def test_a_bracket_at_each_place_and_one_under_room_light(
    virtual: VirtualCamera, caplog: pytest.LogCaptureFixture
) -> None:
    rig = bench()
    assert isinstance(rig, FlashRig)
    assert isinstance(rig.camera, BracketingCamera)
    rig.check()
    with caplog.at_level(logging.INFO, "pipeline"):
        taken = flash_photographs(rig=rig)
    assert taken.images.shape == (2, 2, ROWS, COLUMNS, 3)
    assert taken.images.dtype == np.uint8
    assert taken.images.mean() == pytest.approx(128, abs=1)  # as stored: no curve is undone
    assert taken.room is not None
    assert taken.exposure_s.tolist() == [0.005, 0.02]
    assert taken.light_mm.tolist() == LIGHTS
    told = [record.getMessage() for record in caplog.records if record.name.endswith("lab_flash")]
    assert told == [
        "hold the flash at [100.0, 0.0, 250.0] mm, within 0 s",
        "hold the flash at [0.0, 100.0, 250.0] mm, within 0 s",
        "switch the flash off and the lamps of the room on, within 0 s",
    ]


def test_a_shutter_speed_that_the_camera_lacks_is_an_error(virtual: VirtualCamera) -> None:
    with pytest.raises(DeviceError, match=r"cannot expose for 1e-07 s; the nearest is 0\.000"):
        flash_photographs(rig=bench(exposure_s=[1e-7]))


def test_a_camera_that_is_not_open_takes_nothing() -> None:
    with pytest.raises(DeviceError, match="the camera is not open"):
        GphotoCamera().expose_for(0.1)


def test_what_a_bench_cannot_be_is_found_together() -> None:
    wrong = FlashBench(
        camera=GphotoCamera(exposure_s=[]), light=HandHeldFlash(lights_mm=[]), sheet_mm=[297.0, -1.0], bandwidth_nm=-3.0
    )
    with pytest.raises(
        InputErrors, match=r"there is no light[\s\S]*is no size[\s\S]*exposure_s is \[\][\s\S]*bandwidth_nm is -3"
    ):
        wrong.check()


def test_a_virtual_sample_cannot_be_laid_on_a_real_table() -> None:
    with pytest.raises(InputError, match="'polygons' is a virtual sample"):
        bench().place(polygons(pixel_mm=2.0))
