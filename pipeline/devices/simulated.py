"""A virtual polarisation bench: panel, sample, turning polariser and camera, rendered by the forward model."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import GratingSample
from pipeline.data.photographs import Photo
from pipeline.devices import protocols
from pipeline.devices.virtual_sample import SampleUnderPanel, sample_pixels_across
from pipeline.errors import InputError
from pipeline.limits import above_zero, above_zero_up_to, at_least, found_by, refuse, within, zero_or_more
from pipeline.optics.imaging import FINEST_PITCH_MM, area_average, seen_by_lens, sensor_signal

DEEPEST_BITS = 24
"""A photograph's float32 tells no more steps apart."""

LARGEST_WELL = 1e9
"""Electrons beyond those of any sensor, which NumPy can still count."""

View = Callable[[], NDArray[np.float32]]


class Panel:
    """A panel of circularly polarised light that fills the sample evenly.

    Parameters
    ----------
    radiance : float
        Relative to the panel for which the camera's exposure is stated.
    """

    def __init__(self, *, radiance: float = 1.0) -> None:
        self.radiance = radiance
        self._on = False

    def check(self) -> None:
        """Refuse a panel that gives no light.

        Raises
        ------
        InputError
            Its setting, and what was expected.
        """
        refuse(above_zero(radiance=self.radiance))

    def switch(self, on: bool) -> None:
        """Turn the panel on or off."""
        self._on = on

    @property
    def present_radiance(self) -> float:
        """Radiance now: none while the panel is off."""
        return self.radiance if self._on else 0.0


class Camera:
    """A monochrome camera on a stand that a hand on the polariser moves a little.

    Parameters
    ----------
    pixel_mm : float
        Pixel pitch on the sample; an odd multiple of the sample's own.
    full_well_electrons : float
        Electrons at full scale.
    electrons : float
        Electrons that the longest period's grating gives through an open polariser.
    read_noise_electrons : float
        Standard deviation of the read noise.
    shot_noise : bool
        Whether photons are counted.
    bits : int or None
        Depth of the converter; None for no quantisation.
    blur_mm : float
        Standard deviation of the lens' point spread function on the sample.
    shift_px : float
        Standard deviation, per axis, of the displacement of each photo after the first.
    turn_deg : float
        Standard deviation of the angle by which each photo after the first is turned about its centre.
    exposure_s : float
        Stated exposure time.
    seed : int
        Of all noise.
    """

    def __init__(
        self,
        *,
        pixel_mm: float = 0.02,
        full_well_electrons: float = 25000.0,
        electrons: float = 10000.0,
        read_noise_electrons: float = 5.0,
        shot_noise: bool = True,
        bits: int | None = 14,
        blur_mm: float = 0.012,
        shift_px: float = 0.5,
        turn_deg: float = 0.0,
        exposure_s: float = 0.25,
        seed: int = 0,
    ) -> None:
        self.pixel_mm = pixel_mm
        self.full_well_electrons = full_well_electrons
        self.electrons = electrons
        self.read_noise_electrons = read_noise_electrons
        self.shot_noise = shot_noise
        self.bits = bits
        self.blur_mm = blur_mm
        self.shift_px = shift_px
        self.turn_deg = turn_deg
        self.exposure_s = exposure_s
        self.seed = seed
        self.shifts_px: list[tuple[float, float]] = []
        self.turns_rad: list[float] = []
        self._view: View | None = None
        self._scene_pixel_mm = pixel_mm

    def check(self) -> None:
        """Refuse settings that no camera can have.

        Raises
        ------
        InputError, InputErrors
            Each setting, and what was expected.
        """
        refuse(
            at_least(FINEST_PITCH_MM, "the shortest wavelength of light", pixel_mm=self.pixel_mm),
            above_zero_up_to(LARGEST_WELL, full_well_electrons=self.full_well_electrons, electrons=self.electrons),
            above_zero(exposure_s=self.exposure_s),
            zero_or_more(read_noise_electrons=self.read_noise_electrons, blur_mm=self.blur_mm),
            zero_or_more(shift_px=self.shift_px, turn_deg=self.turn_deg, seed=self.seed),
            within(1, DEEPEST_BITS, bits=self.bits),
        )

    def look_at(self, view: View, scene_pixel_mm: float) -> None:
        """Stand before a scene, sampled at ``scene_pixel_mm``; ``view()`` is its radiance when asked.

        Raises
        ------
        InputError
            The camera's pitch is no odd multiple of the scene's, so that pixel centres would not meet.
        """
        sample_pixels_across(self.pixel_mm, scene_pixel_mm)
        self._view, self._scene_pixel_mm = view, scene_pixel_mm
        self.shifts_px, self.turns_rad = [], []

    def expose(self) -> Photo:
        """Photograph the scene as it is now.

        Raises
        ------
        InputError
            Nothing stands before the camera.
        """
        if self._view is None:
            raise InputError("nothing stands before the simulated camera", expected="rig.place(sample) first")
        index = len(self.shifts_px)
        rng = np.random.default_rng([self.seed, index])
        by_hand = rng.normal(0.0, self.shift_px, 2) if index and self.shift_px > 0 else np.zeros(2)
        turn = float(rng.normal(0.0, np.deg2rad(self.turn_deg))) if index and self.turn_deg > 0 else 0.0
        self.shifts_px.append((float(by_hand[0]), float(by_hand[1])))
        self.turns_rad.append(turn)
        ratio = round(self.pixel_mm / self._scene_pixel_mm)
        radiance = self._view()
        if turn:  # about the photo's centre, to which leftover points of the scene do not count
            radiance = radiance[: len(radiance) // ratio * ratio, : radiance.shape[1] // ratio * ratio]
        scene = seen_by_lens(
            radiance,
            blur_px=self.blur_mm / self._scene_pixel_mm,
            shift_px=(float(by_hand[0]) * ratio, float(by_hand[1]) * ratio),
            turn_rad=turn,
        )
        image, saturated = sensor_signal(
            area_average(scene, ratio) * np.float32(self.electrons / self.full_well_electrons),
            full_well_electrons=self.full_well_electrons,
            read_noise_electrons=self.read_noise_electrons,
            shot_noise=self.shot_noise,
            bits=self.bits,
            rng=rng,
        )
        return Photo(image, saturated, self.exposure_s, {"model": "simulated camera"})


class PolarizationBench:
    """A simulated camera behind a polariser that a simulated drive turns, above a lit sample.

    Parameters
    ----------
    camera : simulated.Camera
        The camera.
    mount : RotationMount
        The polariser's mount; one with ``shaft_rad`` says where its shaft really stands.
    light : simulated.Panel
        The panel.
    wavelength_nm : float
        Centre of the spectral filter.
    """

    def __init__(
        self,
        *,
        camera: protocols.Camera,
        mount: protocols.RotationMount,
        light: protocols.Light,
        wavelength_nm: float = 530.0,
    ) -> None:
        if not isinstance(camera, Camera) or not isinstance(light, Panel):
            raise InputError(
                "the simulated bench needs a simulated camera and panel",
                expected="camera: {device: simulated.Camera}, light: {device: simulated.Panel}",
            )
        self.camera = camera
        self.mount = mount
        self.light = light
        self.wavelength_nm = wavelength_nm
        self._stack = ExitStack()
        self._angle_rad = 0.0

    @property
    def pixel_mm(self) -> float:
        """Pixel pitch on the sample."""
        return self.camera.pixel_mm

    def place(self, sample: GratingSample | None) -> None:
        """Lay a virtual sample under the panel.

        Raises
        ------
        InputError
            No sample is given, or its pitch does not fit the camera's.
        """
        if sample is None:
            raise InputError("the simulated bench has no sample", expected="sample: a node such as simulate.logo")
        scene = SampleUnderPanel(sample)
        mount = self.mount
        if not isinstance(mount, _VisibleShaft):
            raise InputError("the simulated bench needs a mount whose shaft it can see", expected="a simulated mount")

        def view() -> NDArray[np.float32]:
            return scene.through_polarizer(mount.shaft_rad) * np.float32(self.light.present_radiance)

        self.camera.look_at(view, sample.pixel_mm)

    def check_pitch(self, sample_pixel_mm: float) -> None:
        """Refuse a sample of that pitch before it is made.

        Raises
        ------
        InputError
            The pitch does not fit the camera's.
        """
        try:
            sample_pixels_across(self.camera.pixel_mm, sample_pixel_mm)
        except InputError as error:
            raise error.at("camera.pixel_mm") from None

    def check(self) -> None:
        """Find settings that no bench can have.

        Raises
        ------
        InputError, InputErrors
            All of them, each with its place.
        """
        refuse(
            found_by({"camera": self.camera, "mount": self.mount, "light": self.light}),
            above_zero(wavelength_nm=self.wavelength_nm),
        )

    def __enter__(self) -> Self:
        for device in (self.camera, self.mount, self.light):
            if isinstance(device, AbstractContextManager):
                self._stack.enter_context(device)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()


@runtime_checkable
class _VisibleShaft(Protocol):
    """A simulated mount, which can be asked where its shaft really stands."""

    @property
    def shaft_rad(self) -> float: ...
