"""The CANopen mount: motion through the real driver, and every fault told by name with the motion stopped."""

from __future__ import annotations

import threading
import time

import can
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.devices.cia402 import state_of
from pipeline.devices.motion_profile import TrapezoidalMove
from pipeline.devices.protocols import RotationMount
from pipeline.devices.rotation_mount import CanopenRotationMount, SimulatedRotationMount
from pipeline.errors import DeviceError


def test_it_turns_to_each_angle_and_reads_its_encoder() -> None:
    with SimulatedRotationMount(counts_per_turn=3600) as mount:
        assert isinstance(mount, RotationMount)
        assert mount.stops_rad is None
        for angle in np.deg2rad([0, 15.04, 165, 90, -20]):
            reached = mount.move_to(angle)
            assert reached == pytest.approx(angle, abs=np.deg2rad(0.05) + 1e-12)
            assert reached / np.deg2rad(0.1) == pytest.approx(round(reached / np.deg2rad(0.1)), abs=1e-6)
            assert mount.shaft_rad == pytest.approx(reached, abs=1e-9)


def test_backlash_moves_the_shaft_but_not_the_encoder() -> None:
    with SimulatedRotationMount(backlash_deg=0.5) as mount:
        assert mount.move_to(1.0) - mount.shaft_rad == pytest.approx(np.deg2rad(0.5))


def test_a_mount_is_opened_before_it_moves() -> None:
    with pytest.raises(DeviceError, match=r"rotation mount \(node 1 on simulated-\w+\) is not open"):
        SimulatedRotationMount().move_to(0.3)


def test_it_can_be_opened_again() -> None:
    mount = SimulatedRotationMount()
    for _ in range(2):
        with mount:
            assert mount.move_to(0.5) == pytest.approx(0.5, abs=1e-4)


def test_two_mounts_do_not_disturb_each_other() -> None:
    with SimulatedRotationMount() as one, SimulatedRotationMount() as other:
        assert one.move_to(0.4) == pytest.approx(0.4, abs=1e-4)
        assert other.move_to(1.2) == pytest.approx(1.2, abs=1e-4)
        assert one.shaft_rad == pytest.approx(0.4, abs=1e-4)


def test_no_thread_is_left_behind() -> None:
    before = set(threading.enumerate())
    with SimulatedRotationMount() as mount:
        mount.move_to(0.4)
    deadline = time.monotonic() + 3
    while set(threading.enumerate()) - before and time.monotonic() < deadline:
        time.sleep(0.01)
    assert set(threading.enumerate()) - before == set()


@pytest.mark.parametrize(
    ("fault", "cause"),
    [
        ("stall", r"it did not arrive at 60000 counts in time; it stands at \d+ counts"),
        ("following error", "fault 0x8611: following error: the shaft does not follow the set-point"),
        ("overcurrent", "fault 0x2310: continuous over-current"),
        ("abort", "it refused 60000 for 0x607a: .*General error"),
        ("silence", "no answer when reading 0x6064: is it powered and on this bus"),
        ("heartbeat lost", r"its heartbeat has been missing for 0\.\d s"),
    ],
)
def test_a_fault_names_the_axis_and_the_cause(fault: str, cause: str) -> None:
    scale = 3.0 if fault == "heartbeat lost" else 200.0
    with SimulatedRotationMount(fault=fault, time_scale=scale, timeout_s=0.3) as mount:
        with pytest.raises(DeviceError, match=rf"rotation mount \(node 1 on simulated-\w+\): {cause}"):
            mount.move_to(np.deg2rad(60))
        here = mount.shaft_rad
        assert here < np.deg2rad(59.9)
        time.sleep(0.05)
        if fault not in {"silence", "heartbeat lost"}:
            assert mount.shaft_rad == pytest.approx(here, abs=np.deg2rad(1e-3))


def test_a_stopped_axis_brakes_by_quick_stop() -> None:
    with SimulatedRotationMount(fault="heartbeat lost", time_scale=3.0, timeout_s=0.3) as mount:
        with pytest.raises(DeviceError, match="heartbeat"):
            mount.move_to(np.deg2rad(120))
        assert mount.drive is not None
        assert mount.drive.state == "quick stop"
        time.sleep(0.3)
        rest = mount.shaft_rad
        time.sleep(0.1)
        assert mount.shaft_rad == pytest.approx(rest, abs=1e-9)
        assert rest < np.deg2rad(110)


def test_a_fault_is_reset_when_the_mount_is_opened_again() -> None:
    with SimulatedRotationMount(fault="overcurrent") as mount:
        with pytest.raises(DeviceError, match="over-current"):
            mount.move_to(1.0)
        assert mount.drive is not None
        assert mount.drive.state == "fault"
        mount.drive.inject("none")
        assert mount._axis is not None
        mount._axis._enable()
        assert mount.move_to(0.2) == pytest.approx(0.2, abs=1e-4)


def test_an_empty_bus_is_said_to_be_empty() -> None:
    mount = CanopenRotationMount(interface="virtual", channel="nobody", timeout_s=0.1)
    with pytest.raises(DeviceError, match=r"node 1 on nobody\): no answer when writing 0x1017"), mount:
        pass


def test_a_bus_that_is_not_there_is_named() -> None:
    mount = CanopenRotationMount(interface="slcan", channel="/dev/not-there")
    with pytest.raises(DeviceError, match=r"node 1 on /dev/not-there\): the bus cannot be opened"), mount:
        pass


def test_what_goes_over_the_wire_is_cia_402() -> None:
    with SimulatedRotationMount() as mount:
        spy = can.Bus(interface="virtual", channel=mount.channel)
        mount.move_to(np.deg2rad(90))
        frames = []
        while (frame := spy.recv(0.05)) is not None:
            frames.append((frame.arbitration_id, frame.data.hex()))
        spy.shutdown()
    requests = [data for address, data in frames if address == 0x601 and data[0] == "2"]
    assert requests[:3] == [
        "237a6000905f0100",  # download 4 bytes to 0x607A: target 90000 counts
        "2b4060001f000000",  # download 2 bytes to 0x6040: new set-point
        "2b4060000f000000",  # download 2 bytes to 0x6040: set-point taken back
    ]
    assert (0x581, "607a600000000000") in frames  # download of 0x607A confirmed


@given(st.floats(-1e5, 1e5), st.floats(-1e5, 1e5), st.floats(10, 1e5), st.floats(10, 1e6))
def test_a_move_starts_and_ends_at_rest_within_its_limits(
    start: float, target: float, speed: float, ramp: float
) -> None:
    move = TrapezoidalMove(start, target, speed, ramp, 5.0)
    times = 5.0 + np.linspace(0, move.duration_s, 401)
    places = np.array([move.position(t) for t in times])
    assert places[0] == start
    assert move.position(5.0 + move.duration_s + 1e-9) == target
    assert np.all(np.diff(places) * np.sign(target - start) >= -1e-6 * (1 + abs(target) + abs(start)))
    if move.duration_s > 0:
        step = move.duration_s / 400
        assert np.abs(np.diff(places)).max() <= speed * step * (1 + 1e-6) + 1e-6 * (1 + abs(start) + abs(target))


@settings(max_examples=30)
@given(st.floats(0.05, 0.95))
def test_braking_begins_at_the_present_speed_and_ends_at_rest(share: float) -> None:
    move = TrapezoidalMove(0, 10_000, 1000, 2000, 0.0)
    now = share * move.duration_s
    braked = move.braked(now, 8000)
    assert braked.position(now) == pytest.approx(move.position(now))
    assert braked.position(now + 10) <= 10_000 + 200
    assert braked.position(now + 10) >= move.position(now)


@pytest.mark.parametrize(
    ("word", "state"),
    [
        (0x0000, "not ready to switch on"),
        (0x0240, "switch on disabled"),
        (0x0231, "ready to switch on"),
        (0x0233, "switched on"),
        (0x1637, "operation enabled"),
        (0x0217, "quick stop active"),
        (0x0008, "fault"),
        (0x000F, "fault reaction active"),
    ],
)
def test_statuswords_by_the_masks_of_the_standard(word: int, state: str) -> None:
    assert state_of(word) == state


@pytest.mark.parametrize("setting", [{"counts_per_turn": 0}, {"velocity_deg_s": 0.0}, {"acceleration_deg_s2": -1.0}])
def test_senseless_settings_are_refused(setting: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="may not be 0, velocity and acceleration must be above 0"):
        SimulatedRotationMount(**setting)
