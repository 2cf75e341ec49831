"""A drive that exists only in software: a CANopen node with the CiA 402 state machine and a profile-position motor.

It answers on a python-can bus like a drive on a cable: SDO, NMT, heartbeat and emergencies come from
``canopen.LocalNode``, its objects from the EDS beside this file; state machine, set-points and motion are here. Its
clock may run faster than ours, so that a simulated run need not wait for a motor.
"""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any, Literal

import canopen

from pipeline.devices.motion_profile import TrapezoidalMove

EDS = Path(__file__).with_suffix(".eds")

CONTROLWORD, STATUSWORD, ERROR_CODE = 0x6040, 0x6041, 0x603F
MODE, MODE_DISPLAY, POSITION, TARGET = 0x6060, 0x6061, 0x6064, 0x607A
VELOCITY, ACCELERATION, QUICK_STOP_DECELERATION, FOLLOWING_WINDOW = 0x6081, 0x6083, 0x6085, 0x6065

PROFILE_POSITION = 1
State = Literal["switch on disabled", "ready to switch on", "switched on", "operation enabled", "quick stop", "fault"]
STATE_BITS: dict[State, int] = {
    "switch on disabled": 0x0240,
    "ready to switch on": 0x0221,
    "switched on": 0x0223,
    "operation enabled": 0x0227,
    "quick stop": 0x0207,
    "fault": 0x0208,
}
TARGET_REACHED, SET_POINT_ACKNOWLEDGE, FOLLOWING_ERROR = 1 << 10, 1 << 12, 1 << 13

Fault = Literal["none", "stall", "following error", "overcurrent", "abort", "silence", "heartbeat lost"]
EMERGENCIES: dict[str, int] = {"following error": 0x8611, "overcurrent": 0x2310}
GENERAL_ERROR = 0x08000000


class SimulatedDrive:
    """A simulated drive on a bus of its own process.

    Parameters
    ----------
    network : canopen.Network
        Connected network to live on.
    node_id : int
        Its node.
    time_scale : float
        How much faster its clock runs than ours.
    """

    def __init__(self, network: canopen.Network, node_id: int, *, time_scale: float = 1.0) -> None:
        self.time_scale = time_scale
        self.fault: Fault = "none"
        self._node = canopen.LocalNode(node_id, str(EDS))
        self._lock = threading.RLock()
        self._state: State = "switch on disabled"
        self._acknowledged = False
        self._controlword = 0
        self._move = TrapezoidalMove(0, 0, 1, 1, 0)
        self._error_code = 0
        self._node.add_read_callback(self._read)
        self._node.add_write_callback(self._written)
        network.add_node(self._node)
        self._node.nmt.state = "PRE-OPERATIONAL"

    def inject(self, fault: Fault) -> None:
        """Break something: motion faults strike in the next move, silence and a lost heartbeat at once."""
        with self._lock:
            self.fault = fault
            if fault in {"heartbeat lost", "silence"}:
                self._node.nmt.stop_heartbeat()
            if fault == "silence":
                self._node.remove_network()

    def close(self) -> None:
        """Stop the heartbeat."""
        self._node.nmt.stop_heartbeat()

    @property
    def position_counts(self) -> float:
        """Where the shaft stands now, finer than the encoder counts."""
        with self._lock:
            return self._move.position(self._now())

    @property
    def state(self) -> State:
        """State of the CiA 402 state machine."""
        return self._state

    def _now(self) -> float:
        return time.monotonic() * self.time_scale

    def _read(self, *, index: int, **_: Any) -> int | None:
        with self._lock:
            self._update()
            if index == STATUSWORD:
                return self._statusword()
            if index == POSITION:
                return round(self._move.position(self._now()))
            if index == ERROR_CODE:
                return self._error_code
            if index == MODE_DISPLAY:
                return int(self._node.sdo[MODE].raw)
        return None

    def _written(self, *, index: int, data: bytes, **_: Any) -> None:
        with self._lock:
            if index == TARGET and self.fault == "abort":
                raise canopen.SdoAbortedError(GENERAL_ERROR)
            if index == CONTROLWORD:
                self._obey(int.from_bytes(data, "little"))

    def _obey(self, controlword: int) -> None:
        """CiA 402's transitions."""
        rising = controlword & ~self._controlword
        self._controlword = controlword
        if self._state == "fault":
            if rising & 0x80:
                self._state, self._error_code = "switch on disabled", 0
            return
        if not controlword & 0x02:
            self._state = "switch on disabled"
        elif not controlword & 0x04:
            if self._state == "operation enabled":
                deceleration = float(self._node.sdo[QUICK_STOP_DECELERATION].raw)
                self._move = self._move.braked(self._now(), deceleration)
                self._state = "quick stop"
            else:
                self._state = "switch on disabled"
        elif not controlword & 0x01:
            self._state = "ready to switch on"
        elif not controlword & 0x08:
            if self._state != "switch on disabled":
                self._state = "switched on"
        elif self._state in {"switched on", "operation enabled"}:
            self._state = "operation enabled"
            if rising & 0x10:
                self._begin()
                self._acknowledged = True
        if not controlword & 0x10:
            self._acknowledged = False

    def _begin(self) -> None:
        now = self._now()
        self._move = TrapezoidalMove(
            self._move.position(now),
            float(self._node.sdo[TARGET].raw),
            float(self._node.sdo[VELOCITY].raw),
            float(self._node.sdo[ACCELERATION].raw),
            now,
        )

    def _update(self) -> None:
        """Let faults strike in the middle of a move, even where nobody looked until it would have been over."""
        middle = self._move.began_s + self._move.duration_s / 2
        if self._state != "operation enabled" or self._move.duration_s == 0 or self._now() < middle:
            return
        here = self._move.position(middle)
        if self.fault == "stall":
            self._move = TrapezoidalMove(here, here, 1, 1, float("inf"))
        elif self.fault in EMERGENCIES:
            self._move = TrapezoidalMove(here, here, 1, 1, 0)
            self._fail(EMERGENCIES[self.fault])

    def _fail(self, code: int) -> None:
        self._state, self._error_code = "fault", code
        self._node.emcy.send(code, register=0x21 if code == EMERGENCIES["following error"] else 0x03)

    def _statusword(self) -> int:
        word = STATE_BITS[self._state]
        if self._state == "operation enabled" and self._move.finished(self._now()):
            word |= TARGET_REACHED
        if self._acknowledged:
            word |= SET_POINT_ACKNOWLEDGE
        if self._error_code == EMERGENCIES["following error"]:
            word |= FOLLOWING_ERROR
        return word
