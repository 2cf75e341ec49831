"""Rotation mounts that a CANopen drive turns; the simulated one differs only in who answers on the bus."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from contextlib import ExitStack
from fractions import Fraction
from math import degrees, isfinite, pi, radians, sin
from types import TracebackType
from typing import Self

import can

from pipeline.devices.cia402 import Axis
from pipeline.devices.decimal_angles import exact_radians
from pipeline.devices.simulated_drive import Fault, SimulatedDrive
from pipeline.errors import DeviceError, InputError, nearest
from pipeline.limits import above_zero, above_zero_up_to, refuse, within, zero_or_more

_channels = itertools.count(1)

MOST_COUNTS = 2**32 - 1
"""Largest velocity or acceleration that a drive's object holds, in counts a second (squared)."""

LONGEST_HEARTBEAT_S = 65.535
"""The object that holds the interval has 16 bits, in milliseconds."""


class CanopenRotationMount:
    """A polariser in a mount that a CiA 402 drive turns, on any CAN interface that python-can knows.

    The drive must count in encoder counts, counts a second and counts a second squared, and know its zero: an absolute
    encoder, or homed before.

    Parameters
    ----------
    interface, channel : str
        The bus as python-can names it: socketcan and can0, slcan and /dev/ttyACM0, pcan and PCAN_USBBUS1, ...
    bitrate : int
        Of the bus; socketcan takes that of its network interface.
    node_id : int
        The drive's node.
    counts_per_turn : int
        Encoder counts in one turn of the polariser, gear included.
    zero_deg : float
        Angle of the polariser's transmitted direction where the encoder reads zero.
    clockwise : bool
        Whether rising counts turn the polariser clockwise as seen in the photograph.
    velocity_deg_s, acceleration_deg_s2 : float
        Limits of the motion.
    tolerance_deg : float
        Farthest from its target that the polariser may come to rest.
    timeout_s : float
        How long the drive may take to change its state, and to move beyond the time that the motion needs.
    response_s : float
        How long it may take to answer.
    heartbeat_s : float
        Interval of its heartbeat, five of which may be missing; 0 to do without.
    """

    physical = True

    def __init__(
        self,
        *,
        interface: str = "socketcan",
        channel: str = "can0",
        bitrate: int = 500000,
        node_id: int = 1,
        counts_per_turn: int = 360000,
        zero_deg: float = 0.0,
        clockwise: bool = False,
        velocity_deg_s: float = 20.0,
        acceleration_deg_s2: float = 100.0,
        tolerance_deg: float = 0.05,
        timeout_s: float = 5.0,
        response_s: float = 1.0,
        heartbeat_s: float = 0.2,
    ) -> None:
        per_deg = counts_per_turn / 360
        fastest = MOST_COUNTS / abs(per_deg or 1)
        self._problems = [
            *above_zero(counts_per_turn=counts_per_turn, bitrate=bitrate),
            *above_zero_up_to(fastest, velocity_deg_s=velocity_deg_s, acceleration_deg_s2=acceleration_deg_s2),
            *above_zero(timeout_s=timeout_s, response_s=response_s),
            *zero_or_more(tolerance_deg=tolerance_deg),
            *within(0, LONGEST_HEARTBEAT_S, heartbeat_s=heartbeat_s),
            *within(1, 127, node_id=node_id),
        ]
        self._interface = interface
        self._counts_per_turn = Fraction(-counts_per_turn if clockwise else counts_per_turn)
        self._zero_deg = Fraction(repr(zero_deg))
        self._axis = Axis(
            name=f"rotation mount (node {node_id} on {channel})",
            interface=interface,
            channel=channel,
            bitrate=bitrate,
            node_id=node_id,
            velocity=max(1, round(velocity_deg_s * per_deg)),
            acceleration=max(1, round(acceleration_deg_s2 * per_deg)),
            tolerance=max(1, round(tolerance_deg * per_deg)),
            timeout_s=timeout_s,
            response_s=response_s,
            heartbeat_s=heartbeat_s,
            in_words=lambda counts: f"{degrees(self._angle_rad(counts)):.3f} deg",
        )

    @property
    def stops_rad(self) -> Sequence[float] | None:
        """None: it turns freely."""
        return None

    def check(self) -> None:
        """Refuse settings that no drive can have, and a CAN interface that python-can does not know.

        Raises
        ------
        InputError, InputErrors
            Each setting, and what was expected.
        """
        refuse(self.problems())

    def problems(self) -> list[InputError]:
        """What :meth:`check` refuses."""
        if self._interface in can.VALID_INTERFACES:
            return self._problems
        unknown = InputError(
            f"python-can has no interface '{self._interface}'",
            where="interface",
            expected="the kind of CAN interface, such as socketcan, slcan or pcan",
            hint=nearest(self._interface, can.VALID_INTERFACES),
        )
        return [*self._problems, unknown]

    def move_to(self, angle_rad: float) -> float:
        """Turn the polariser to ``angle_rad`` and return the angle that the encoder reads once it stands still.

        Raises
        ------
        DeviceError
            It did not get there. The message names the axis and the cause; the axis has been told to stop.
        """
        if not isfinite(angle_rad):
            raise DeviceError(f"{self._axis.name}: {angle_rad} is no angle to go to")
        turns = (degrees(angle_rad) - float(self._zero_deg)) / 360
        return self._angle_rad(self._axis.move_to(round(turns * float(self._counts_per_turn))))

    def __enter__(self) -> Self:
        refuse(self._problems)
        self._axis.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._axis.__exit__(kind, error, trace)

    def _angle_rad(self, counts: int) -> float:
        """The angle nearest to what the counts mean, so that a stop at 15 degrees is written as 15 again."""
        return exact_radians(self._zero_deg + 360 * counts / self._counts_per_turn)


class SimulatedRotationMount:
    """The same mount, driven by the same code, with a simulated drive on a bus of its own in this process.

    Parameters
    ----------
    time_scale : float
        How many times faster than ours the drive's clock runs.
    node_id, counts_per_turn, velocity_deg_s, acceleration_deg_s2, timeout_s, response_s, heartbeat_s
        As of :class:`CanopenRotationMount`.
    eccentricity_deg : float
        Amplitude, once a turn, by which the polariser stands elsewhere than the encoder reads.
    backlash_deg : float
        Play between encoder and polariser.
    """

    physical = False

    def __init__(
        self,
        *,
        time_scale: float = 1000.0,
        node_id: int = 1,
        counts_per_turn: int = 360000,
        velocity_deg_s: float = 20.0,
        acceleration_deg_s2: float = 100.0,
        timeout_s: float = 5.0,
        response_s: float = 5.0,
        heartbeat_s: float = 0.5,
        eccentricity_deg: float = 0.0,
        backlash_deg: float = 0.0,
    ) -> None:
        self._problems = [*above_zero(time_scale=time_scale), *zero_or_more(backlash_deg=backlash_deg)]
        channel = f"simulated-{next(_channels)}"
        self._mount = CanopenRotationMount(
            interface="virtual",
            channel=channel,
            node_id=node_id,
            counts_per_turn=counts_per_turn,
            velocity_deg_s=velocity_deg_s,
            acceleration_deg_s2=acceleration_deg_s2,
            timeout_s=timeout_s,
            response_s=response_s,
            heartbeat_s=heartbeat_s,
        )
        self.drive = SimulatedDrive(
            channel=channel,
            node_id=node_id,
            time_scale=time_scale,
            play_counts=backlash_deg / 360 * counts_per_turn,
        )
        self._counts_per_turn = counts_per_turn
        self._eccentricity_rad = radians(eccentricity_deg)
        self._stack = ExitStack()

    @property
    def stops_rad(self) -> Sequence[float] | None:
        """None: it turns freely."""
        return None

    @property
    def shaft_rad(self) -> float:
        """Where the polariser really stands, whatever the encoder reads."""
        behind_play = 2 * pi * self.drive.shaft_counts / self._counts_per_turn
        return behind_play + self._eccentricity_rad * sin(behind_play)

    def check(self) -> None:
        """Refuse settings that no drive can have.

        Raises
        ------
        InputError, InputErrors
            Each setting, and what was expected.
        """
        refuse(self._problems, self._mount.problems())

    def inject(self, fault: Fault, *, at_deg: float | None = None) -> None:
        """Let something go wrong, now or when the encoder comes past an angle: see :data:`simulated_drive.Fault`."""
        self.drive.inject(fault, at_counts=None if at_deg is None else at_deg / 360 * self._counts_per_turn)

    def move_to(self, angle_rad: float) -> float:
        """Turn the polariser to ``angle_rad`` and return the angle that the encoder reads once it stands still.

        Raises
        ------
        DeviceError
            It did not get there.
        """
        return self._mount.move_to(angle_rad)

    def __enter__(self) -> Self:
        refuse(self._problems)
        with ExitStack() as stack:
            self.drive.start()
            stack.callback(self.drive.stop)
            stack.enter_context(self._mount)
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.__exit__(kind, error, trace)
