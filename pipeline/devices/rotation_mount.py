"""A polariser in a rotation mount that a CANopen drive turns; the simulated one differs only by what is on the bus."""

from __future__ import annotations

import uuid
from collections.abc import Sequence
from contextlib import ExitStack
from math import pi
from types import TracebackType
from typing import Literal, Self

import canopen

from pipeline.devices.cia402 import Axis
from pipeline.devices.simulated_drive import SimulatedDrive
from pipeline.errors import DeviceError


class CanopenRotationMount:
    """A polariser turned by a CiA 402 drive on any bus that python-can knows.

    Parameters
    ----------
    interface, channel, bitrate : str, str, int
        The bus, as python-can names it: socketcan and can0, slcan and /dev/ttyACM0, pcan, ixxat, kvaser, vector, ...
    node_id : int
        The drive's node.
    counts_per_turn : int
        Encoder counts in one turn of the polariser; negative where positive counts turn it clockwise in the photo.
    zero_deg : float
        Angle of the polariser's transmitted direction where the encoder reads 0.
    velocity_deg_s, acceleration_deg_s2 : float
        Of moves.
    timeout_s : float
        Longest wait for an answer; moves get the time they need on top.
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
        velocity_deg_s: float = 30.0,
        acceleration_deg_s2: float = 90.0,
        timeout_s: float = 1.0,
    ) -> None:
        if counts_per_turn == 0 or velocity_deg_s <= 0 or acceleration_deg_s2 <= 0:
            raise ValueError("counts_per_turn may not be 0, velocity and acceleration must be above 0")
        self.interface = interface
        self.channel = channel
        self.bitrate = bitrate
        self.node_id = node_id
        self.counts_per_turn = counts_per_turn
        self.zero_deg = zero_deg
        self.velocity_deg_s = velocity_deg_s
        self.acceleration_deg_s2 = acceleration_deg_s2
        self.timeout_s = timeout_s
        self._time_scale = 1.0
        self._axis: Axis | None = None
        self._stack = ExitStack()

    @property
    def name(self) -> str:
        """What errors call it."""
        return f"rotation mount (node {self.node_id} on {self.channel})"

    @property
    def stops_rad(self) -> Sequence[float] | None:
        """None: it turns freely."""
        return None

    def move_to(self, angle_rad: float) -> float:
        """Turn to an angle; returns the angle that the encoder reads once the drive stands.

        Raises
        ------
        DeviceError
            The mount is not open, or the drive did not get there; it has been told to stop.
        """
        if self._axis is None:
            raise DeviceError(f"{self.name} is not open")
        return self._angle_rad(self._axis.move_to(round(self._counts(angle_rad))))

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            network = _network()
            try:
                network.connect(interface=self.interface, channel=self.channel, bitrate=self.bitrate)
            except Exception as error:
                raise DeviceError(f"{self.name}: the bus cannot be opened: {error}") from error
            stack.callback(network.disconnect)
            per_degree = abs(self.counts_per_turn) / 360
            self._axis = stack.enter_context(
                Axis(
                    network,
                    self.node_id,
                    name=self.name,
                    velocity=self.velocity_deg_s * per_degree,
                    acceleration=self.acceleration_deg_s2 * per_degree,
                    timeout_s=self.timeout_s,
                    time_scale=self._time_scale,
                )
            )
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._axis = None
        self._stack.close()

    def _counts(self, angle_rad: float) -> float:
        return (angle_rad - self.zero_deg * pi / 180) / (2 * pi) * self.counts_per_turn

    def _angle_rad(self, counts: float) -> float:
        return counts / self.counts_per_turn * 2 * pi + self.zero_deg * pi / 180


class SimulatedRotationMount(CanopenRotationMount):
    """The same mount with a simulated drive on a virtual bus of this process.

    What a lab runs is what every run exercises: only the drive is not there.

    Parameters
    ----------
    time_scale : float
        How much faster the drive's clock runs than ours.
    node_id, counts_per_turn, velocity_deg_s, acceleration_deg_s2, timeout_s
        As for the real mount.
    backlash_deg : float
        Angle by which the shaft lags behind the encoder.
    fault : {"none", "stall", "following error", "overcurrent", "abort", "silence", "heartbeat lost"}
        What breaks in the first move.
    """

    physical = False

    def __init__(
        self,
        *,
        time_scale: float = 1000.0,
        node_id: int = 1,
        counts_per_turn: int = 360000,
        velocity_deg_s: float = 30.0,
        acceleration_deg_s2: float = 90.0,
        timeout_s: float = 1.0,
        backlash_deg: float = 0.0,
        fault: Literal[
            "none", "stall", "following error", "overcurrent", "abort", "silence", "heartbeat lost"
        ] = "none",
    ) -> None:
        super().__init__(
            interface="virtual",
            channel=f"simulated-{uuid.uuid4().hex[:8]}",
            node_id=node_id,
            counts_per_turn=counts_per_turn,
            velocity_deg_s=velocity_deg_s,
            acceleration_deg_s2=acceleration_deg_s2,
            timeout_s=timeout_s,
        )
        self._time_scale = time_scale
        self.backlash_deg = backlash_deg
        self.fault = fault
        self.drive: SimulatedDrive | None = None
        self._bench = ExitStack()

    @property
    def shaft_rad(self) -> float:
        """Angle at which the polariser really stands."""
        counts = self.drive.position_counts if self.drive else 0.0
        return self._angle_rad(counts) - self.backlash_deg * pi / 180

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            network = _network()
            network.connect(interface=self.interface, channel=self.channel)
            stack.callback(network.disconnect)
            self.drive = SimulatedDrive(network, self.node_id, time_scale=self._time_scale)
            stack.callback(self.drive.close)
            super().__enter__()
            self._bench = stack.pop_all()
        self.drive.inject(self.fault)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            super().__exit__(kind, error, trace)
        finally:
            self._bench.close()


def _network() -> canopen.Network:
    """A network whose listener ends soon after it is told to, instead of after a second."""
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.02
    return network
