"""The CANopen axis and its simulated drive: motion, states, and every fault told by name with the motion stopped."""

from __future__ import annotations

import itertools
import logging
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import can
import canopen
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline import progress
from pipeline.devices.canopen_drive import Drive, emergency_text
from pipeline.devices.cia402 import state_of
from pipeline.devices.decimal_angles import degrees_of
from pipeline.devices.motion_profile import braking, trapezoid
from pipeline.devices.protocols import RotationMount
from pipeline.devices.rotation_mount import CanopenRotationMount, SimulatedRotationMount
from pipeline.devices.simulated_drive import EDS, SimulatedDrive
from pipeline.errors import DeviceError, InputError

ON = r"rotation mount \(node 1 on simulated-\d+\): "
SLOW = {"time_scale": 1.0, "velocity_deg_s": 90.0, "acceleration_deg_s2": 2000.0, "timeout_s": 0.3, "response_s": 0.3}


def at_rest(mount: SimulatedRotationMount) -> float:
    """Where the shaft stands, in degrees, proven to stand."""
    before = mount.shaft_rad
    time.sleep(0.03)
    assert mount.shaft_rad == before
    return float(np.rad2deg(before))


@contextmanager
def requests(drive: SimulatedDrive) -> Iterator[canopen.SdoClient]:
    """Ask a drive by hand."""
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.02
    network.connect(interface="virtual", channel=drive.channel)
    try:
        yield network.add_node(canopen.RemoteNode(drive.node_id, str(EDS))).sdo
    finally:
        network.disconnect()


@pytest.fixture
def drive() -> Iterator[SimulatedDrive]:
    drive = SimulatedDrive(channel="test of the drive", time_scale=1000.0)
    drive.start()
    yield drive
    drive.stop()


# The mount


def test_it_turns_to_each_angle_and_reads_its_encoder() -> None:
    with SimulatedRotationMount(counts_per_turn=3600) as mount:
        assert isinstance(mount, RotationMount)
        assert mount.stops_rad is None
        for angle_deg in (0, 15.04, 165, 90, -20):
            reached = np.rad2deg(mount.move_to(np.deg2rad(angle_deg)))
            assert reached == pytest.approx(round(10 * angle_deg) / 10, abs=1e-9)  # a count is 0.1 degree
            assert np.rad2deg(mount.shaft_rad) == pytest.approx(reached, abs=1e-9)


def test_zero_and_sense_of_turning_are_the_mounts(drive: SimulatedDrive) -> None:
    with CanopenRotationMount(interface="virtual", channel=drive.channel, zero_deg=10.0, clockwise=True) as mount:
        assert mount.move_to(np.deg2rad(30)) == pytest.approx(np.deg2rad(30))
    assert drive.shaft_counts == -20_000


def test_an_encoder_at_whole_degrees_reads_the_nearest_doubles() -> None:
    """Written out they are 15.0 and not 14.999999999999998."""
    with SimulatedRotationMount() as mount:
        assert [degrees_of(mount.move_to(np.deg2rad(angle))) for angle in (15, 30, 60, 120.5)] == [
            "15.0",
            "30.0",
            "60.0",
            "120.5",
        ]


def test_the_shaft_may_stand_elsewhere_than_the_encoder_reads() -> None:
    with SimulatedRotationMount(eccentricity_deg=0.2, backlash_deg=0.5) as mount:
        reached = [np.rad2deg(mount.move_to(np.deg2rad(a))) for a in (90, 0)]
        assert reached == pytest.approx([90, 0])
        behind_play = 0.25  # half the play, now that it came from above
        assert np.rad2deg(mount.shaft_rad) == pytest.approx(
            behind_play + 0.2 * np.sin(np.deg2rad(behind_play)), abs=1e-9
        )


def test_a_thread_kept_waiting_makes_no_following_error(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = time.monotonic

    def kept_waiting() -> float:
        now = clock()
        time.sleep(0.001)  # a second of the drive's clock, in which the motor turns by 20 degrees
        return now

    monkeypatch.setattr("pipeline.devices.simulated_drive.time", SimpleNamespace(monotonic=kept_waiting))
    with SimulatedRotationMount() as mount:
        for angle_deg in (90, 0):
            assert mount.move_to(np.deg2rad(angle_deg)) == pytest.approx(np.deg2rad(angle_deg), abs=1e-5)
        assert mount.drive.state == "operation enabled"


def test_an_answer_counts_that_came_while_this_process_was_held_up(monkeypatch: pytest.MonkeyPatch) -> None:
    read_response, held_up = canopen.sdo.SdoClient.read_response, itertools.cycle([True, False])

    def late(client: canopen.sdo.SdoClient) -> bytes:
        if next(held_up):
            raise canopen.SdoCommunicationError("No SDO response received")
        return read_response(client)

    with SimulatedRotationMount() as mount:
        monkeypatch.setattr(canopen.sdo.SdoClient, "read_response", late)
        assert mount.move_to(0.5) == pytest.approx(0.5, abs=1e-5)


def test_two_mounts_do_not_disturb_each_other() -> None:
    with SimulatedRotationMount() as one, SimulatedRotationMount() as other:
        other.inject("jam")
        with pytest.raises(DeviceError, match="following error"):
            other.move_to(0.5)
        assert one.move_to(1.0) == pytest.approx(1.0, abs=1e-5)
        assert other.shaft_rad == 0.0


def test_threads_end_and_the_position_is_kept() -> None:
    before = set(threading.enumerate())
    mount = SimulatedRotationMount()
    with mount:
        mount.move_to(0.5)
    assert set(threading.enumerate()) == before
    assert mount.drive.state == "switch on disabled"
    with mount:
        assert mount.shaft_rad == pytest.approx(0.5, abs=1e-5)
    assert set(threading.enumerate()) == before


def test_threads_end_where_opening_fails() -> None:
    before = set(threading.enumerate())
    mount = SimulatedRotationMount(timeout_s=0.05)
    mount.inject("not enabled")
    with pytest.raises(DeviceError, match="stays in state 'switch on disabled'"), mount:
        pass
    assert set(threading.enumerate()) == before


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        ({"counts_per_turn": 0}, r"counts_per_turn is 0\s+where: +counts_per_turn\s+expected: a number above 0"),
        ({"velocity_deg_s": -1.0}, r"velocity_deg_s is -1\s+where: +velocity_deg_s\s+expected: above 0, at most 4.29"),
        ({"node_id": 128}, r"node_id is 128\s+where: +node_id\s+expected: 1 to 127"),
        ({"time_scale": 0.0}, r"time_scale is 0\s+where: +time_scale\s+expected: a number above 0"),
        ({"backlash_deg": -1.0}, r"backlash_deg is -1\s+where: +backlash_deg\s+expected: 0 or more"),
    ],
)
def test_senseless_settings_are_refused(wrong: dict[str, float], complaint: str) -> None:
    mount = SimulatedRotationMount(**wrong)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=complaint):
        mount.check()
    with pytest.raises(InputError, match=complaint), mount:
        pass


def test_an_unknown_interface_is_found_before_anything_runs() -> None:
    CanopenRotationMount().check()
    with pytest.raises(InputError, match="did you mean 'socketcan'"):
        CanopenRotationMount(interface="sockcan").check()


@pytest.mark.parametrize(
    ("angle_rad", "complaint"), [(np.nan, "nan is no angle to go to"), (1e5, "is beyond what the drive can count")]
)
def test_an_angle_that_no_drive_can_take(angle_rad: float, complaint: str) -> None:
    with SimulatedRotationMount() as mount, pytest.raises(DeviceError, match=complaint):
        mount.move_to(angle_rad)


def test_it_is_opened_before_it_moves() -> None:
    with pytest.raises(DeviceError, match=ON + "the axis is not open"):
        SimulatedRotationMount().move_to(0.1)


# Faults


@pytest.mark.parametrize(
    ("fault", "cause", "aftermath"),
    [
        ("jam", r"emergency: following error: .* \(error code 0x8611\)", "fault"),
        ("overheating", r"emergency: excess temperature of the drive \(error code 0x4210\)", "fault"),
        ("broken", r"emergency: fault of the power stage \(error code 0x5400\)", "fault"),
        ("stall", r"has not reached 30\.000 deg after 0\.\d+ s", "switch on disabled"),
        ("restart", "has restarted by itself: look at its supply", "switch on disabled"),
    ],
)
def test_a_fault_in_motion_names_axis_and_cause_and_stops(fault: str, cause: str, aftermath: str) -> None:
    with SimulatedRotationMount(**SLOW) as mount:
        mount.inject(fault, at_deg=10.0)
        with pytest.raises(DeviceError, match=ON + cause + r"; it stands still at 1\d\.\d+ deg"):
            mount.move_to(np.deg2rad(30))
        assert 10 <= at_rest(mount) < 20
        assert mount.drive.state == aftermath


def test_a_lost_heartbeat_is_noticed_and_the_motion_stopped() -> None:
    with SimulatedRotationMount(**SLOW, heartbeat_s=0.02) as mount:
        mount.inject("no heartbeat")
        with pytest.raises(DeviceError, match=ON + r"its heartbeat is lost: nothing for 0\.\d+ s; it stands still at"):
            mount.move_to(np.deg2rad(170))
        assert at_rest(mount) < 160
        assert mount.drive.state == "switch on disabled"


def test_a_drive_without_heartbeat_can_be_used() -> None:
    with SimulatedRotationMount(heartbeat_s=0) as mount:
        mount.inject("no heartbeat")
        assert mount.move_to(0.2) == pytest.approx(0.2, abs=1e-5)


def test_a_drive_that_falls_silent_in_motion(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "pipeline"), SimulatedRotationMount(**SLOW) as mount:
        mount.inject("silence", at_deg=5.0)
        with pytest.raises(DeviceError, match=ON + "does not answer; it could not be told to stop and may still move"):
            mount.move_to(np.deg2rad(30))
    (warning,) = [r.getMessage() for r in caplog.records if r.name.startswith("pipeline")]
    assert warning.endswith("does not answer; it could not be disabled")


def test_a_refused_target_gives_the_abort_code_in_words() -> None:
    with SimulatedRotationMount() as mount:
        mount.inject("refusal")
        words = r"refuses to accept 11459 as target position: .*present device state \(abort code 0x08000022\)"
        with pytest.raises(DeviceError, match=ON + words):
            mount.move_to(0.2)
        assert mount.shaft_rad == 0.0


def test_a_speed_that_the_drive_cannot_reach_is_refused_when_it_is_opened() -> None:
    words = r"refuses to accept 9000000 as profile velocity: .*too high \(abort code 0x06090031\)"
    with pytest.raises(DeviceError, match=ON + words), SimulatedRotationMount(velocity_deg_s=9000.0):
        pass


def test_nobody_on_the_bus() -> None:
    mount = SimulatedRotationMount(response_s=0.05)
    mount.inject("silence")
    with (
        pytest.raises(DeviceError, match=ON + "does not answer: are its supply, node number and bit rate right"),
        mount,
    ):
        pass


def test_a_fault_that_cannot_be_reset() -> None:
    mount = SimulatedRotationMount(timeout_s=0.05)
    mount.inject("broken")
    with pytest.raises(DeviceError, match=ON + "is in a fault that cannot be reset: fault: fault of the power"), mount:
        pass


def test_a_fault_from_before_is_reset_and_told(caplog: pytest.LogCaptureFixture) -> None:
    mount = SimulatedRotationMount()
    mount.inject("overheating")
    with caplog.at_level(logging.WARNING, "pipeline"), mount:
        assert mount.move_to(0.2) == pytest.approx(0.2, abs=1e-5)
    assert "a fault from before was reset: fault: excess temperature of the drive" in caplog.text


def test_no_later_move_goes_on_after_a_fault() -> None:
    with SimulatedRotationMount() as mount:
        mount.inject("overheating")
        for _ in range(2):
            with pytest.raises(DeviceError, match="excess temperature"):
                mount.move_to(0.2)
        assert mount.shaft_rad == 0.0


def test_an_interrupted_move_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    with SimulatedRotationMount(**SLOW) as mount:
        listen = type(mount._mount._axis._drive).listen

        def interrupt(axis: object) -> None:
            listen(axis)
            if mount.shaft_rad > np.deg2rad(3):
                raise KeyboardInterrupt

        monkeypatch.setattr("pipeline.devices.canopen_drive.Drive.listen", interrupt)
        with pytest.raises(KeyboardInterrupt):
            mount.move_to(np.deg2rad(30))
        assert 3 < at_rest(mount) < 25
        assert mount.drive.state == "switch on disabled"


@pytest.mark.parametrize(("interface", "channel"), [("socketcan", "can-none"), ("slcan", "/dev/none"), ("none", "x")])
def test_a_bus_that_cannot_be_opened(interface: str, channel: str) -> None:
    words = rf"rotation mount \(node 1 on {channel}\): the {interface} bus cannot be opened: .{{5}}"
    with pytest.raises(DeviceError, match=words), CanopenRotationMount(interface=interface, channel=channel):
        pass


def test_a_bus_that_fails_in_use(drive: SimulatedDrive) -> None:
    with CanopenRotationMount(interface="virtual", channel=drive.channel) as mount:
        mount._axis._drive._network.bus.shutdown()
        with pytest.raises(DeviceError, match=r"the bus failed: Cannot operate on a closed bus"):
            mount.move_to(0.1)


def test_a_node_that_is_no_drive() -> None:
    with can.Bus(interface="virtual", channel="no drive") as bus:

        def answer() -> None:
            if bus.recv(2.0):
                bus.send(
                    can.Message(arbitration_id=0x581, data=bytes.fromhex("4300100091010f00"), is_extended_id=False)
                )

        thread = threading.Thread(target=answer)
        thread.start()
        words = "is no CiA 402 drive: it says that its device profile is 401"
        with pytest.raises(DeviceError, match=words), CanopenRotationMount(interface="virtual", channel="no drive"):
            pass
        thread.join()


def test_there_are_no_other_faults() -> None:
    with pytest.raises(ValueError, match="there is no fault 'rust', only jam, stall"):
        SimulatedRotationMount().inject("rust")  # type: ignore[arg-type]


# On the wire


def test_what_goes_over_the_wire_is_cia_402() -> None:
    mount = SimulatedRotationMount(heartbeat_s=0)
    with mount, can.Bus(interface="virtual", channel=mount.drive.channel) as spy:
        mount.move_to(np.deg2rad(90))
        frames = []
        while frame := spy.recv(0):
            frames.append((frame.arbitration_id, frame.data.hex(" ")))
    written = [data for identifier, data in frames if identifier == 0x601 and data[0] == "2"]
    assert written == [
        "23 7a 60 00 90 5f 01 00",  # target position 90 000
        "2b 40 60 00 3f 00 00 00",  # enable operation, new set-point, at once
        "2b 40 60 00 0f 00 00 00",  # take the set-point back once it is acknowledged
    ]
    assert (0x581, "60 7a 60 00 00 00 00 00") in frames  # confirmed
    assert frames[-1] == (0x581, "43 64 60 00 90 5f 01 00")  # actual position 90 000


def test_an_emergency_comes_unasked_and_is_taken_back_by_the_reset(drive: SimulatedDrive) -> None:
    with can.Bus(interface="virtual", channel=drive.channel) as spy, requests(drive) as sdo:
        drive.inject("overheating")
        assert spy.recv(1.0).data.hex(" ") == "10 42 09 00 00 00 00 00"
        assert (sdo["Error code"].raw, sdo["Error register"].raw, sdo[0x1003][1].raw) == (0x4210, 9, 0x4210)
        sdo["Controlword"].raw = 0x80
        frames = [spy.recv(0.1) for _ in range(9)]
        assert b"\0" * 8 in [bytes(frame.data) for frame in frames if frame and frame.arbitration_id == 0x81]
        assert (sdo["Error code"].raw, sdo["Error register"].raw) == (0, 0)
        assert drive.state == "switch on disabled"


def test_the_heartbeat_beats_in_real_time(drive: SimulatedDrive) -> None:
    with can.Bus(interface="virtual", channel=drive.channel) as spy, requests(drive) as sdo:
        sdo["Producer heartbeat time"].raw = 10
        beats = []
        while len(beats) < 3:
            frame = spy.recv(1.0)
            assert frame is not None
            beats += [frame.data.hex()] * (frame.arbitration_id == 0x701)
    assert beats == ["7f"] * 3  # pre-operational


# The drive's states


@pytest.mark.parametrize(
    ("words", "states"),
    [
        ([0x06, 0x07, 0x0F], ["ready to switch on", "switched on", "operation enabled"]),
        ([0x06, 0x0F], ["ready to switch on", "operation enabled"]),
        ([0x0F, 0x07], ["switch on disabled", "switch on disabled"]),
        ([0x06, 0x07, 0x06], ["ready to switch on", "switched on", "ready to switch on"]),
        ([0x06, 0x07, 0x0F, 0x07], ["ready to switch on", "switched on", "operation enabled", "switched on"]),
        ([0x06, 0x07, 0x02], ["ready to switch on", "switched on", "switch on disabled"]),
        ([0x06, 0x0F, 0x00], ["ready to switch on", "operation enabled", "switch on disabled"]),
        ([0x06, 0x0F, 0x02], ["ready to switch on", "operation enabled", "switch on disabled"]),
    ],
)
def test_the_transitions_of_the_standard(drive: SimulatedDrive, words: list[int], states: list[str]) -> None:
    seen = []
    with requests(drive) as sdo:
        for word in words:
            sdo["Controlword"].raw = word
            assert state_of(sdo["Statusword"].raw) == drive.state
            seen.append(drive.state)
    assert seen == states


def test_a_quick_stop_may_be_told_to_hold_and_to_go_on(drive: SimulatedDrive) -> None:
    with requests(drive) as sdo:
        sdo["Quick stop option code"].raw = 6
        for word in (0x06, 0x0F, 0x02):
            sdo["Controlword"].raw = word
        assert state_of(sdo["Statusword"].raw) == "quick stop active"
        sdo["Controlword"].raw = 0x0F
        assert drive.state == "operation enabled"


def test_halt_holds_and_going_on_reaches_the_target() -> None:
    drive = SimulatedDrive(channel="halt")
    drive.start()
    with requests(drive) as sdo:
        sdo["Modes of operation"].raw = 1
        sdo["Target position"].raw = 4000
        sdo["Profile velocity"].raw = 20_000
        for word in (0x06, 0x0F, 0x3F, 0x10F):
            sdo["Controlword"].raw = word
        time.sleep(0.25)
        held = sdo["Position actual value"].raw
        assert 0 <= held < 4000
        assert sdo["Velocity actual value"].raw == 0
        sdo["Controlword"].raw = 0x0F
        time.sleep(0.5)
        assert sdo["Position actual value"].raw == 4000
        sdo["Target position"].raw = -500
        sdo["Controlword"].raw = 0x7F  # relative to the target
        time.sleep(0.3)
        assert sdo["Position actual value"].raw == 3500
    drive.stop()


def test_other_modes_are_refused(drive: SimulatedDrive) -> None:
    with requests(drive) as sdo, pytest.raises(canopen.SdoAbortedError, match="0x06090031"):
        sdo["Modes of operation"].raw = 6


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
        (0x0064, "unknown (0x0064)"),
    ],
)
def test_statuswords_by_the_masks_of_the_standard(word: int, state: str) -> None:
    assert state_of(word) == state


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0x2310, "continuous over-current (error code 0x2310)"),
        (0x4299, "temperature (error code 0x4299)"),
        (0x0001, "error reset / no error (error code 0x0001)"),
    ],
)
def test_emergencies_in_words(code: int, words: str) -> None:
    assert emergency_text(code) == words


def test_the_object_dictionary_lists_what_it_holds() -> None:
    from configparser import RawConfigParser

    eds = RawConfigParser()
    eds.read(EDS)
    listed = {
        int(eds[part][str(1 + i)], 0)
        for part in ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects")
        for i in range(int(eds[part]["SupportedObjects"]))
    }
    assert listed == set(canopen.import_od(str(EDS), 1))
    assert {0x1000, 0x1001, 0x1018} <= listed


# Motion

POSITIONS = st.floats(-1e6, 1e6)
LIMITS = st.floats(1.0, 1e6)


@given(
    start=POSITIONS, target=POSITIONS, velocity=LIMITS, acceleration=LIMITS, deceleration=LIMITS, share=st.floats(-2, 2)
)
def test_a_motion_keeps_its_limits_and_ends_at_rest_on_target(
    start: float, target: float, velocity: float, acceleration: float, deceleration: float, share: float
) -> None:
    motion = trapezoid(
        start,
        target,
        velocity=velocity,
        acceleration=acceleration,
        deceleration=deceleration,
        velocity_now=share * velocity,
    )
    scale = 1 + abs(start) + abs(target) + (share * velocity) ** 2 / deceleration
    assert motion.at(0.0)[0] == start
    assert motion.at(motion.seconds + 1) == pytest.approx((target, 0.0), abs=1e-9 * scale)
    times = np.linspace(0, motion.seconds, 101)
    places, speeds = np.array([motion.at(t) for t in times]).T
    assert np.abs(speeds).max() <= max(velocity, abs(share) * velocity) * (1 + 1e-9)
    step = motion.seconds / 100
    assert np.abs(np.diff(speeds)).max() <= max(acceleration, deceleration) * step * (1 + 1e-6) + 1e-6 * velocity
    trapezoids = (speeds[1:] + speeds[:-1]) / 2 * step
    bound = max(acceleration, deceleration) * step**2 / 4 + 1e-9 * scale
    assert np.abs(np.diff(places) - trapezoids).max() <= bound * (1 + 1e-6)


def test_the_least_time_is_that_of_the_closed_form() -> None:
    whole = trapezoid(0, 15, velocity=20, acceleration=100, deceleration=100)
    assert whole.seconds == pytest.approx(15 / 20 + 20 / 100)
    short = trapezoid(0, -1, velocity=20, acceleration=100, deceleration=100)
    assert short.seconds == pytest.approx(2 * np.sqrt(1 / 100))
    assert braking(3, -20, 100).at(1.0) == (pytest.approx(3 - 20**2 / 200), 0.0)


def test_an_interrupted_move_stops_on_the_way() -> None:
    mount = SimulatedRotationMount(time_scale=1.0, velocity_deg_s=20.0)
    with mount:
        timer = threading.Timer(0.5, progress.stop)
        timer.start()
        try:
            with pytest.raises(progress.Stopped):
                mount.move_to(np.pi / 2)
        finally:
            timer.join()
            progress.go_on()
        before = mount.shaft_rad
        time.sleep(0.2)
        assert mount.shaft_rad == pytest.approx(before, abs=1e-4)
        assert 0 < np.rad2deg(before) < 60
    with mount:
        assert mount.move_to(0.1) == pytest.approx(0.1, abs=1e-3)


def test_an_axis_that_stands_elsewhere_than_it_says_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    with SimulatedRotationMount() as mount:
        read = Drive.read

        def shifted(drive: Drive, entry: Any) -> int:
            return read(drive, entry) + (5000 if entry.name == "actual position" else 0)

        monkeypatch.setattr(Drive, "read", shifted)
        with pytest.raises(DeviceError, match=r"says that it reached .* but stands at"):
            mount.move_to(0.5)
