"""A drive in software: a CANopen node with a CiA 402 state machine and a motor in profile position mode.

It shares nothing with the driver but the bus. SDO, NMT and emergencies are served by ``canopen.LocalNode``, objects and
their limits come from the EDS file beside this module; states, set-points, motion, following error and the heartbeat
are here. The motor's clock may run faster than ours, so that a run need not wait for it; the bus and the heartbeat run
in real time. A new set-point replaces the present one at once; process data objects are not served.

The clock is read once a step, in ``_advance``, and everything in that step happens at this moment: a thread that is
kept waiting between two lines then sees the motor farther on, never a shaft that lags behind its set-point.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, get_args

import can
import canopen

from pipeline.devices.motion_profile import Motion, braking, trapezoid

EDS = Path(__file__).with_suffix(".eds")

Fault = Literal["jam", "stall", "overheating", "refusal", "no heartbeat", "silence", "restart", "not enabled", "broken"]
"""What can go wrong.

jam: the shaft is blocked, and the drive notices; stall: it is blocked, and the drive does not notice; overheating: an
emergency stops the motor; refusal: new targets are answered with an SDO abort; no heartbeat: requests are still
answered; silence: nothing is; restart: the supply drops for a moment; not enabled: the enable input is open;
broken: a fault that cannot be reset.
"""

_STATUS = {
    "switch on disabled": 0x40,
    "ready to switch on": 0x21,
    "switched on": 0x23,
    "operation enabled": 0x27,
    "quick stop active": 0x07,
    "fault reaction active": 0x0F,
    "fault": 0x08,
}
_VOLTAGE, _REMOTE, _REACHED, _ACKNOWLEDGED, _FOLLOWING = 1 << 4, 1 << 9, 1 << 10, 1 << 12, 1 << 13
_NEW_SET_POINT, _RELATIVE, _RESET, _HALT = 1 << 4, 1 << 6, 1 << 7, 1 << 8
_PROFILE_POSITION = 1
_UNDER_WAY_S, _NOTIFIER_S = 0.001, 0.02


class SimulatedDrive:
    """A simulated drive that lives on python-can's in-process bus while it is started.

    Parameters
    ----------
    channel : str
        Channel of the virtual bus.
    node_id : int
        Its node.
    time_scale : float
        How many times faster than ours the motor's clock runs.
    play_counts : float
        Play between the encoder and the shaft that it turns.
    """

    def __init__(self, *, channel: str, node_id: int = 1, time_scale: float = 1.0, play_counts: float = 0.0) -> None:
        self.channel = channel
        self.node_id = node_id
        self.time_scale = time_scale
        self._play = play_counts
        self._changed = threading.Condition(threading.RLock())
        self._faults: set[Fault] = set()
        self._waiting: list[tuple[Fault, float]] = []
        self._actual = 0.0
        self._shaft = 0.0
        self._running = False
        self._moment = self._clock()
        self._reset()

    def inject(self, fault: Fault, *, at_counts: float | None = None) -> None:
        """Let something go wrong, now or when the encoder next comes past a position; it stays so.

        Raises
        ------
        ValueError
            There is no such fault.
        """
        if fault not in get_args(Fault):
            raise ValueError(f"there is no fault '{fault}', only {', '.join(get_args(Fault))}")
        with self._changed:
            if at_counts is not None:
                self._waiting.append((fault, at_counts))
            elif self._running:
                self._advance()
                self._strike(fault)
            else:
                self._faults.add(fault)

    @property
    def shaft_counts(self) -> float:
        """Where the shaft behind the play really stands, finer than the encoder's counts."""
        with self._changed:
            if self._running:
                self._advance()
            return self._shaft

    @property
    def state(self) -> str:
        """State of the CiA 402 state machine."""
        with self._changed:
            if self._running:
                self._advance()
            return self._state

    def start(self) -> None:
        """Switch the supply on."""
        self._node = canopen.LocalNode(self.node_id, str(EDS))
        self._node.add_read_callback(self._read)
        self._node.add_write_callback(self._written)
        self._network = _Network(can.Bus(interface="virtual", channel=self.channel))
        self._network.NOTIFIER_CYCLE = _NOTIFIER_S
        with self._changed:
            self._moment = self._clock()
            self._reset()
            self._running = True
            self._network.add_node(self._node)
            self._network.connect()
            self._boot()
            for fault in tuple(self._faults):
                self._strike(fault)
        self._worker = threading.Thread(target=self._work, name=f"simulated drive on {self.channel}", daemon=True)
        self._worker.start()

    def stop(self) -> None:
        """Switch the supply off; all threads have ended."""
        with self._changed:
            self._advance()
            self._running = False
            self._changed.notify_all()
        self._worker.join()
        self._node.nmt.stop_heartbeat()
        self._network.disconnect()

    def _reset(self) -> None:
        self._state = "switch on disabled"
        self._error_code = 0
        self._controlword = 0
        self._acknowledged = False
        self._halted = False
        self._target = self._actual
        self._rest()

    def _boot(self) -> None:
        self._node.data_store.clear()
        self._node.nmt.stop_heartbeat()
        self._node.nmt.state = "INITIALISING"
        self._node.nmt.state = "PRE-OPERATIONAL"

    def _strike(self, fault: Fault) -> None:
        """What a fault does at its beginning."""
        self._faults.add(fault)
        if fault in {"no heartbeat", "silence"}:
            self._node.nmt.stop_heartbeat()
        if fault == "silence":
            self._network.unsubscribe(self._node.sdo.rx_cobid)
            self._rest()
        elif fault == "restart":
            self._faults.discard("restart")
            self._reset()
            self._boot()
        elif fault == "overheating":
            self._fail(0x4210, register=0x09)
        elif fault == "broken":
            self._fail(0x5400, register=0x81)

    # Motion

    def _work(self) -> None:
        """Notice what happens while nobody asks."""
        with self._changed:
            while self._running:
                self._advance()
                self._changed.wait(_UNDER_WAY_S if self._under_way() else None)

    def _under_way(self) -> bool:
        return not self._at_rest() or self._demand() != self._actual

    def _clock(self) -> float:
        return time.monotonic() * self.time_scale

    def _at_rest(self) -> bool:
        return self._moment >= self._began + self._motion.seconds

    def _demand(self) -> float:
        return self._motion.at(self._moment - self._began)[0]

    def _velocity(self) -> float:
        return self._motion.at(self._moment - self._began)[1]

    def _go(self, motion: Motion) -> None:
        self._motion, self._began, self._followed = motion, self._moment, self._moment
        self._changed.notify_all()

    def _rest(self) -> None:
        """The motor is off, and friction holds the shaft."""
        with self._changed:
            self._go(Motion(self._actual))

    def _brake(self, deceleration: str) -> None:
        self._go(braking(self._demand(), self._velocity(), self._value(deceleration)))

    def _advance(self) -> None:
        """Bring everything to this moment of the drive's clock."""
        self._moment = self._clock()
        before, demand = self._actual, self._demand()
        if not {"jam", "stall"} & self._faults:
            self._actual = demand
        for fault, place in [w for w in self._waiting if min(before, demand) <= w[1] <= max(before, demand)]:
            self._waiting.remove((fault, place))
            if fault in {"jam", "stall"}:
                self._actual = place
            self._strike(fault)
        self._shaft = min(max(self._shaft, self._actual - self._play / 2), self._actual + self._play / 2)
        self._watch_following_error()
        if self._state == "quick stop active" and self._at_rest() and self._value("Quick stop option code") < 5:
            self._state = "switch on disabled"
        elif self._state == "fault reaction active" and (self._at_rest() or "jam" in self._faults):
            self._state = "fault"
            self._rest()

    def _watch_following_error(self) -> None:
        follows = abs(self._demand() - self._actual) <= self._value("Following error window")
        if follows or "stall" in self._faults or self._state != "operation enabled":
            self._followed = self._moment
        elif self._moment - self._followed >= self._value("Following error time out") / 1000:
            self._fail(0x8611, register=0x21)

    def _fail(self, code: int, *, register: int) -> None:
        self._error_code = code
        self._node.data_store.setdefault(0x1003, {}).update({0: b"\x01", 1: code.to_bytes(4, "little")})
        self._node.data_store.setdefault(0x1001, {})[0] = bytes([register])
        if self._state == "operation enabled":
            self._brake("Quick stop deceleration")
            self._state = "fault reaction active"
        else:
            self._rest()
            self._state = "fault"
        self._node.emcy.send(code, register)

    # What the bus asks

    def _value(self, name: str) -> int:
        return int(self._node.sdo[name].raw)

    def _read(self, *, index: int, **_: Any) -> int | None:
        if index not in _LIVE:
            return None
        with self._changed:
            self._advance()
            return _LIVE[index](self)

    def _written(self, *, index: int, od: Any, data: bytes, **_: Any) -> None:
        with self._changed:
            self._advance()
            value = int(od.decode_raw(data))
            if od.max is not None and value > od.max:
                raise canopen.SdoAbortedError(0x06090031)
            if od.min is not None and value < od.min:
                raise canopen.SdoAbortedError(0x06090032)
            if index == 0x607A and "refusal" in self._faults:
                raise canopen.SdoAbortedError(0x08000022)
            if index == 0x1017 and "no heartbeat" in self._faults:
                self._node.nmt.stop_heartbeat()
            if index == 0x6040:
                rising, self._controlword = value & ~self._controlword, value
                self._obey(value, rising)

    def _obey(self, word: int, rising: int) -> None:
        """The transitions of CiA 402-2."""
        state = self._state
        if state in {"fault", "fault reaction active"}:
            if state == "fault" and rising & _RESET and "broken" not in self._faults:
                self._state, self._error_code = "switch on disabled", 0
                self._node.data_store.get(0x1001, {}).clear()
                self._node.emcy.reset()
        elif not word & 0x02:
            self._switch("switch on disabled")
        elif not word & 0x04:
            if state == "operation enabled":
                self._brake("Quick stop deceleration")
                self._state = "quick stop active"
            elif state in {"ready to switch on", "switched on"}:
                self._state = "switch on disabled"
        elif state == "quick stop active":
            if word & 0x0F == 0x0F and self._value("Quick stop option code") >= 5:
                self._state = "operation enabled"
        elif word & 0x07 == 0x06 and "not enabled" not in self._faults:
            self._switch("ready to switch on")
        elif word & 0x0F == 0x07 and state in {"ready to switch on", "operation enabled"}:
            self._switch("switched on")
        elif word & 0x0F == 0x0F and state in {"ready to switch on", "switched on"}:
            self._state = "operation enabled"
        if self._state == "operation enabled":
            self._position(word, rising)
        if not word & _NEW_SET_POINT:
            self._acknowledged = False

    def _switch(self, state: str) -> None:
        """Change to a state in which the motor is off; it is off at once."""
        if self._state in {"operation enabled", "quick stop active"}:
            self._rest()
        self._state = state

    def _position(self, word: int, rising: int) -> None:
        """Set-points and halt of the profile position mode."""
        if rising & _NEW_SET_POINT and self._value("Modes of operation") == _PROFILE_POSITION:
            written = self._value("Target position")
            self._target = written + (self._target if word & _RELATIVE else 0)
            self._acknowledged = True
            if not word & _HALT:
                self._head_for_target()
        elif rising & _HALT:
            self._brake("Profile deceleration")
        elif self._halted and not word & _HALT:
            self._head_for_target()
        self._halted = bool(word & _HALT)

    def _head_for_target(self) -> None:
        self._go(
            trapezoid(
                self._demand(),
                self._target,
                velocity=self._value("Profile velocity"),
                acceleration=self._value("Profile acceleration"),
                deceleration=self._value("Profile deceleration"),
                velocity_now=self._velocity(),
            )
        )

    def _statusword(self) -> int:
        word = _STATUS[self._state] | _VOLTAGE | _REMOTE
        settled = self._began + self._motion.seconds + self._value("Position window time") / 1000
        if self._moment >= settled and abs(self._actual - self._target) <= self._value("Position window"):
            word |= _REACHED
        if self._acknowledged:
            word |= _ACKNOWLEDGED
        if self._error_code == 0x8611:
            word |= _FOLLOWING
        return word


_LIVE: dict[int, Callable[[SimulatedDrive], int]] = {
    0x603F: lambda drive: drive._error_code,
    0x6041: lambda drive: drive._statusword(),
    0x6061: lambda drive: drive._value("Modes of operation"),
    0x6062: lambda drive: round(drive._demand()),
    0x6064: lambda drive: round(drive._actual),
    0x606C: lambda drive: round(drive._velocity()),
    0x60F4: lambda drive: round(drive._demand() - drive._actual),
}
"""Objects whose values are made when they are read."""


class _Network(canopen.Network):
    """A network whose periodic messages end when they are told to, thread and all."""

    def send_periodic(self, can_id: int, data: Sequence[int], period: float, remote: bool = False) -> _Periodic:
        return _Periodic(self, can_id, data, period)


class _Periodic:
    def __init__(self, network: _Network, can_id: int, data: Sequence[int], period: float) -> None:
        self._network, self._can_id, self._data, self._period = network, can_id, data, period
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"heartbeat {can_id:#x}", daemon=True)
        self._thread.start()

    def update(self, data: Sequence[int]) -> None:
        self._data = data

    def stop(self) -> None:
        self._ended.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ended.wait(self._period):
            self._network.send_message(self._can_id, self._data)
