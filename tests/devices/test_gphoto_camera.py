"""A camera on a cable, tried for real on libgphoto2's virtual one."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator

import numpy as np
import pytest
from virtual_camera import COLUMNS, ROWS, VirtualCamera, connected

from pipeline.devices.gphoto_camera import GphotoCamera, _meant, _rank, _seconds
from pipeline.devices.protocols import Camera
from pipeline.errors import DeviceError, InputError

NAME = r"camera Nikon DSC D750 on usb:001,001"


@pytest.fixture
def virtual(tmp_path_factory: pytest.TempPathFactory) -> Iterator[VirtualCamera]:
    with connected(tmp_path_factory.getbasetemp()) as camera:
        camera.sees_grey(128)
        yield camera


def test_a_photo_is_linear_and_says_how_it_was_taken(virtual: VirtualCamera) -> None:
    with GphotoCamera(wait_ms=1, settings={"shutterspeed": "0.0050s", "f-number": "f/5.6"}) as camera:
        assert isinstance(camera, Camera)
        photo = camera.expose()
    assert photo.image.shape == (ROWS, COLUMNS, 3)
    assert photo.image.dtype == np.float32
    assert photo.image.mean() == pytest.approx(0.2158, abs=0.004)  # IEC 61966-2-1 of 128 / 255
    assert not photo.saturated.any()
    assert photo.exposure_s == 0.005
    assert photo.metadata["model"] == "Nikon DSC D750"
    assert photo.metadata["aperture"] == "f/5.6"


def test_what_the_file_tells_wins_over_the_settings(virtual: VirtualCamera) -> None:
    virtual.sees(np.full((ROWS, COLUMNS, 3), 90, np.uint8), Model="Bench 1", ExposureTime=0.25, FNumber=8.0)
    with GphotoCamera(wait_ms=1) as camera:
        photo = camera.expose()
    assert photo.exposure_s == 0.25
    assert photo.metadata["model"] == "Bench 1"
    assert photo.metadata["aperture"] == "8"


def test_each_photo_is_what_stands_before_the_camera_then(virtual: VirtualCamera) -> None:
    means = []
    with GphotoCamera(wait_ms=1) as camera:
        for level in (40, 200, 255):
            virtual.sees_grey(level)
            photo = camera.expose()
            means.append(photo.image.mean())
    assert means == pytest.approx([0.0212, 0.5776, 1.0], abs=0.004)
    assert photo.saturated.all()


@pytest.mark.parametrize(("keep", "left"), [(False, 0), (True, 1)])
def test_photos_fill_the_camera_up_only_when_asked_to(virtual: VirtualCamera, keep: bool, left: int) -> None:
    with GphotoCamera(wait_ms=1, keep=keep) as camera:
        camera.expose()
        assert camera._camera.folder_list_files("/store_00010001/DCIM/100GPHOT").count() == left


def test_a_guessed_tone_curve_is_warned_of_once(virtual: VirtualCamera, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "pipeline"), GphotoCamera(wait_ms=1) as camera:
        camera.expose()
        camera.expose()
    assert [r.getMessage() for r in caplog.records] == [
        "camera Nikon DSC D750 on usb:001,001 delivers .JPG, whose tone curve is only guessed: set it to raw"
    ]


def test_settings_are_kept_by_the_camera(virtual: VirtualCamera) -> None:
    settings = {"shutterspeed": "1.0000s", "exposurecompensation": "-1", "fastfs": "0", "thumbsize": "large"}
    with GphotoCamera(settings=settings) as camera:
        assert {name: str(camera._value(name)) for name in settings} == settings


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({"shutterspeeed": "1.0000s"}, "has no setting 'shutterspeeed'; did you mean 'shutterspeed'"),
        ({"f-number": "f/5.5"}, "cannot set 'f-number' to 'f/5.5'; did you mean 'f/5.6'"),
        ({"fastfs": "often"}, "cannot set 'fastfs' to 'often': it is no number"),
        ({"batterylevel": "100%"}, "does not let 'batterylevel' be set from outside; it is 50%"),
    ],
)
def test_a_wrong_setting_is_named_before_a_photo(
    virtual: VirtualCamera, settings: dict[str, str], complaint: str
) -> None:
    with pytest.raises(DeviceError, match=rf"{NAME} {complaint}"), GphotoCamera(settings=settings):
        pass


@pytest.mark.parametrize(
    "words", [{"model": "d750"}, {"port": "usb:001,001"}, {"model": "Nikon", "port": "usb:001,001"}]
)
def test_a_camera_is_found_by_part_of_its_name_or_its_port(virtual: VirtualCamera, words: dict[str, str]) -> None:
    with GphotoCamera(**words) as camera:
        assert camera.name == NAME


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ({"model": "EOS"}, "camera EOS is not connected; connected is Nikon DSC D750 on usb:001,001"),
        ({"port": "usb:001,009"}, "camera on usb:001,009 is not connected; connected is Nikon"),
    ],
)
def test_a_camera_that_is_not_there_is_named(virtual: VirtualCamera, words: dict[str, str], complaint: str) -> None:
    with pytest.raises(DeviceError, match=complaint), GphotoCamera(**words):
        pass


def test_two_cameras_must_be_told_apart() -> None:
    there = [("Nikon DSC D750", "usb:001,001"), ("Nikon DSC D850", "usb:001,002")]
    assert _meant(there, "d850", "") == there[1]
    assert _meant(there, "", "usb:001,001") == there[0]
    with pytest.raises(DeviceError, match=r"several cameras fit \(Nikon DSC D750 on usb:001,001, Nikon DSC D850 on"):
        _meant(there, "nikon", "")


def test_no_camera_at_all(tmp_path_factory: pytest.TempPathFactory) -> None:
    with (
        connected(tmp_path_factory.getbasetemp(), cameras=False),
        pytest.raises(DeviceError, match="camera is not connected; no camera is: are its cable, power and USB mode"),
        GphotoCamera(),
    ):
        pass


def test_a_file_that_is_no_photo_is_named(virtual: VirtualCamera) -> None:
    virtual.delivers(b"no photo at all")
    with (
        GphotoCamera(wait_ms=1) as camera,
        pytest.raises(DeviceError, match=rf"{NAME}: what it delivered as GPH_\d+\.JPG"),
    ):
        camera.expose()


def test_libgphoto2_complains_in_words(virtual: VirtualCamera, monkeypatch: pytest.MonkeyPatch) -> None:
    import gphoto2

    class Unplugged:
        def capture(self, _: int) -> None:
            raise gphoto2.GPhoto2Error(gphoto2.GP_ERROR_IO_USB_FIND)

    with GphotoCamera(wait_ms=1) as camera:
        whole, camera._camera = camera._camera, Unplugged()
        with pytest.raises(DeviceError, match=rf"{NAME} does not take the photo: Could not find the requested device"):
            camera.expose()
        camera._camera = whole


def test_it_is_opened_before_it_takes_photos() -> None:
    with pytest.raises(DeviceError, match="camera is not open"):
        GphotoCamera().expose()


def test_without_the_library_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gphoto2", None)
    with pytest.raises(DeviceError, match=r"gphoto2 is not installed: pip install gphoto2"):
        GphotoCamera().__enter__()
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install gphoto2"):
        GphotoCamera().check()


def test_raw_files_come_before_pictures_for_a_display() -> None:
    assert sorted(["a.JPG", "a.tif", "a.NEF"], key=_rank) == ["a.NEF", "a.tif", "a.JPG"]


@pytest.mark.parametrize(
    ("shutter", "seconds"), [("1/4", 0.25), ("0.0100s", 0.01), ("30", 30.0), ("0.5", 0.5), ("bulb", None), ("", None)]
)
def test_shutter_settings_in_seconds(shutter: str, seconds: float | None) -> None:
    assert _seconds(shutter) == seconds
