"""A CANopen drive on a bus: asked and told by SDO, and heard between two requests.

Every request goes by SDO and none by PDO: the drive confirms each or says by an abort code why not, nothing has to be
mapped, a bus that echoes its own frames confuses nobody, and a request takes a millisecond where a photograph takes a
second. Emergencies, heartbeats and restarts are heard as they come, also between two requests.
"""

from __future__ import annotations

import logging
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import can
import canopen

from pipeline.errors import DeviceError

log = logging.getLogger(__name__)
logging.getLogger("canopen").addHandler(logging.NullHandler())


class Entry(NamedTuple):
    """An object of the drive's dictionary."""

    number: int
    format: str
    name: str


_DEVICE_TYPE = Entry(0x1000, "<I", "device type")
_HEARTBEAT_MS = Entry(0x1017, "<H", "producer heartbeat time")
_ERROR_CODE = Entry(0x603F, "<H", "error code")

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
_NOTIFIER_S = 0.02


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


@dataclass
class Drive:
    """One drive on a bus.

    Attributes
    ----------
    name : str
        What to call it in errors.
    interface, channel : str
        The bus, as python-can names it.
    bitrate : int
        Of the bus; socketcan takes that of its network interface.
    node_id : int
        The drive's node.
    response_s : float
        How long an answer may take.
    heartbeat_s : float
        Interval of the drive's heartbeat, five of which may be missing; 0 to do without.
    """

    name: str
    interface: str
    channel: str
    bitrate: int
    node_id: int
    response_s: float
    heartbeat_s: float
    connected: bool = field(default=False, init=False)
    """Whether the bus is open."""
    known: bool = field(default=False, init=False)
    """Whether the node has turned out to be a drive of the profile that was asked for."""

    def connect(self) -> None:
        """Open the bus.

        Raises
        ------
        DeviceError
            It cannot be opened.
        """
        network = canopen.Network()
        network.NOTIFIER_CYCLE = _NOTIFIER_S
        try:
            network.connect(interface=self.interface, channel=self.channel, bitrate=self.bitrate)
        except Exception as error:  # each backend of python-can raises what it likes
            raise self.error(f"the {self.interface} bus cannot be opened: {error or type(error).__name__}") from error
        self._network: Any = network
        self.connected, self.known = True, False

    def greet(self, profile: int) -> None:
        """Find the drive, make sure that it has that device profile, and listen to it from now on.

        Raises
        ------
        DeviceError
            It does not answer, or is something else.
        """
        self._node = _Node(self.node_id, canopen.ObjectDictionary())
        self._node.sdo.RESPONSE_TIMEOUT = self.response_s / 2
        self._network.add_node(self._node)
        device = self.read(_DEVICE_TYPE) & 0xFFFF
        if device != profile:
            raise self.error(f"is no CiA {profile} drive: it says that its device profile is {device}")
        self.known = True
        with self._talking():
            self._node.nmt.state = "OPERATIONAL"
        self._alarm = threading.Event()
        self._heard_s, self._restarted = time.monotonic(), False
        self._node.emcy.add_callback(lambda _: self._alarm.set())
        self._node.nmt.add_heartbeat_callback(self._hear)
        if self.heartbeat_s:
            self.write(_HEARTBEAT_MS, max(1, round(1000 * self.heartbeat_s)))

    def hush(self) -> None:
        """Let it send no heartbeat any more."""
        if self.heartbeat_s:
            self.write(_HEARTBEAT_MS, 0)

    def disconnect(self) -> None:
        """Close the bus; a failure is only logged."""
        try:
            with self._talking():
                self._network.disconnect()
        except DeviceError as failure:
            log.warning("%s", failure)
        self.connected = False

    def read(self, entry: Entry) -> int:
        """Ask for an object's value."""
        with self._talking(f"tell its {entry.name}"):
            data = self._node.sdo.upload(entry.number, 0)
            if len(data) != struct.calcsize(entry.format):
                raise self.error(f"answers {len(data)} bytes for its {entry.name}")
            return int(struct.unpack(entry.format, data)[0])

    def write(self, entry: Entry, value: int) -> None:
        """Give an object a value."""
        with self._talking(f"accept {value} as {entry.name}"):
            self._node.sdo.download(entry.number, 0, struct.pack(entry.format, value))

    def listen(self) -> None:
        """Raise what the drive, or its silence, has said since it was last asked."""
        with self._talking():
            self._network.check()
        if self._restarted:
            raise self.error("has restarted by itself: look at its supply")
        if self._node.emcy.active:
            raise self.error(self.cause_of_fault())
        if self.heartbeat_s and self._silent_s() > _LOST_BEATS * self.heartbeat_s:
            self._alarm.wait(self.heartbeat_s)  # beats that wait for this process to be scheduled still count
            if self._silent_s() > _LOST_BEATS * self.heartbeat_s:
                raise self.error(f"its heartbeat is lost: nothing for {self._silent_s():.2g} s")

    def wait(self, seconds: float) -> None:
        """Wait that long, or until it reports an emergency or restarts."""
        self._alarm.wait(seconds)

    def forget_emergencies(self) -> None:
        """Take what it reported so far for settled."""
        self._node.emcy.reset()
        self._alarm.clear()

    def cause_of_fault(self) -> str:
        """The emergency that the drive sent or, for drives that send none, its error code."""
        active = self._node.emcy.active
        if active:
            return f"emergency: {emergency_text(active[-1].code)}"
        return f"fault: {emergency_text(self.read(_ERROR_CODE))}"

    def error(self, cause: str) -> DeviceError:
        """An error that names the drive."""
        return DeviceError(f"{self.name}: {cause}")

    def _hear(self, state: int) -> None:
        self._heard_s = time.monotonic()
        if state == 0:
            self._restarted = True
            self._alarm.set()

    def _silent_s(self) -> float:
        return time.monotonic() - self._heard_s

    @contextmanager
    def _talking(self, purpose: str = "") -> Iterator[None]:
        """Turn what goes wrong on the bus into an error in words."""
        try:
            yield
        except canopen.SdoAbortedError as error:
            reason = canopen.SdoAbortedError.CODES.get(error.code, "for no reason that the standard knows")
            raise self.error(f"refuses to {purpose}: {reason} (abort code 0x{error.code:08X})") from error
        except canopen.SdoCommunicationError as error:
            hint = "" if self.known else ": are its supply, node number and bit rate right?"
            raise self.error(f"does not answer{hint}") from error
        except (can.CanError, OSError, RuntimeError) as error:
            raise self.error(f"the bus failed: {error}") from error
