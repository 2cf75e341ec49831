"""An axis with a CiA 402 drive in profile position mode, on any bus that python-can opens."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

from pipeline import progress
from pipeline.devices.canopen_drive import Drive, Entry
from pipeline.devices.motion_profile import trapezoid
from pipeline.errors import DeviceError

log = logging.getLogger(__name__)

_CONTROLWORD = Entry(0x6040, "<H", "controlword")
_STATUSWORD = Entry(0x6041, "<H", "statusword")
_MODE = Entry(0x6060, "<b", "mode of operation")
_MODE_DISPLAY = Entry(0x6061, "<b", "mode of operation display")
_POSITION = Entry(0x6064, "<i", "actual position")
_TARGET = Entry(0x607A, "<i", "target position")
_VELOCITY = Entry(0x6081, "<I", "profile velocity")
_ACCELERATION = Entry(0x6083, "<I", "profile acceleration")
_DECELERATION = Entry(0x6084, "<I", "profile deceleration")

_DISABLE_VOLTAGE, _QUICK_STOP, _SHUTDOWN, _SWITCH_ON, _ENABLE = 0x00, 0x02, 0x06, 0x07, 0x0F
_NEW_SET_POINT, _AT_ONCE, _FAULT_RESET = 1 << 4, 1 << 5, 1 << 7
_TARGET_REACHED, _ACKNOWLEDGED = 1 << 10, 1 << 12
_PROFILE_POSITION = 1
_CIA_402 = 402

_STATES = (
    (0x4F, 0x00, "not ready to switch on"),
    (0x4F, 0x40, "switch on disabled"),
    (0x6F, 0x21, "ready to switch on"),
    (0x6F, 0x23, "switched on"),
    (0x6F, 0x27, "operation enabled"),
    (0x6F, 0x07, "quick stop active"),
    (0x4F, 0x0F, "fault reaction active"),
    (0x4F, 0x08, "fault"),
)
_TOWARDS_OPERATION = {
    "switch on disabled": _SHUTDOWN,
    "ready to switch on": _SWITCH_ON,
    "switched on": _ENABLE,
    "quick stop active": _DISABLE_VOLTAGE,
}
_STOP_POLL_S, _FIRST_PAUSE_S, _LONGEST_PAUSE_S = 0.01, 0.0005, 0.02


def state_of(statusword: int) -> str:
    """Name of the state in which a statusword says the drive is."""
    return next((name for mask, bits, name in _STATES if statusword & mask == bits), f"unknown ({statusword:#06x})")


class Axis:
    """One axis: a context manager that opens the bus and enables the drive inside, and disables and closes it after.

    The drive must be set to counts, counts a second and counts a second squared, and know its zero.

    Parameters
    ----------
    name : str
        What to call the axis in errors.
    interface, channel : str
        The bus, as python-can names it.
    bitrate : int
        Of the bus; socketcan takes that of its network interface.
    node_id : int
        The drive's node.
    velocity, acceleration : int
        Limits of the motion, in counts a second and counts a second squared.
    tolerance : int
        Farthest from its target that the axis may come to rest, in counts.
    timeout_s : float
        How long a change of state may take, and a move beyond the time that its profile needs.
    response_s : float
        How long an answer may take.
    heartbeat_s : float
        Interval of the drive's heartbeat, five of which may be missing; 0 to do without.
    in_words : callable
        Writes a position in counts for errors.
    """

    def __init__(
        self,
        *,
        name: str,
        interface: str,
        channel: str,
        bitrate: int,
        node_id: int,
        velocity: int,
        acceleration: int,
        tolerance: int,
        timeout_s: float,
        response_s: float,
        heartbeat_s: float,
        in_words: Callable[[int], str] = "{} counts".format,
    ) -> None:
        self.name = name
        self.velocity, self.acceleration, self.tolerance = velocity, acceleration, tolerance
        self.timeout_s = timeout_s
        self.in_words = in_words
        self._drive = Drive(name, interface, channel, bitrate, node_id, response_s, heartbeat_s)

    def __enter__(self) -> Self:
        self._drive.connect()
        try:
            self._drive.greet(_CIA_402)
            self._clear_fault()
            self._configure()
            self._enable()
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if self._drive.known:
                self._drive.write(_CONTROLWORD, _DISABLE_VOLTAGE)
                self._drive.hush()
        except DeviceError as failure:
            log.warning("%s; it could not be disabled", failure)
        finally:
            self._drive.disconnect()

    def move_to(self, target: int) -> int:
        """Go to ``target`` and come to rest there.

        Parameters
        ----------
        target : int
            Absolute position in counts.

        Returns
        -------
        int
            Actual position by the encoder, in counts.

        Raises
        ------
        DeviceError
            The axis did not get there. It has been told to stop, unless it no longer listens.
        Stopped
            The run was interrupted; likewise.
        """
        if not self._drive.connected:
            raise self._drive.error("the axis is not open")
        if not -(2**31) <= target < 2**31:
            raise self._drive.error(f"{self.in_words(target)} is beyond what the drive can count")
        try:
            return self._move(target)
        except BaseException as error:
            rest = self._quick_stop()
            if isinstance(error, DeviceError):
                raise DeviceError(f"{error}; {rest}") from error
            raise

    def _move(self, target: int) -> int:
        self._drive.listen()
        start = self._drive.read(_POSITION)
        profile = trapezoid(
            start, target, velocity=self.velocity, acceleration=self.acceleration, deceleration=self.acceleration
        )
        self._drive.write(_TARGET, target)
        self._drive.write(_CONTROLWORD, _ENABLE | _NEW_SET_POINT | _AT_ONCE)
        self._await(lambda word: bool(word & _ACKNOWLEDGED), self.timeout_s, "does not take the new target")
        self._drive.write(_CONTROLWORD, _ENABLE)
        self._await(lambda word: not word & _ACKNOWLEDGED, self.timeout_s, "does not release the new target")
        patience_s = profile.seconds + self.timeout_s
        self._await(lambda word: bool(word & _TARGET_REACHED), patience_s, f"has not reached {self.in_words(target)}")
        position = self._drive.read(_POSITION)
        if abs(position - target) > self.tolerance:
            raise self._drive.error(
                f"says that it reached {self.in_words(target)} but stands at {self.in_words(position)}"
            )
        return position

    def _await(self, done: Callable[[int], bool], seconds: float, complaint: str) -> None:
        """Poll the statusword of an enabled drive until it is as wanted."""
        deadline, pause = time.monotonic() + seconds, _FIRST_PAUSE_S
        while True:
            progress.check()
            word = self._drive.read(_STATUSWORD)
            self._drive.listen()
            state = state_of(word)
            if state.startswith("fault"):
                raise self._drive.error(self._drive.cause_of_fault())
            if state != "operation enabled":
                raise self._drive.error(f"has left operation: it is in state '{state}'")
            if done(word):
                return
            if time.monotonic() > deadline:
                raise self._drive.error(f"{complaint} after {seconds:.3g} s")
            self._drive.wait(pause)
            pause = min(1.5 * pause, _LONGEST_PAUSE_S)

    def _quick_stop(self) -> str:
        """Stop where the drive still listens, and say what came of it."""
        try:
            if state_of(self._drive.read(_STATUSWORD)) == "operation enabled":
                self._drive.write(_CONTROLWORD, _QUICK_STOP)
            deadline = time.monotonic() + self.timeout_s
            position = self._drive.read(_POSITION)
            while True:
                time.sleep(_STOP_POLL_S)
                before, position = position, self._drive.read(_POSITION)
                if abs(position - before) <= 1:
                    return f"it stands still at {self.in_words(position)}"
                if time.monotonic() > deadline:
                    return "it was told to stop, but still moves"
        except DeviceError:
            return "it could not be told to stop and may still move"

    # Opening

    def _clear_fault(self) -> None:
        if not self._state().startswith("fault"):
            return
        cause = self._drive.cause_of_fault()
        deadline = time.monotonic() + self.timeout_s
        while self._state().startswith("fault"):
            if time.monotonic() > deadline:
                raise self._drive.error(f"is in a fault that cannot be reset: {cause}")
            self._drive.write(_CONTROLWORD, _DISABLE_VOLTAGE)
            self._drive.write(_CONTROLWORD, _FAULT_RESET)
            time.sleep(_STOP_POLL_S)
        log.warning("%s: a fault from before was reset: %s", self._drive.name, cause)
        self._drive.forget_emergencies()

    def _configure(self) -> None:
        self._drive.write(_MODE, _PROFILE_POSITION)
        deadline = time.monotonic() + self.timeout_s
        while (mode := self._drive.read(_MODE_DISPLAY)) != _PROFILE_POSITION:
            if time.monotonic() > deadline:
                raise self._drive.error(f"does not enter the profile position mode: it stays in mode {mode}")
            time.sleep(_STOP_POLL_S)
        self._drive.write(_VELOCITY, self.velocity)
        self._drive.write(_ACCELERATION, self.acceleration)
        self._drive.write(_DECELERATION, self.acceleration)

    def _enable(self) -> None:
        deadline = time.monotonic() + self.timeout_s
        while (state := self._state()) != "operation enabled":
            self._drive.listen()
            if state.startswith("fault"):
                raise self._drive.error(self._drive.cause_of_fault())
            if time.monotonic() > deadline:
                raise self._drive.error(
                    f"stays in state '{state}': is its enable input closed and the motor's supply on?"
                )
            if state in _TOWARDS_OPERATION:
                self._drive.write(_CONTROLWORD, _TOWARDS_OPERATION[state])
            if self._state() == state:
                time.sleep(_STOP_POLL_S)

    def _state(self) -> str:
        return state_of(self._drive.read(_STATUSWORD))
