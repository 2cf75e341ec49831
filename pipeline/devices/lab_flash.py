"""A camera above a holographic sheet, and a flash that somebody holds, in a laboratory."""

from __future__ import annotations

import logging
import time
from contextlib import AbstractContextManager, ExitStack
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import GratingSample
from pipeline.devices.flash_camera import unordered_exposures
from pipeline.devices.protocols import BracketingCamera, MovedFlash
from pipeline.errors import InputError
from pipeline.limits import above_zero, found_by, refuse, zero_or_more

log = logging.getLogger(__name__)


class HandHeldFlash:
    """A flash that a hand holds where it is told to.

    Parameters
    ----------
    lights_mm : list of [x, y, z]
        Places to hold it in: x right, y up, z towards the camera, origin in the middle of the sheet.
    pause_s : float
        Time to get there.
    """

    physical = True

    def __init__(self, *, lights_mm: list[list[float]], pause_s: float = 15.0) -> None:
        self.lights_mm = lights_mm
        self.pause_s = pause_s
        self._index: int | None = -1

    @property
    def light_mm(self) -> NDArray[np.float64]:
        """Its places, shape (L, 3)."""
        return np.asarray(self.lights_mm, np.float64)

    def check(self) -> None:
        """Refuse places behind the sheet.

        Raises
        ------
        InputError, InputErrors
            Each, and what was expected.
        """
        problems = [
            InputError(f"{list(place)} is no place", where=f"lights_mm[{index}]", expected="[x, y, z] in mm, z above 0")
            for index, place in enumerate(self.lights_mm)
            if len(place) != 3 or not np.isfinite(place).all() or place[2] <= 0
        ]
        if not self.lights_mm:
            problems = [InputError("there is no light", where="lights_mm", expected="at least one place [x, y, z]")]
        refuse(problems, zero_or_more(pause_s=self.pause_s))

    def put(self, index: int | None) -> None:
        """Say where to hold it, and wait."""
        if index == self._index:
            return
        self._index = index
        if index is None:
            log.info("switch the flash off and the lamps of the room on, within %g s", self.pause_s)
        else:
            log.info("hold the flash at %s mm, within %g s", self.lights_mm[index], self.pause_s)
        time.sleep(self.pause_s)


class FlashBench:
    """A camera on a stand above a sheet, and a flash around it.

    Parameters
    ----------
    camera : BracketingCamera
        The camera.
    light : MovedFlash
        The flash.
    sheet_mm : [width, height]
        Of the sheet.
    camera_mm : [x, y, z], optional
        Place of the camera, in the frame of the flash's places.
    raw : bool
        Whether the camera delivers raw files, proportional to light, or pictures of 8 bits.
    room : bool
        Whether to take a photograph under the lamps of the room, too.
    wavelength_nm, bandwidth_nm : float, optional
        Centre and full width at half maximum of a filter before the camera.
    light_sigma_mm : float, optional
        Standard deviation of the flash's extent.
    """

    physical = True
    corners_px = None

    def __init__(
        self,
        *,
        camera: BracketingCamera,
        light: MovedFlash,
        sheet_mm: list[float],
        camera_mm: list[float] | None = None,
        raw: bool = True,
        room: bool = True,
        wavelength_nm: float | None = None,
        bandwidth_nm: float | None = None,
        light_sigma_mm: float | None = None,
    ) -> None:
        self.camera = camera
        self.light = light
        self.sheet_mm = (float(sheet_mm[0]), float(sheet_mm[-1]))
        self.camera_mm = np.full(3, np.nan) if camera_mm is None else np.asarray(camera_mm, np.float64)
        self.linear = raw
        self.bits = 16 if raw else 8
        self.has_room = room
        self.wavelength_nm = wavelength_nm
        self.bandwidth_nm = bandwidth_nm
        self.light_sigma_mm = light_sigma_mm
        self._devices = {"camera": camera, "light": light}
        self._stack = ExitStack()

    def place(self, sample: GratingSample | None) -> None:
        """Take what lies on the table; a virtual sample cannot be put there.

        Raises
        ------
        InputError
            There is a virtual sample.
        """
        if sample is not None:
            raise InputError(
                f"'{sample.name}' is a virtual sample and cannot be laid on a real table",
                expected="no sample: `when: ${rig.simulated}` leaves its node out",
            )

    def check(self) -> None:
        """Let each device find, without moving anything, what would make it fail.

        Raises
        ------
        InputError, InputErrors
            All that was found, each with its place.
        """
        problems = []
        if not min(self.sheet_mm) > 0:
            problems.append(
                InputError(f"{list(self.sheet_mm)} is no size", where="sheet_mm", expected="[width, height] in mm")
            )
        refuse(
            found_by(self._devices),
            problems,
            [error.at("camera") for error in unordered_exposures(self.camera.exposure_s)],
            above_zero(wavelength_nm=self.wavelength_nm, bandwidth_nm=self.bandwidth_nm),
            above_zero(light_sigma_mm=self.light_sigma_mm),
        )

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
