"""A bench in a laboratory: devices that exist, composed into a rig."""

from __future__ import annotations

import logging
from contextlib import AbstractContextManager, ExitStack
from types import TracebackType
from typing import Literal, Self

from pipeline.data.gratings import GratingSample
from pipeline.data.photographs import Photo
from pipeline.devices.photo_files import Channel, channel_of
from pipeline.devices.protocols import Camera, Light, RotationMount
from pipeline.errors import InputError
from pipeline.limits import above_zero, found_by, refuse

log = logging.getLogger(__name__)


class ManualLight:
    """A light that a hand switches, or that is always on.

    Parameters
    ----------
    name : str
        What to call it.
    """

    def __init__(self, *, name: str = "panel") -> None:
        self.name = name

    def switch(self, on: bool) -> None:
        """Leave it to the hand, and note that the capture took the light to be on."""
        if on:
            log.info("the %s is switched by hand and was taken to be on", self.name)


class PolarizationBench:
    """A camera behind a turning polariser above a lit sample, in a laboratory.

    Parameters
    ----------
    camera : Camera
        The camera.
    mount : RotationMount
        The polariser's mount.
    light : Light
        The panel.
    wavelength_nm : float, optional
        Centre of the spectral filter.
    pixel_mm : float, optional
        Pixel pitch on the sample.
    channel : {"green", "red", "blue", "luminance", "auto"}
        What to take of colour photographs: the channel that the spectral filter leaves bright; ``auto`` is the one in
        which ``wavelength_nm`` falls.
    """

    physical = True

    def __init__(
        self,
        *,
        camera: Camera,
        mount: RotationMount,
        light: Light,
        wavelength_nm: float | None = None,
        pixel_mm: float | None = None,
        channel: Literal["auto", "green", "red", "blue", "luminance"] = "green",
    ) -> None:
        self.camera: Camera = _OneChannel(camera, channel, wavelength_nm)
        self.mount = mount
        self.light = light
        self.wavelength_nm = wavelength_nm
        self.pixel_mm = pixel_mm
        self._devices = {"camera": camera, "mount": mount, "light": light}
        self._stack = ExitStack()

    def place(self, sample: GratingSample | None) -> None:
        """Take what lies on the bench; a virtual sample cannot be put there.

        Raises
        ------
        InputError
            There is a virtual sample.
        """
        if sample is not None:
            raise InputError(
                f"'{sample.name}' is a virtual sample and cannot be laid on a real bench",
                expected="no sample: `when: ${rig.simulated}` leaves its node out",
            )

    def check(self) -> None:
        """Let each device find, without moving anything, what would make it fail.

        Raises
        ------
        InputError, InputErrors
            All that was found, each with its place.
        """
        refuse(found_by(self._devices), above_zero(wavelength_nm=self.wavelength_nm, pixel_mm=self.pixel_mm))

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            for device in self._devices.values():
                if isinstance(device, AbstractContextManager):
                    stack.enter_context(device)
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.__exit__(kind, error, trace)


class _OneChannel:
    """A camera of whose colour photographs one channel is used."""

    def __init__(self, camera: Camera, channel: Channel, wavelength_nm: float | None) -> None:
        self._camera, self._channel, self._wavelength_nm = camera, channel, wavelength_nm

    def expose(self) -> Photo:
        """Take one photograph."""
        return channel_of(self._camera.expose(), self._channel, wavelength_nm=self._wavelength_nm)
