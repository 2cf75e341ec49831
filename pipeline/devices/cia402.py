"""A CiA 402 axis in profile position mode, on any CANopen network.

Everything goes by SDO: each request is confirmed, a drive needs no mapping of process data, and a photograph takes a
hundred times longer than a request.
"""

from __future__ import annotations

import time
from types import TracebackType
from typing import Any, Self

import canopen

from pipeline.devices.simulated_drive import EDS
from pipeline.errors import DeviceError

CONTROLWORD, STATUSWORD, ERROR_CODE = 0x6040, 0x6041, 0x603F
MODE, MODE_DISPLAY, POSITION, TARGET = 0x6060, 0x6061, 0x6064, 0x607A
VELOCITY, ACCELERATION, DECELERATION, HEARTBEAT = 0x6081, 0x6083, 0x6084, 0x1017
PROFILE_POSITION = 1

SHUTDOWN, SWITCH_ON, ENABLE, NEW_SET_POINT, QUICK_STOP, DISABLE, FAULT_RESET = 0x06, 0x07, 0x0F, 0x1F, 0x02, 0x00, 0x80
FAULT, TARGET_REACHED, ACKNOWLEDGE, FOLLOWING_ERROR = 1 << 3, 1 << 10, 1 << 12, 1 << 13

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
_ERRORS = {
    0x2310: "continuous over-current",
    0x3210: "over-voltage of the supply",
    0x3220: "under-voltage of the supply",
    0x4310: "drive too hot",
    0x5441: "limit switch or interlock open",
    0x7305: "encoder fault",
    0x8130: "lost the master's heartbeat",
    0x8611: "following error: the shaft does not follow the set-point",
}


def state_of(statusword: int) -> str:
    """Name of the state that a statusword tells, by CiA 402's masks."""
    return next((name for mask, bits, name in _STATES if statusword & mask == bits), f"unknown ({statusword:#06x})")


class Axis:
    """One axis on a bus; a context manager that enables it inside and stops it on the way out.

    Parameters
    ----------
    network : canopen.Network
        Connected network.
    node_id : int
        The drive's node.
    name : str
        What to call it in errors.
    velocity, acceleration : float
        Of moves, in counts a second and counts a second squared.
    timeout_s : float
        Longest wait for an answer or a change of state; moves are given twice the time they need, and this on top.
    heartbeat_ms : int
        Heartbeat asked of the drive; 0 for none.
    time_scale : float
        How much faster the drive's clock runs than ours: above 1 for simulated drives only.
    """

    def __init__(
        self,
        network: canopen.Network,
        node_id: int,
        *,
        name: str,
        velocity: float,
        acceleration: float,
        timeout_s: float,
        heartbeat_ms: int = 100,
        time_scale: float = 1.0,
    ) -> None:
        self.name = name
        self._network = network
        self._node_id = node_id
        self._velocity = velocity
        self._acceleration = acceleration
        self._timeout_s = timeout_s
        self._heartbeat_ms = heartbeat_ms
        self._time_scale = time_scale
        self._pause_s = min(0.01, 0.01 / time_scale)
        self._heard_s = 0.0

    def __enter__(self) -> Self:
        self._node = self._network.add_node(canopen.RemoteNode(self._node_id, str(EDS)))
        self._node.sdo.RESPONSE_TIMEOUT = self._timeout_s
        self._node.sdo.MAX_RETRIES = 1
        try:
            self._node.nmt.state = "OPERATIONAL"
            self._write(HEARTBEAT, self._heartbeat_ms)
            self._heard_s = time.monotonic()
            self._node.nmt.add_heartbeat_callback(self._hear)
            self._enable()
        except BaseException:
            self._remove()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._quietly(CONTROLWORD, DISABLE)
        self._quietly(HEARTBEAT, 0)
        self._remove()

    def position(self) -> int:
        """Position by the encoder, in counts."""
        return int(self._read(POSITION))

    def move_to(self, counts: int) -> int:
        """Move and wait until the axis stands at its target; returns the encoder's position.

        Raises
        ------
        DeviceError
            The drive faulted, fell silent, refused, or did not arrive in time; it has been told to stop.
        """
        distance = abs(counts - self.position())
        needed = (distance / self._velocity + 2 * self._velocity / self._acceleration) / self._time_scale
        try:
            self._write(TARGET, counts)
            self._write(CONTROLWORD, NEW_SET_POINT)
            self._wait(ACKNOWLEDGE, self._timeout_s, "the drive did not take the set-point")
            self._write(CONTROLWORD, ENABLE)
            self._wait(TARGET_REACHED, 2 * needed + self._timeout_s, f"it did not arrive at {counts} counts in time")
        except BaseException:
            self.stop()
            raise
        return self.position()

    def stop(self) -> None:
        """Tell the drive to stop at once; says nothing if it does not listen."""
        self._quietly(CONTROLWORD, QUICK_STOP)

    def _enable(self) -> None:
        if self._status() & FAULT:
            self._write(CONTROLWORD, DISABLE)
            self._write(CONTROLWORD, FAULT_RESET)
        for command, state in (
            (SHUTDOWN, "ready to switch on"),
            (SWITCH_ON, "switched on"),
            (ENABLE, "operation enabled"),
        ):
            self._write(CONTROLWORD, command)
            deadline = time.monotonic() + self._timeout_s
            while (found := state_of(self._status())) != state:
                if time.monotonic() > deadline:
                    raise self._error(f"it stays in state '{found}' instead of '{state}'")
                time.sleep(self._pause_s)
            if command == SHUTDOWN:
                self._write(MODE, PROFILE_POSITION)
                self._write(VELOCITY, round(self._velocity))
                self._write(ACCELERATION, round(self._acceleration))
                self._write(DECELERATION, round(self._acceleration))
        if int(self._read(MODE_DISPLAY)) != PROFILE_POSITION:
            raise self._error("the drive has no profile position mode")

    def _wait(self, bit: int, seconds: float, complaint: str) -> None:
        deadline = time.monotonic() + seconds
        while True:
            status = self._status()
            if status & FAULT:
                raise self._error(self._cause(status))
            state = state_of(status)
            if state != "operation enabled":
                raise self._error(f"it left operation and is in state '{state}'")
            if status & bit:
                return
            if time.monotonic() > deadline:
                raise self._error(f"{complaint}; it stands at {self.position()} counts")
            self._check_heartbeat()
            time.sleep(self._pause_s)

    def _cause(self, status: int) -> str:
        code = int(self._read(ERROR_CODE))
        told = [entry for entry in self._node.emcy.log if entry.code]
        code = code or (told[-1].code if told else 0)
        if not code and status & FOLLOWING_ERROR:
            code = 0x8611
        return f"fault {code:#06x}: {_ERRORS.get(code, 'see the manual of the drive')}"

    def _hear(self, _: int) -> None:
        self._heard_s = time.monotonic()

    def _check_heartbeat(self) -> None:
        silent = time.monotonic() - self._heard_s
        if self._heartbeat_ms and silent > max(5 * self._heartbeat_ms / 1000, 0.5):
            raise self._error(f"its heartbeat has been missing for {silent:.1f} s")

    def _status(self) -> int:
        return int(self._read(STATUSWORD))

    def _read(self, index: int) -> Any:
        try:
            return self._node.sdo[index].raw
        except canopen.SdoCommunicationError as error:
            raise self._error(f"no answer when reading {index:#06x}: is it powered and on this bus?") from error
        except canopen.SdoAbortedError as error:
            raise self._error(f"it refused to tell {index:#06x}: {error}") from error

    def _write(self, index: int, value: int) -> None:
        try:
            self._node.sdo[index].raw = value
        except canopen.SdoCommunicationError as error:
            raise self._error(f"no answer when writing {index:#06x}: is it powered and on this bus?") from error
        except canopen.SdoAbortedError as error:
            raise self._error(f"it refused {value} for {index:#06x}: {error}") from error

    def _quietly(self, index: int, value: int) -> None:
        try:
            self._write(index, value)
        except DeviceError:
            return

    def _remove(self) -> None:
        del self._network[self._node_id]

    def _error(self, cause: str) -> DeviceError:
        return DeviceError(f"{self.name}: {cause}")
