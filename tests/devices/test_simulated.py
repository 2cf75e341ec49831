"""The virtual bench: what is photographed is the forward model, plus exactly the imperfections that were asked for."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from pipeline.data.gratings import GratingSample
from pipeline.devices.protocols import PolarizationRig
from pipeline.devices.rotation_mount import SimulatedRotationMount
from pipeline.devices.simulated import Camera, Panel, PolarizationBench
from pipeline.errors import DeviceError, InputError, InputErrors
from pipeline.optics.jones import polarizer_response
from pipeline.stages.capture.polarizer_sequence import polarizer_sequence

PERFECT = {"read_noise_electrons": 0.0, "shot_noise": False, "bits": None, "blur_mm": 0.0, "shift_px": 0.0}


def halves(size: int = 90) -> GratingSample:
    """Left half at 20 degrees with the longest period, right half at 110 with half of it, ground above."""
    orientation = np.full((size, size), np.deg2rad(20), np.float32)
    orientation[:, size // 2 :] = np.deg2rad(110)
    period = np.where(orientation < 1, 1.4, 0.7).astype(np.float32)
    orientation[: size // 3] = period[: size // 3] = np.nan
    return GratingSample(orientation, period, 0.01, 0.12, 1.1, 0.8, 0.05, 0.0, 0.03, "halves")


def bench(**camera) -> PolarizationBench:
    return PolarizationBench(
        camera=Camera(pixel_mm=0.03, **{**PERFECT, **camera}), mount=SimulatedRotationMount(), light=Panel()
    )


def test_it_is_a_rig() -> None:
    assert isinstance(bench(), PolarizationRig)


def test_a_perfect_camera_sees_the_forward_model() -> None:
    sample = halves()
    photos = polarizer_sequence(sample, rig=bench(electrons=10_000.0, full_well_electrons=25_000.0), count=5)
    assert photos.images.shape == (5, 30, 30)
    settings = {"amplitude_ratio": 1.1, "phase_rad": 0.8, "retardation_rad": 0.05}
    for image, psi in zip(photos.images, photos.polarizer_rad, strict=True):
        long = 0.4 * polarizer_response(psi, np.deg2rad(20), **settings)
        short = 0.4 / 4 * polarizer_response(psi, np.deg2rad(110), **settings)
        assert image[20, 5] == pytest.approx(long, rel=1e-5)
        assert image[20, 25] == pytest.approx(short, rel=1e-5)
        assert image[2, 5] == pytest.approx(0.4 * 0.03, rel=1e-5)


def test_maps_of_the_optics_and_a_veil_are_seen_point_by_point() -> None:
    sample = halves()
    right = np.arange(90)[None, :] >= 45
    phase, axis = (
        np.where(right, *two).astype(np.float32) * np.ones((90, 1), np.float32) for two in ((0.8, 1.9), (0.0, 0.6))
    )
    veil = np.where(right, 0.25, 0.0).astype(np.float32) * np.ones((90, 1), np.float32)
    sample = replace(sample, phase_rad=phase, film_axis_rad=axis, veil=veil)
    photos = polarizer_sequence(sample, rig=bench(electrons=10_000.0, full_well_electrons=25_000.0), count=5)
    for image, psi in zip(photos.images, photos.polarizer_rad, strict=True):
        both = {"amplitude_ratio": 1.1, "retardation_rad": 0.05}
        left = polarizer_response(psi, np.deg2rad(20), phase_rad=1.9, film_axis_rad=0.6, **both)
        shorter = polarizer_response(psi, np.deg2rad(110), phase_rad=0.8, film_axis_rad=0.0, **both) / 4
        assert image[20, 5] == pytest.approx(0.4 * left, rel=1e-5)
        assert image[20, 25] == pytest.approx(0.4 * (shorter + 0.25), rel=1e-5)
        assert image[2, 25] == pytest.approx(0.4 * (0.03 + 0.25), rel=1e-5)


def test_steps_may_go_past_half_a_turn() -> None:
    photos = polarizer_sequence(halves(), rig=bench(), count=17, step_deg=13.0)
    np.testing.assert_allclose(np.rad2deg(photos.polarizer_rad), 13.0 * np.arange(17), atol=1e-3)


@pytest.mark.parametrize("step_deg", [0.0, 90.0, 180.0])
def test_steps_that_come_back_to_the_same_angles_are_refused(step_deg: float) -> None:
    with pytest.raises(InputError, match=r"12 photographs at [12] distinct angles[\s\S]*step_deg"):
        polarizer_sequence(halves(), rig=bench(), count=12, step_deg=step_deg)


def test_the_capture_says_what_it_took() -> None:
    photos = polarizer_sequence(halves(), rig=bench(exposure_s=0.5), count=4)
    np.testing.assert_allclose(np.rad2deg(photos.polarizer_rad), [0, 45, 90, 135], atol=1e-3)
    assert (photos.pixel_mm, photos.wavelength_nm) == (0.03, 530.0)
    assert photos.exposure_s == (0.5,) * 4
    assert photos.valid.all()
    assert photos.images.dtype == np.float32


def test_quantised_photos_hold_whole_counts() -> None:
    photos = polarizer_sequence(halves(), rig=bench(bits=10, shot_noise=True), count=3)
    counts = photos.images.astype(np.float64) * 1023
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-3)


def test_the_same_seed_gives_the_same_photos_and_another_does_not() -> None:
    noisy = {"shot_noise": True, "shift_px": 0.5}
    one, same, other = (polarizer_sequence(halves(), rig=bench(**noisy, seed=s), count=3).images for s in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)


def test_the_hand_moves_every_photo_but_the_first() -> None:
    rig = bench(shift_px=0.5, seed=3)
    polarizer_sequence(halves(), rig=rig, count=12)
    shifts = np.array(rig.camera.shifts_px)
    assert (shifts[0] == 0).all()
    assert (np.abs(shifts[1:]) > 0).all()
    assert shifts[1:].std() == pytest.approx(0.5, rel=0.4)


def test_the_hand_turns_every_photo_but_the_first() -> None:
    rig = bench(turn_deg=0.3, seed=3)
    polarizer_sequence(halves(), rig=rig, count=12)
    turns = np.rad2deg(rig.camera.turns_rad)
    assert turns[0] == 0
    assert (np.abs(turns[1:]) > 0).all()
    assert turns[1:].std() == pytest.approx(0.3, rel=0.4)


def test_a_camera_that_is_not_turned_takes_the_photos_it_always_took() -> None:
    noisy = {"shot_noise": True, "shift_px": 0.5, "seed": 1}
    rigs = [bench(**noisy), bench(**noisy, turn_deg=0.0), bench(**noisy, turn_deg=0.3)]
    plain, unturned, turned = (polarizer_sequence(halves(), rig=rig, count=3).images for rig in rigs)
    np.testing.assert_array_equal(plain, unturned)
    assert not np.array_equal(plain, turned)
    assert rigs[2].camera.shifts_px == rigs[0].camera.shifts_px


def test_a_turned_photo_is_the_photo_of_the_turned_sample() -> None:
    """The boundary between the halves runs through the centre: it stays there and leans to the left at the top."""
    rig = bench(turn_deg=3.0, blur_mm=0.02, seed=5)
    photos = polarizer_sequence(halves(270), rig=rig, count=3)
    turn = rig.camera.turns_rad[1]
    assert abs(turn) > 0.02
    lower = photos.images[1, 35:85]  # below the ground
    light, dark = lower[:, :10].mean(), lower[:, -10:].mean()
    across = ((lower - dark) / (light - dark)).sum(axis=1)
    leans = np.polyfit(np.arange(35, 85) - 44.5, across, 1)
    assert leans[0] == pytest.approx(np.tan(turn), abs=2e-3)
    assert leans[1] == pytest.approx(45, abs=0.02)


def test_saturation_is_left_out_and_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    photos = polarizer_sequence(halves(), rig=bench(electrons=24_000.0, full_well_electrons=25_000.0), count=6)
    assert not photos.valid[20, 5]
    assert photos.valid[20, 25]
    assert "percent of the pixels are saturated" in caplog.text


def test_the_panel_is_off_outside_the_capture() -> None:
    rig = bench()
    polarizer_sequence(halves(), rig=rig, count=3)
    assert rig.light.present_radiance == 0


class SlippingMount:
    """Its encoder reads what was asked for, its shaft stands elsewhere, and it jams at its fourth move."""

    stops_rad = None
    shaft_rad = 0.0
    moves = 0

    def move_to(self, angle_rad: float) -> float:
        self.moves += 1
        if self.moves > 3:
            raise DeviceError("the axis jams")
        self.shaft_rad = angle_rad + 0.2
        return angle_rad


def slipping_bench() -> PolarizationBench:
    return PolarizationBench(camera=Camera(pixel_mm=0.03, **PERFECT), mount=SlippingMount(), light=Panel())


def test_light_goes_through_the_shaft_and_the_record_has_the_encoder() -> None:
    photos = polarizer_sequence(halves(), rig=slipping_bench(), count=3)
    np.testing.assert_allclose(photos.polarizer_rad, [0, np.pi / 3, 2 * np.pi / 3])
    shaft = photos.polarizer_rad + 0.2
    seen = polarizer_response(shaft, np.deg2rad(20), amplitude_ratio=1.1, phase_rad=0.8, retardation_rad=0.05)
    np.testing.assert_allclose(photos.images[:, 20, 5], 0.4 * seen, rtol=1e-5)


def test_a_failing_device_leaves_the_panel_off() -> None:
    rig = slipping_bench()
    with pytest.raises(DeviceError, match="the axis jams"):
        polarizer_sequence(halves(), rig=rig, count=5)
    assert len(rig.camera.shifts_px) == 3
    assert rig.light.present_radiance == 0


def test_a_panel_that_is_off_gives_dark_photos() -> None:
    rig = bench()
    rig.place(halves())
    with rig:
        rig.mount.move_to(0.5)
        assert (rig.camera.expose().image == 0).all()
        rig.light.switch(True)
        assert rig.camera.expose().image[20, 5] > 0.1


@pytest.mark.parametrize(
    ("setting", "value", "expected"),
    [
        ("pixel_mm", 0.0, "at least 0.00038, the shortest wavelength of light"),
        ("pixel_mm", 0.0001, "at least 0.00038"),
        ("full_well_electrons", -1.0, "above 0"),
        ("full_well_electrons", 1e30, "at most 1e\\+09"),
        ("exposure_s", 0.0, "above 0"),
        ("electrons", 0.0, "above 0"),
        ("read_noise_electrons", -1.0, "0 or more"),
        ("blur_mm", -0.1, "0 or more"),
        ("shift_px", -0.5, "0 or more"),
        ("turn_deg", -0.1, "0 or more"),
        ("seed", -1, "0 or more"),
        ("bits", 0, "1 to 24"),
        ("bits", 32, "1 to 24"),
    ],
)
def test_settings_that_no_camera_can_have_are_found_before_running(setting: str, value: float, expected: str) -> None:
    rig = PolarizationBench(camera=Camera(**{setting: value}), mount=SimulatedRotationMount(), light=Panel())
    with pytest.raises(
        InputError, match=rf"{setting} is {re.escape(format(value, 'g'))}[\s\S]*camera: {setting}[\s\S]*{expected}"
    ):
        rig.check()


def test_every_wrong_setting_is_named_at_once() -> None:
    rig = PolarizationBench(
        camera=Camera(blur_mm=-1.0),
        mount=SimulatedRotationMount(velocity_deg_s=0.0, time_scale=-1.0),
        light=Panel(radiance=0.0),
        wavelength_nm=0.0,
    )
    with pytest.raises(InputErrors) as caught:
        rig.check()
    assert [error.where for error in caught.value.errors] == [
        "camera: blur_mm",
        "mount: time_scale",
        "mount: velocity_deg_s",
        "light: radiance",
        "wavelength_nm",
    ]
    bench().check()


@pytest.mark.parametrize("count", [1, 2])
def test_two_angles_are_too_few(count: int) -> None:
    with pytest.raises(InputError, match=f"{count} photographs at {count} distinct angles"):
        polarizer_sequence(halves(), rig=bench(), count=count)


@pytest.mark.parametrize(
    ("settings", "message"),
    [({"count": 10**9}, "count is 1000000000"), ({"span_deg": 1e-3}, "within 0.00092 degrees")],
)
def test_counts_and_spans_that_nobody_means(settings: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        polarizer_sequence(halves(), rig=bench(), **settings)  # type: ignore[arg-type]


def test_half_a_turn_apart_is_the_same_angle() -> None:
    with pytest.raises(InputError, match="4 photographs at 2 distinct angles"):
        polarizer_sequence(halves(), rig=bench(), count=4, span_deg=360)


def test_the_sample_has_to_fit_the_camera() -> None:
    rig = PolarizationBench(camera=Camera(pixel_mm=0.02), mount=SimulatedRotationMount(), light=Panel())
    with pytest.raises(InputError, match="2 times the sample's"):
        rig.place(halves())


def test_nothing_can_be_photographed_without_a_sample() -> None:
    with pytest.raises(InputError, match="the simulated bench has no sample"):
        bench().place(None)
    with pytest.raises(InputError, match="nothing stands before the simulated camera"):
        Camera().expose()
