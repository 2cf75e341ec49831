"""An axis with a CiA 402 drive in profile position mode, on any bus that python-can opens.

Every request goes by SDO and none by PDO: the drive confirms each or says by an abort code why not, nothing has to be
mapped, a bus that echoes its own frames confuses nobody, and a request takes a millisecond where a photograph takes a
second. Emergencies, heartbeats and restarts are heard as they come, also between two requests.
"""

from __future__ import annotations

import logging
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any, NamedTuple, Self

import can
import canopen

from pipeline import progress
from pipeline.devices.motion_profile import trapezoid
from pipeline.errors import DeviceError

log = logging.getLogger(__name__)
logging.getLogger("canopen").addHandler(logging.NullHandler())


class _Entry(NamedTuple):
    """An object of the drive's dictionary."""

    number: int
    format: str
    name: str


_DEVICE_TYPE = _Entry(0x1000, "<I", "device type")
_HEARTBEAT_MS = _Entry(0x1017, "<H", "producer heartbeat time")
_ERROR_CODE = _Entry(0x603F, "<H", "error code")
_CONTROLWORD = _Entry(0x6040, "<H", "controlword")
_STATUSWORD = _Entry(0x6041, "<H", "statusword")
_MODE = _Entry(0x6060, "<b", "mode of operation")
_MODE_DISPLAY = _Entry(0x6061, "<b", "mode of operation display")
_POSITION = _Entry(0x6064, "<i", "actual position")
_TARGET = _Entry(0x607A, "<i", "target position")
_VELOCITY = _Entry(0x6081, "<I", "profile velocity")
_ACCELERATION = _Entry(0x6083, "<I", "profile acceleration")
_DECELERATION = _Entry(0x6084, "<I", "profile deceleration")

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
_EMERGENCIES = {
    0x2310: "continuous over-current",
    0x2320: "short circuit or earth leakage",
    0x3210: "over-voltage of the supply",
    0x3220: "under-voltage of the supply",
    0x4210: "excess temperature of the drive",
    0x4310: "excess temperature of the motor",
    0x5400: "fault of the power stage",
    0x5441: "a limit switch or interlock is open",
    0x7120: "fault of the motor",
    0x7121: "the motor is blocked",
    0x7300: "fault of a sensor",
    0x7305: "fault of the encoder",
    0x8110: "CAN overrun",
    0x8120: "CAN error passive",
    0x8130: "the drive misses a heartbeat",
    0x8140: "the drive recovered from bus off",
    0x8400: "velocity error",
    0x8611: "following error: the shaft does not follow its set-point",
    0x8612: "reference limit",
}
_LOST_BEATS = 5
_NOTIFIER_S, _STOP_POLL_S, _FIRST_PAUSE_S, _LONGEST_PAUSE_S = 0.02, 0.01, 0.0005, 0.02


def state_of(statusword: int) -> str:
    """Name of the state in which a statusword says the drive is."""
    return next((name for mask, bits, name in _STATES if statusword & mask == bits), f"unknown ({statusword:#06x})")


def emergency_text(code: int) -> str:
    """An emergency or error code in words, its number with it."""
    words = _EMERGENCIES.get(code) or canopen.emcy.EmcyError(code, 0, b"", 0.0).get_desc().lower() or "unknown"
    return f"{words} (error code 0x{code:04X})"


class _Client(canopen.sdo.SdoClient):
    """Waits for an answer in two halves.

    Where this process is held up for longer than the answer may take (stopped and continued, starved of the processor),
    only the half in which it happens is lost, and the answer that came meanwhile is still heard in the other.
    """

    def read_response(self) -> bytes:
        try:
            return bytes(super().read_response())
        except canopen.SdoCommunicationError:
            return bytes(super().read_response())


class _Node(canopen.RemoteNode):
    """A node that is asked by :class:`_Client`."""

    def add_sdo(self, rx_cobid: int, tx_cobid: int) -> _Client:
        client = _Client(rx_cobid, tx_cobid, self.object_dictionary)
        self.sdo_channels.append(client)
        return client


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
        self.interface, self.channel, self.bitrate, self.node_id = interface, channel, bitrate, node_id
        self.velocity, self.acceleration, self.tolerance = velocity, acceleration, tolerance
        self.timeout_s, self.response_s, self.heartbeat_s = timeout_s, response_s, heartbeat_s
        self.in_words = in_words
        self._network: Any = None
        self._alarm = threading.Event()
        self._known = self._restarted = False
        self._heard_s = 0.0

    def __enter__(self) -> Self:
        network = canopen.Network()
        network.NOTIFIER_CYCLE = _NOTIFIER_S
        try:
            network.connect(interface=self.interface, channel=self.channel, bitrate=self.bitrate)
        except Exception as error:  # each backend of python-can raises what it likes
            raise self._error(f"the {self.interface} bus cannot be opened: {error or type(error).__name__}") from error
        self._network = network
        self._known = False
        try:
            self._greet()
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
            if self._known:
                self._write(_CONTROLWORD, _DISABLE_VOLTAGE)
                if self.heartbeat_s:
                    self._write(_HEARTBEAT_MS, 0)
        except DeviceError as failure:
            log.warning("%s; it could not be disabled", failure)
        finally:
            try:
                with self._talking():
                    self._network.disconnect()
            except DeviceError as failure:
                log.warning("%s", failure)
            self._network = None

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
        if self._network is None:
            raise self._error("the axis is not open")
        if not -(2**31) <= target < 2**31:
            raise self._error(f"{self.in_words(target)} is beyond what the drive can count")
        try:
            return self._move(target)
        except BaseException as error:
            rest = self._quick_stop()
            if isinstance(error, DeviceError):
                raise DeviceError(f"{error}; {rest}") from error
            raise

    def _move(self, target: int) -> int:
        self._listen()
        start = self._read(_POSITION)
        profile = trapezoid(
            start, target, velocity=self.velocity, acceleration=self.acceleration, deceleration=self.acceleration
        )
        self._write(_TARGET, target)
        self._write(_CONTROLWORD, _ENABLE | _NEW_SET_POINT | _AT_ONCE)
        self._await(lambda word: bool(word & _ACKNOWLEDGED), self.timeout_s, "does not take the new target")
        self._write(_CONTROLWORD, _ENABLE)
        self._await(lambda word: not word & _ACKNOWLEDGED, self.timeout_s, "does not release the new target")
        patience_s = profile.seconds + self.timeout_s
        self._await(lambda word: bool(word & _TARGET_REACHED), patience_s, f"has not reached {self.in_words(target)}")
        position = self._read(_POSITION)
        if abs(position - target) > self.tolerance:
            raise self._error(f"says that it reached {self.in_words(target)} but stands at {self.in_words(position)}")
        return position

    def _await(self, done: Callable[[int], bool], seconds: float, complaint: str) -> None:
        """Poll the statusword of an enabled drive until it is as wanted."""
        deadline, pause = time.monotonic() + seconds, _FIRST_PAUSE_S
        while True:
            progress.check()
            word = self._read(_STATUSWORD)
            self._listen()
            state = state_of(word)
            if state.startswith("fault"):
                raise self._error(self._cause_of_fault())
            if state != "operation enabled":
                raise self._error(f"has left operation: it is in state '{state}'")
            if done(word):
                return
            if time.monotonic() > deadline:
                raise self._error(f"{complaint} after {seconds:.3g} s")
            self._alarm.wait(pause)
            pause = min(1.5 * pause, _LONGEST_PAUSE_S)

    def _quick_stop(self) -> str:
        """Stop where the drive still listens, and say what came of it."""
        try:
            if state_of(self._read(_STATUSWORD)) == "operation enabled":
                self._write(_CONTROLWORD, _QUICK_STOP)
            deadline = time.monotonic() + self.timeout_s
            position = self._read(_POSITION)
            while True:
                time.sleep(_STOP_POLL_S)
                before, position = position, self._read(_POSITION)
                if abs(position - before) <= 1:
                    return f"it stands still at {self.in_words(position)}"
                if time.monotonic() > deadline:
                    return "it was told to stop, but still moves"
        except DeviceError:
            return "it could not be told to stop and may still move"

    # Opening

    def _greet(self) -> None:
        """Find the drive and listen to it from now on."""
        self._node = _Node(self.node_id, canopen.ObjectDictionary())
        self._node.sdo.RESPONSE_TIMEOUT = self.response_s / 2
        self._network.add_node(self._node)
        device = self._read(_DEVICE_TYPE) & 0xFFFF
        if device != _CIA_402:
            raise self._error(f"is no CiA 402 drive: it says that its device profile is {device}")
        self._known = True
        with self._talking():
            self._node.nmt.state = "OPERATIONAL"
        self._alarm.clear()
        self._heard_s, self._restarted = time.monotonic(), False
        self._node.emcy.add_callback(lambda _: self._alarm.set())
        self._node.nmt.add_heartbeat_callback(self._hear)
        if self.heartbeat_s:
            self._write(_HEARTBEAT_MS, max(1, round(1000 * self.heartbeat_s)))

    def _clear_fault(self) -> None:
        if not self._state().startswith("fault"):
            return
        cause = self._cause_of_fault()
        deadline = time.monotonic() + self.timeout_s
        while self._state().startswith("fault"):
            if time.monotonic() > deadline:
                raise self._error(f"is in a fault that cannot be reset: {cause}")
            self._write(_CONTROLWORD, _DISABLE_VOLTAGE)
            self._write(_CONTROLWORD, _FAULT_RESET)
            time.sleep(_STOP_POLL_S)
        log.warning("%s: a fault from before was reset: %s", self.name, cause)
        self._node.emcy.reset()
        self._alarm.clear()

    def _configure(self) -> None:
        self._write(_MODE, _PROFILE_POSITION)
        deadline = time.monotonic() + self.timeout_s
        while (mode := self._read(_MODE_DISPLAY)) != _PROFILE_POSITION:
            if time.monotonic() > deadline:
                raise self._error(f"does not enter the profile position mode: it stays in mode {mode}")
            time.sleep(_STOP_POLL_S)
        self._write(_VELOCITY, self.velocity)
        self._write(_ACCELERATION, self.acceleration)
        self._write(_DECELERATION, self.acceleration)

    def _enable(self) -> None:
        deadline = time.monotonic() + self.timeout_s
        while (state := self._state()) != "operation enabled":
            self._listen()
            if state.startswith("fault"):
                raise self._error(self._cause_of_fault())
            if time.monotonic() > deadline:
                raise self._error(f"stays in state '{state}': is its enable input closed and the motor's supply on?")
            if state in _TOWARDS_OPERATION:
                self._write(_CONTROLWORD, _TOWARDS_OPERATION[state])
            if self._state() == state:
                time.sleep(_STOP_POLL_S)

    # Listening and talking

    def _hear(self, state: int) -> None:
        self._heard_s = time.monotonic()
        if state == 0:
            self._restarted = True
            self._alarm.set()

    def _listen(self) -> None:
        """Raise what the drive, or its silence, has said since it was last asked."""
        with self._talking():
            self._network.check()
        if self._restarted:
            raise self._error("has restarted by itself: look at its supply")
        if self._node.emcy.active:
            raise self._error(self._cause_of_fault())
        if self.heartbeat_s and self._silent_s() > _LOST_BEATS * self.heartbeat_s:
            self._alarm.wait(self.heartbeat_s)  # beats that wait for this process to be scheduled still count
            if self._silent_s() > _LOST_BEATS * self.heartbeat_s:
                raise self._error(f"its heartbeat is lost: nothing for {self._silent_s():.2g} s")

    def _silent_s(self) -> float:
        return time.monotonic() - self._heard_s

    def _cause_of_fault(self) -> str:
        """The emergency that the drive sent or, for drives that send none, its error code."""
        active = self._node.emcy.active
        if active:
            return f"emergency: {emergency_text(active[-1].code)}"
        return f"fault: {emergency_text(self._read(_ERROR_CODE))}"

    def _state(self) -> str:
        return state_of(self._read(_STATUSWORD))

    def _read(self, entry: _Entry) -> int:
        with self._talking(f"tell its {entry.name}"):
            data = self._node.sdo.upload(entry.number, 0)
            if len(data) != struct.calcsize(entry.format):
                raise self._error(f"answers {len(data)} bytes for its {entry.name}")
            return int(struct.unpack(entry.format, data)[0])

    def _write(self, entry: _Entry, value: int) -> None:
        with self._talking(f"accept {value} as {entry.name}"):
            self._node.sdo.download(entry.number, 0, struct.pack(entry.format, value))

    @contextmanager
    def _talking(self, purpose: str = "") -> Iterator[None]:
        """Turn what goes wrong on the bus into an error in words."""
        try:
            yield
        except canopen.SdoAbortedError as error:
            reason = canopen.SdoAbortedError.CODES.get(error.code, "for no reason that the standard knows")
            raise self._error(f"refuses to {purpose}: {reason} (abort code 0x{error.code:08X})") from error
        except canopen.SdoCommunicationError as error:
            hint = "" if self._known else ": are its supply, node number and bit rate right?"
            raise self._error(f"does not answer{hint}") from error
        except (can.CanError, OSError, RuntimeError) as error:
            raise self._error(f"the bus failed: {error}") from error

    def _error(self, cause: str) -> DeviceError:
        return DeviceError(f"{self.name}: {cause}")
