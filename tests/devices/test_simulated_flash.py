"""A virtual sheet under a virtual flash, by what geometry and the grating equation say of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.data.flash import FlashBrackets, FlashPhotographs
from pipeline.data.gratings import GratingSample
from pipeline.devices.flash_camera import FlashCamera
from pipeline.devices.protocols import BracketingCamera, FlashRig, MovedFlash
from pipeline.devices.simulated_flash import FlashBench, PhoneFlash
from pipeline.errors import InputError
from pipeline.optics.sheet.view import rectified as scanned
from pipeline.stages.align.radiance import radiance
from pipeline.stages.align.rectified import rectified
from pipeline.stages.capture.flash_photographs import flash_photographs
from pipeline.stages.simulate.polygons import polygons

LIGHTS = [[60.0, 25.0, 200.0], [-40.0, 50.0, 180.0]]
CAMERA = [10.0, -15.0, 400.0]


@pytest.fixture(scope="module")
def sample() -> GratingSample:
    return polygons(pixel_mm=0.4)


def bench(**camera: object) -> FlashBench:
    seen = {"size_px": [300, 220], "camera_mm": CAMERA, "samples": 1, "raw": True} | camera
    return FlashBench(
        camera=FlashCamera(**seen),
        light=PhoneFlash(lights_mm=LIGHTS, wavelength_step_nm=5.0),
        tiles=[5, 4],
        knows_corners=True,
    )


@pytest.fixture(scope="module")
def sheet(sample: GratingSample) -> FlashPhotographs:
    return rectified(radiance(flash_photographs(sample, rig=bench())))


def places(photos: FlashPhotographs) -> NDArray:
    rows, columns = photos.valid.shape[1:]
    assert photos.pixel_mm is not None
    grid = np.meshgrid(np.arange(columns, dtype=float), np.arange(rows, dtype=float))
    return scanned(rows, columns, photos.pixel_mm, np.zeros(3)).points(*grid)


def test_the_bench_is_a_rig() -> None:
    rig = bench()
    assert isinstance(rig, FlashRig)
    assert isinstance(rig.camera, BracketingCamera)
    assert isinstance(rig.light, MovedFlash)


@pytest.mark.parametrize("index", [0, 1])
def test_the_highlight_lies_where_the_sheet_mirrors_the_flash(sheet: FlashPhotographs, index: int) -> None:
    light, camera = np.array(LIGHTS[index]), np.array(CAMERA)
    mirror = (light[:2] * camera[2] + camera[:2] * light[2]) / (light[2] + camera[2])
    bright = sheet.radiance[index].sum(axis=-1)
    core = bright > 0.5 * bright.max()
    found = np.average(places(sheet)[core], axis=0, weights=bright[core])
    assert found == pytest.approx(mirror, abs=2 * sheet.pixel_mm)


def test_behind_a_filter_what_is_lit_obeys_the_grating_equation(sample: GratingSample) -> None:
    """``|u| = lambda / a`` with u the half vector's part along the tangent, which is all of its part in the sheet."""
    photos = rectified(radiance(flash_photographs(sample, rig=bench(wavelength_nm=530.0, bandwidth_nm=5.0))))
    place = np.concatenate([places(photos), np.zeros((*photos.valid.shape[1:], 1))], axis=-1)
    half = np.zeros_like(place)
    for point in (np.array(LIGHTS[0]), np.array(CAMERA)):
        way = point - place
        half += way / np.linalg.norm(way, axis=-1, keepdims=True)
    across = np.hypot(half[..., 0], half[..., 1])
    lit = (photos.radiance[0, ..., 1] > 0.3 * np.percentile(photos.radiance[0, ..., 1], 99.5)) & (across > 0.12)
    assert lit.sum() > 50
    assert np.median(across[lit]) == pytest.approx(0.530 / (5 / 3), rel=0.03)
    assert photos.radiance[0, lit, 1].sum() > 5 * photos.radiance[0, lit, 2].sum()


def test_raw_and_encoded_photographs_tell_the_same_radiance(sample: GratingSample, sheet: FlashPhotographs) -> None:
    photos = rectified(radiance(flash_photographs(sample, rig=bench(raw=False))))
    lit = (sheet.radiance > 2e-3) & sheet.valid[..., None] & photos.valid[..., None]
    ratio = np.log(photos.radiance[lit] / sheet.radiance[lit])
    assert lit.sum() > 1000
    assert np.std(ratio) < 0.06
    assert abs(np.median(ratio)) < 0.15


def test_what_is_stored_has_the_depth_that_is_stated(sample: GratingSample) -> None:
    raw = flash_photographs(sample, rig=bench(exposure_s=[0.01]))
    encoded = flash_photographs(sample, rig=bench(exposure_s=[0.01], raw=False))
    assert (raw.images.dtype, encoded.images.dtype) == (np.uint16, np.uint8)
    assert raw.images.shape == encoded.images.shape == (2, 1, 220, 300, 3)
    assert (raw.linear, encoded.linear) == (True, False)
    assert raw.sheet_mm == pytest.approx((140.0, 112.0))


def test_places_may_be_measured_wrong(sample: GratingSample) -> None:
    rig = FlashBench(
        camera=FlashCamera(size_px=[60, 45], camera_mm=CAMERA, samples=1),
        light=PhoneFlash(lights_mm=LIGHTS, error_mm=[0.0, 0.0, 12.0]),
        tiles=[5, 4],
        camera_error_mm=[5.0, 0.0, 0.0],
    )
    taken: FlashBrackets = flash_photographs(sample, rig=rig)
    assert taken.light_mm == pytest.approx(np.add(LIGHTS, [0, 0, 12]))
    assert taken.camera_mm == pytest.approx([15.0, -15.0, 400.0])
    assert taken.corners_px is None


def test_polygons_go_on_across_the_edges_of_their_tile(sample: GratingSample) -> None:
    inside = np.diff(sample.orientation_rad, axis=1) != 0
    across = sample.orientation_rad[:, 0] != sample.orientation_rad[:, -1]
    assert across.mean() < 3 * inside.mean() + 0.05
    assert len(np.unique(sample.orientation_rad)) == 8


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"exposure_s": [0.1, 0.01]}, "times above 0 in s, the shortest first"),
        ({"wavelength_nm": 530.0}, "a filter has both a centre and a width"),
        ({"size_px": [0, 10]}, r"size_px[\s\S]*whole numbers from 1"),
        ({"target_mm": CAMERA}, "target_mm is where the camera is"),
    ],
)
def test_cameras_that_cannot_be_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        FlashCamera(**{"camera_mm": CAMERA} | change).check()


def test_lights_and_errors_that_cannot_be_are_refused() -> None:
    with pytest.raises(InputError, match=r"\[1\.0, 2\.0\] is no displacement"):
        PhoneFlash(error_mm=[1.0, 2.0]).check()
    with pytest.raises(InputError, match=r"lights_mm\[0\][\s\S]*z above the sheet's 0"):
        PhoneFlash(lights_mm=[[0.0, 0.0, -5.0]]).check()


def test_a_bench_needs_its_own_devices_and_a_sample() -> None:
    with pytest.raises(InputError, match="the simulated bench has no sample"):
        bench().place(None)
    with pytest.raises(InputError, match="needs a simulated camera and flash"):
        FlashBench(camera=FlashCamera(), light=object())  # type: ignore[arg-type]
    with pytest.raises(InputError, match="nothing lies before the simulated camera"):
        FlashCamera().expose_for(0.1)


def test_a_sheet_without_corners_or_size_cannot_be_rectified(sheet: FlashPhotographs) -> None:
    unknown = replace(sheet, corners_px=None, sheet_mm=None)
    with pytest.raises(InputError, match="the size of the sheet is not known"):
        rectified(unknown)
    with pytest.raises(InputError, match="no corners are given"):
        rectified(unknown, corners="given", sheet_mm=[140.0, 112.0])
    with pytest.raises(InputError, match="are none of a sheet"):
        rectified(unknown, corners_px=[[0, 0], [9, 9], [3, 3], [5, 5.1]], sheet_mm=[140.0, 112.0])
