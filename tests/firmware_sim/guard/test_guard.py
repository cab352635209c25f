"""The guard judges the same in C and in Python, and as its table says."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from guard_in_c import FLAGS, SOURCE, SOURCES, GuardInC
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_sim.guard.devices_heard import OLDEST
from firmware_sim.guard.parameters import STREAMS, GuardParameters, guard_parameters
from firmware_sim.guard.reference import Guard, Reason
from utank_hil.canbus import (
    Address,
    ControlWord,
    DriveState,
    DriveStatus1,
    Frame,
    HardwiredInputs,
    Mode,
    OperatorCommand,
    PumpCommand,
    Quality,
    SensorMotion,
    SensorPump,
    SensorTank,
    Switch,
    load_catalogue,
)
from utank_hil.canbus.e2e import profile2_crc
from utank_hil.canbus.profiles.guarded import Stream
from utank_hil.configuration import ControllerConfig, load_config

CATALOGUE = load_catalogue()
PATTI = load_config("configs/controllers/patti_b_constrained_gpc.yaml", ControllerConfig)
TABLE = guard_parameters(PATTI)
PAIRS = replace(PATTI.vessel.redundancy, second_motion_sensor=True, second_station=True)
OF_TWO = guard_parameters(
    PATTI.model_copy(
        update={
            "vessel": PATTI.vessel.model_copy(update={"redundancy": PAIRS}),
            "safety": replace(PATTI.safety, motion_2_age_ms=150.0),
        }
    )
)
"""With a second station and a second, slower motion sensor."""
OFF = Switch.OFF
SOUND: dict[Stream, Any] = {
    Stream.COMMAND: PumpCommand(0.0, ControlWord.ENABLE_OPERATION, 0.05),
    Stream.DRIVE: DriveStatus1(
        0.0, 0.0, DriveState.OPERATION_ENABLED, 0, False, False, False, False
    ),
    Stream.MOTION: SensorMotion(0.0, 0.0, Quality.GOOD),
    Stream.TANK: SensorTank(0.0, 0.0, OFF, OFF, Quality.GOOD),
    Stream.PUMP: SensorPump(0.0, 0.0, Quality.GOOD),
    Stream.ORDER: OperatorCommand(Mode.ACTIVE, False, False, False, False),
    Stream.HARDWIRED: HardwiredInputs(OFF, OFF, OFF, Quality.GOOD),
}


class Bench:
    """Both guards, which are to agree, and what is sent to them every 20 ms."""

    def __init__(self, folder: Path, table: GuardParameters = TABLE) -> None:
        self.guards = Guard(table), GuardInC(table, folder)
        self.senders = {
            stream: CATALOGUE.transmitter(kind, source)
            for stream, (kind, source) in zip(Stream, STREAMS, strict=True)
        }
        self.says = dict(SOUND)

    def send(self, frame: Frame) -> None:
        self.guards[0].receive(frame)
        self.guards[1].receive(frame.can_id, frame.data)

    def say(self, stream: Stream, **changes: Any) -> None:
        self.says[stream] = self.says[stream]._replace(**changes)

    def tick(self) -> int:
        python, in_c = self.guards
        reasons = python.tick()
        assert in_c.tick() == reasons
        in_c.agrees(python)
        return reasons

    def run(self, ticks: int, without: Iterable[Stream] = ()) -> int:
        """Reasons of the last tick."""
        reasons = 0
        for index in range(ticks):
            if index % 2 == 0:
                for stream, message in self.says.items():
                    if stream not in without:
                        self.send(self.senders[stream].frame(message))
            reasons = self.tick()
        return reasons

    def press(self, pressure_pa: float) -> None:
        """Arm, and command a pressure that the pump follows."""
        self.run(4)
        self.say(Stream.ORDER, arm=True)
        for share in range(1, 51):
            pressure = pressure_pa * share / 50
            self.say(Stream.COMMAND, pressure_pa=pressure)
            self.say(Stream.DRIVE, pressure_pa=pressure)
            self.say(Stream.PUMP, pressure_pa=pressure)
            assert self.run(2) == 0


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("guard")


@pytest.fixture
def bench(folder: Path) -> Bench:
    return Bench(folder)


def test_it_allows_once_all_was_heard_and_what_is_armed_may_press(bench: Bench) -> None:
    assert bench.tick() == Reason.WAITING
    assert bench.run(10, without=[Stream.TANK]) == Reason.WAITING
    bench.press(15e3)
    assert bench.run(200) == 0


@pytest.mark.parametrize(
    ("stream", "changes", "reason", "within"),
    [
        (Stream.ORDER, {"stop": True}, Reason.STOP, 1),
        (Stream.HARDWIRED, {"stop_loop": Switch.ON}, Reason.STOP, 1),
        (Stream.HARDWIRED, {"stop_loop": None}, Reason.STOP, 1),
        (Stream.ORDER, {"arm": False}, Reason.DISARMED, 122),
        (Stream.ORDER, {"mode_request": Mode.PASSIVE}, Reason.DISARMED, 122),
        (Stream.ORDER, {"mode_request": None}, Reason.DISARMED, 122),
        (Stream.COMMAND, {"pressure_pa": 20_500.0}, Reason.COMMANDED, 1),
        (Stream.COMMAND, {"pressure_pa": -10e3}, Reason.COMMANDED, 1),
        (Stream.DRIVE, {"pressure_pa": -4e3}, Reason.PRESSURE, 62),
        (Stream.PUMP, {"pressure_pa": 16e3}, Reason.PRESSURE, 62),
        (Stream.TANK, {"port_high": Switch.ON}, Reason.LEVEL, 12),
        (Stream.TANK, {"starboard_high": None}, Reason.LEVEL, 12),
        (Stream.HARDWIRED, {"port_high": Switch.ERROR}, Reason.LEVEL, 12),
        (Stream.TANK, {"port_level_m": -1.98, "starboard_level_m": 1.98}, Reason.LEVEL, 12),
        (Stream.MOTION, {"roll_rad": -0.2}, Reason.ROLL, 12),
        (Stream.MOTION, {"roll_rate_rad_s": 0.3}, Reason.ROLL, 12),
        (Stream.MOTION, {"roll_rad": 0.15}, Reason.ROLL, 6500),
    ],
)
def test_each_reason_is_found_in_its_time(
    bench: Bench, stream: Stream, changes: dict[str, Any], reason: Reason, within: int
) -> None:
    bench.press(10e3)
    bench.say(stream, **changes)
    if within > 1:
        assert bench.run(min(within // 2, 60) - within // 2 % 2) == 0
    assert bench.run(within) & reason


@pytest.mark.parametrize("stream", SOUND)
def test_what_is_silent_under_pressure_cuts(bench: Bench, stream: Stream) -> None:
    bench.press(10e3)
    patience = TABLE.messages[stream].patience
    assert bench.run(patience - 3, without=[stream]) == 0
    assert bench.run(10, without=[stream]) & Reason.SILENT


@pytest.mark.parametrize("stream", [Stream.MOTION, Stream.TANK, Stream.PUMP, Stream.HARDWIRED])
def test_a_degraded_measurement_counts_and_a_bad_one_does_not(bench: Bench, stream: Stream) -> None:
    bench.press(10e3)
    patience = TABLE.messages[stream].patience
    bench.say(stream, quality=Quality.DEGRADED)
    assert bench.run(patience + 20) == 0
    bench.say(stream, quality=Quality.BAD)
    assert bench.run(patience + 20) & Reason.SILENT


def test_a_sender_that_begins_anew_counts_from_its_third_frame_in_sequence(bench: Bench) -> None:
    bench.press(10e3)
    bench.senders[Stream.MOTION].counter += 8
    bench.say(Stream.MOTION, roll_rad=0.05)
    rolls = []
    for _ in range(4):
        bench.run(2)
        rolls.append(bench.guards[0]._roll)
    assert rolls == [0, 0, 500, 500]
    # what was awaited before the last frame that counted is awaited no more
    bench.run(8)
    bench.senders[Stream.MOTION].counter -= 5
    bench.say(Stream.MOTION, roll_rad=0.0)
    for _ in range(4):
        bench.run(2)
        rolls.append(bench.guards[0]._roll)
    assert rolls[4:] == [500, 500, 0, 0]
    assert bench.run(TABLE.messages[Stream.MOTION].patience + 20) == 0


def test_a_pump_that_is_off_and_a_saturated_one_are_let_on(bench: Bench) -> None:
    bench.press(15e3)
    bench.say(Stream.DRIVE, pressure_pa=6e3)
    bench.say(Stream.PUMP, pressure_pa=6e3)
    assert bench.run(300) == 0


def test_a_cut_stays_until_a_reset_and_then_nothing_is_armed(bench: Bench) -> None:
    bench.press(10e3)
    bench.say(Stream.HARDWIRED, stop_loop=Switch.ON)
    assert bench.run(2) == Reason.STOP
    bench.say(Stream.COMMAND, pressure_pa=0.0)
    bench.say(Stream.DRIVE, pressure_pa=0.0, state=DriveState.SWITCH_ON_DISABLED)
    bench.say(Stream.PUMP, pressure_pa=0.0)
    bench.say(Stream.ORDER, reset=True)
    assert bench.run(2) == Reason.STOP  # its cause still holds
    bench.say(Stream.ORDER, reset=False)
    bench.say(Stream.HARDWIRED, stop_loop=OFF)
    assert bench.run(20) == Reason.STOP
    bench.say(Stream.ORDER, reset=True)
    assert bench.run(2) == 0
    bench.say(Stream.DRIVE, state=DriveState.OPERATION_ENABLED)
    bench.say(Stream.COMMAND, pressure_pa=500.0)  # the arm bit is still set, and no edge came
    assert bench.run(124) == Reason.DISARMED


def test_a_loop_that_a_bad_frame_called_open_is_open_until_a_good_one(bench: Bench) -> None:
    bench.run(4)
    for quality, stop_loop, left in (
        (Quality.BAD, Switch.ON, Reason.STOP),
        (Quality.BAD, OFF, Reason.STOP),
        (Quality.GOOD, OFF, 0),
    ):
        bench.say(Stream.HARDWIRED, quality=quality, stop_loop=stop_loop)
        assert bench.run(2) == Reason.STOP
        bench.say(Stream.ORDER, reset=True)
        assert bench.run(2, without=[Stream.HARDWIRED]) == left
        bench.say(Stream.ORDER, reset=False)


def test_a_disarm_out_of_sequence_acts_and_no_frame_out_of_sequence_arms(bench: Bench) -> None:
    bench.press(10e3)
    sender = CATALOGUE.transmitter(OperatorCommand)
    sender.counter = bench.senders[Stream.ORDER].counter + 8
    bench.send(sender.frame(SOUND[Stream.ORDER]))
    assert bench.run(124) == Reason.DISARMED


def test_pressure_that_comes_long_after_a_disarm_is_cut_at_once(bench: Bench) -> None:
    for pressure_pa, ticks in ((0.0, 130), (500.0, 1)):
        for stream in (Stream.COMMAND, Stream.DRIVE, Stream.PUMP):
            bench.say(stream, pressure_pa=pressure_pa)
        reasons = bench.run(ticks)
    assert reasons == Reason.DISARMED


def test_a_mode_that_is_asked_for_again_with_the_arm_bit_held_arms_nothing(bench: Bench) -> None:
    """As the controller, docs/safety.md: arming needs a rising edge of the arm bit."""
    bench.press(10e3)
    for mode in (Mode.STANDBY, Mode.ACTIVE):
        bench.say(Stream.ORDER, mode_request=mode)
        assert bench.run(4) == 0
    assert bench.run(124) == Reason.DISARMED
    bench.say(Stream.COMMAND, pressure_pa=0.0)
    for stream in (Stream.DRIVE, Stream.PUMP):
        bench.say(stream, pressure_pa=0.0)
    bench.say(Stream.ORDER, mode_request=Mode.PASSIVE, arm=False)
    bench.run(100)
    bench.say(Stream.ORDER, reset=True)
    assert bench.run(4) == 0
    # nor does the bit in another mode, whichever comes after it
    bench.say(Stream.ORDER, arm=True, reset=False)
    bench.run(4)
    bench.say(Stream.ORDER, mode_request=Mode.ACTIVE)
    bench.run(4)
    bench.say(Stream.COMMAND, pressure_pa=500.0)
    assert bench.run(124) == Reason.DISARMED


def test_a_second_station_arms_only_where_it_is_declared(folder: Path) -> None:
    for declared in (0, 1):
        bench = Bench(folder, OF_TWO if declared else TABLE)
        bench.says[Stream.ORDER_2] = SOUND[Stream.ORDER]
        bench.run(4)
        bench.say(Stream.ORDER_2, arm=True)
        bench.run(2)
        bench.say(Stream.COMMAND, pressure_pa=500.0)
        assert bench.run(130) == (0 if declared else Reason.DISARMED)


def test_of_two_motion_sensors_each_is_judged_by_its_own_age(folder: Path) -> None:
    patience = [OF_TWO.messages[each].patience for each in (Stream.MOTION, Stream.MOTION_2)]
    assert patience == [34, 45]
    both = [Stream.MOTION, Stream.MOTION_2]
    for lost, after in (([], patience[1]), (both[1:], patience[0])):  # the slow one gone before
        bench = Bench(folder, OF_TWO)
        bench.says[Stream.MOTION_2] = SOUND[Stream.MOTION]
        bench.press(500.0)
        assert bench.run(100, lost) == 0  # the last frame is two ticks old
        assert bench.run(after - 2, both) == 0
        assert bench.run(1, both) == Reason.SILENT


def test_a_second_motion_sensor_that_is_not_declared_stands_for_none(folder: Path) -> None:
    bench = Bench(folder)
    bench.says[Stream.MOTION_2] = SOUND[Stream.MOTION]
    bench.press(500.0)
    assert bench.run(TABLE.messages[Stream.MOTION].patience + 4, [Stream.MOTION]) == Reason.SILENT


@pytest.mark.parametrize("station", [Stream.ORDER, Stream.ORDER_2])
def test_what_was_pressed_before_the_first_frame_is_no_edge(folder: Path, station: Stream) -> None:
    bench = Bench(folder, OF_TWO)
    bench.says[station] = SOUND[Stream.ORDER]._replace(arm=True, reset=True)
    bench.send(
        CATALOGUE.transmitter(HardwiredInputs).frame(
            SOUND[Stream.HARDWIRED]._replace(stop_loop=Switch.ON)
        )
    )
    assert bench.tick() & Reason.STOP
    assert bench.run(10) == Reason.STOP | Reason.WAITING
    bench = Bench(folder, OF_TWO)
    bench.says[station] = SOUND[Stream.ORDER]._replace(arm=True)
    bench.run(4)
    bench.say(Stream.COMMAND, pressure_pa=500.0)
    assert bench.run(130) == Reason.DISARMED


@pytest.mark.parametrize("way", [-1, 1])
@pytest.mark.parametrize(
    ("stream", "name", "unit", "most", "reason"),
    [
        (Stream.MOTION, "roll_rad", 1e-4, TABLE.roll, Reason.ROLL),
        (Stream.MOTION, "roll_rate_rad_s", 3.125e-5, TABLE.roll_rate, Reason.ROLL),
        (Stream.TANK, "port_level_m", 1e-3, TABLE.level, Reason.LEVEL),
        (Stream.TANK, "starboard_level_m", 1e-3, TABLE.level, Reason.LEVEL),
        (Stream.DRIVE, "pressure_pa", 8.0, TABLE.error, Reason.PRESSURE),
        (Stream.PUMP, "pressure_pa", 8.0, TABLE.error, Reason.PRESSURE),
    ],
)
def test_a_limit_itself_is_no_reason(
    folder: Path, way: int, stream: Stream, name: str, unit: float, most: int, reason: Reason
) -> None:
    for beyond, without in product((0, 1), ([], [Stream.COMMAND])):
        bench = Bench(folder)
        bench.run(4)
        bench.say(stream, **{name: way * unit * (most + beyond)})
        assert bench.run(90, without) == reason * beyond


@pytest.mark.parametrize("way", [-1, 1])
def test_a_heel_at_its_limit_is_no_reason(folder: Path, way: int) -> None:
    for beyond in (0, 1):
        bench = Bench(folder)
        bench.say(Stream.MOTION, roll_rad=way * 1e-4 * TABLE.heel)
        bench.run(4)
        bench.guards[0]._heel = heel = way * (TABLE.heel * 4096 + beyond)
        bench.guards[1].put("heel", heel)
        assert bench.run(4) == Reason.ROLL * beyond


@pytest.mark.parametrize("way", [-1, 1])
@pytest.mark.parametrize("silent", [False, True])
def test_a_rotor_that_is_free_may_press_by_the_level(folder: Path, way: int, silent: bool) -> None:
    for beyond in (0, 1):
        bench = Bench(folder)
        bench.say(Stream.TANK, port_level_m=-1.7 * way)
        bench.say(Stream.DRIVE, state=DriveState.SWITCHED_ON)
        bench.run(4)
        most = TABLE.error + 1700 * TABLE.free_rotor // 2000
        bench.say(Stream.PUMP, pressure_pa=8.0 * way * (most + beyond))
        without = [Stream.DRIVE] if silent else []
        bench.run(TABLE.messages[Stream.DRIVE].patience + 4, without)
        assert bench.run(70, without) & Reason.PRESSURE == Reason.PRESSURE * beyond


@pytest.mark.parametrize("state", DriveState)
def test_a_drive_that_gives_no_torque_may_be_commanded_unarmed(
    bench: Bench, state: DriveState
) -> None:
    bench.run(4)
    bench.say(Stream.DRIVE, state=state)
    bench.say(Stream.COMMAND, pressure_pa=500.0)
    live = state in (
        DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE,
        DriveState.FAULT_REACTION_ACTIVE,
    )  # fmt: skip
    assert bench.run(130) == (Reason.DISARMED if live else 0)


@pytest.mark.parametrize("after", range(0, 60, 7))
@pytest.mark.parametrize("way", [-1, 1])
def test_a_pump_that_stays_where_it_was_commanded_is_found_in_less_than_two_seconds(
    bench: Bench, way: int, after: int
) -> None:
    bench.press(way * 10e3)
    bench.run(after)
    bench.say(Stream.COMMAND, pressure_pa=0.0)
    assert bench.run(90) == 0
    assert bench.run(34) == Reason.PRESSURE


@pytest.mark.parametrize("way", [-1, 1])
def test_a_command_that_is_old_is_none(folder: Path, way: int) -> None:
    for begin in range(32):  # wherever in its window
        bench = Bench(folder)
        for _ in range(begin):
            bench.tick()
        bench.press(way * 10e3)
        both = Reason.PRESSURE | Reason.SILENT
        assert bench.run(140, without=[Stream.COMMAND]) & both == both


@pytest.mark.parametrize("way", [-1, 1])
@pytest.mark.parametrize("stream", [Stream.DRIVE, Stream.PUMP])
def test_between_zero_and_the_command_a_pump_may_press_as_it_likes(
    folder: Path, way: int, stream: Stream
) -> None:
    ends = {250 + TABLE.error: 0, 251 + TABLE.error: 1, -TABLE.error: 0, -TABLE.error - 1: 1}
    for counts, beyond in ends.items():
        bench = Bench(folder)
        bench.press(way * 2e3)
        bench.say(stream, pressure_pa=8.0 * way * counts)
        assert bench.run(130) == Reason.PRESSURE * beyond


@pytest.mark.parametrize("way", [-1, 1])
@pytest.mark.parametrize(("every", "reason"), [(78, 0), (92, 0), (130, Reason.PRESSURE)])
def test_a_pump_that_is_commanded_there_now_and_then_is_let_be(
    folder: Path, way: int, every: int, reason: int
) -> None:
    """The last 30 to 60 ticks of commands count, and 60 without are too many."""
    bench = Bench(folder, replace(TABLE, step=3000))
    bench.press(way * 10e3)
    for _ in range(12):
        bench.say(Stream.COMMAND, pressure_pa=way * 10e3)
        bench.run(2)
        bench.say(Stream.COMMAND, pressure_pa=0.0)
        found = bench.run(every - 2)
        assert found & ~Reason.DISARMED == reason or every == 92  # after a cut it is not armed


@pytest.mark.parametrize("way", [-1, 1])
@pytest.mark.parametrize(
    ("last", "asked", "lost", "bad"),
    [
        (0, 100, 0, False), (0, 101, 0, True),  # a step away from zero
        (300, 400, 0, False), (300, 401, 0, True),
        (0, 200, 1, False), (0, 201, 1, True), (0, 400, 3, False), (0, 401, 3, True),
        (300, 0, 0, False), (300, 1, 0, False), (300, 300, 0, False),  # toward it
        (300, -1, 0, True), (50, -50, 0, False), (60, -60, 0, True),
        (2450, 2500, 0, False), (2450, 2501, 0, True), (2600, 2501, 0, True),  # its limit
    ],
)  # fmt: skip
def test_a_command_may_fall_at_once_and_grow_by_its_rate_up_to_its_limit(
    folder: Path, way: int, last: int, asked: int, lost: int, bad: bool
) -> None:
    bench = Bench(folder, replace(TABLE, step=100, pressure=2500))
    bench.run(4)
    bench.guards[0]._command = way * last
    bench.guards[1].put("command", way * last)
    bench.senders[Stream.COMMAND].counter += lost
    bench.say(Stream.COMMAND, pressure_pa=8.0 * way * asked)
    assert bool(bench.run(2) & Reason.COMMANDED) is bad


def test_a_pressure_that_is_old_is_none(folder: Path) -> None:
    """It counts for ten ticks after it came."""
    found = []
    for ticks in range(44, 60):
        bench = Bench(folder)
        bench.run(4)
        bench.say(Stream.PUMP, pressure_pa=8.0 * (TABLE.error + 1))
        bench.run(ticks)
        found.append(bench.run(20, without=[Stream.PUMP]))
    assert found == [0] * 9 + [Reason.PRESSURE] * 7


@pytest.mark.parametrize("holds", [Stream.ORDER, Stream.ORDER_2])
def test_a_stop_that_one_station_holds_is_not_reset_at_the_other(
    folder: Path, holds: Stream
) -> None:
    bench = Bench(folder, OF_TWO)
    bench.says[Stream.ORDER_2] = SOUND[Stream.ORDER]
    bench.run(4)
    bench.say(holds, stop=True)
    assert bench.run(2) == Reason.STOP
    resets = Stream.ORDER_2 if holds is Stream.ORDER else Stream.ORDER
    bench.say(resets, reset=True)
    bench.send(bench.senders[resets].frame(bench.says[resets]))
    assert bench.tick() == Reason.STOP


_FRAMES = st.tuples(st.sampled_from(list(Stream)), st.binary(min_size=6, max_size=6))
_STEPS = st.one_of(
    st.tuples(st.just("sound"), st.integers(0, 130)),
    st.tuples(st.just("words"), _FRAMES),
    st.tuples(st.just("raw"), st.tuples(st.sampled_from(list(Stream)), st.binary(max_size=9))),
    st.tuples(st.just("skip"), st.tuples(st.sampled_from(list(Stream)), st.integers(1, 15))),
    st.tuples(st.just("tick"), st.integers(1, 40)),
    st.tuples(st.just("arm"), st.booleans()),
    st.tuples(st.just("press"), st.integers(-2600, 2600)),
)


@settings(max_examples=60, deadline=None)
@given(steps=st.lists(_STEPS, max_size=16), second=st.integers(0, 1))
def test_any_frames_are_judged_alike_in_both(
    folder: Path, steps: list[tuple[str, Any]], second: int
) -> None:
    bench = Bench(folder, OF_TWO if second else TABLE)
    bench.run(4)
    for kind, what in steps:
        if kind == "sound":
            bench.run(what)
        elif kind == "words":  # rightly protected, whatever it says
            stream, content = what
            sender = bench.senders[stream]
            sender.counter = (sender.counter + 1) & 15
            data = protected(stream, content[0] & 0xF0 | sender.counter, content)
            bench.send(Frame(sender.can_id, data))
        elif kind == "raw":
            bench.send(Frame(TABLE.messages[what[0]].can_id, what[1]))
        elif kind == "skip":
            bench.senders[what[0]].counter += what[1]
        elif kind == "tick":
            for _ in range(what):
                bench.tick()
        elif kind == "arm":
            bench.say(Stream.ORDER, arm=what)
        else:
            bench.say(Stream.COMMAND, pressure_pa=8.0 * what)
            bench.say(Stream.DRIVE, pressure_pa=8.0 * what)


def protected(stream: Stream, second: int, content: bytes) -> bytes:
    data = bytes((0, second)) + content
    return bytes((profile2_crc(data, TABLE.messages[stream].data_ids),)) + data[1:]


@pytest.mark.parametrize(
    ("stream", "quality", "words", "counts"),
    [
        *(
            (stream, 0, (32768 + sign * (31250 + beyond), 0), not beyond)
            for stream in (Stream.DRIVE, Stream.PUMP) for sign in (-1, 1) for beyond in (0, 1)
        ),
        (Stream.MOTION, 1, (0, 64000), True), (Stream.MOTION, 1, (64000, 0), True),
        (Stream.MOTION, 1, (0, 64001), False), (Stream.MOTION, 1, (64001, 0), False),
        (Stream.MOTION, 2, (0, 0), False), (Stream.PUMP, 1, (32768, 0), True),
        (Stream.PUMP, 2, (32768, 0), False),
        (Stream.TANK, 1, (2000, 2000), True), (Stream.TANK, 1, (62000, 62000), True),
        (Stream.TANK, 0, (1999, 2000), False), (Stream.TANK, 0, (2000, 1999), False),
        (Stream.TANK, 0, (62001, 62000), False), (Stream.TANK, 0, (62000, 62001), False),
        (Stream.TANK, 2, (32000, 32000), False),
    ],
)  # fmt: skip
def test_a_measurement_counts_within_its_range_and_quality(
    bench: Bench, stream: Stream, quality: int, words: tuple[int, int], counts: bool
) -> None:
    of_tank = stream is Stream.TANK
    content = b"".join(word.to_bytes(2, "little") for word in words) + bytes((quality * of_tank, 0))
    second = 0 if of_tank else quality << 4
    bench.send(Frame(TABLE.messages[stream].can_id, protected(stream, second, content)))
    assert (bench.guards[0]._age[stream] == 0) is counts
    bench.tick()


@pytest.mark.slow
def test_a_command_with_hardly_any_limit_of_its_rate_may_step_as_far_as_it_likes(
    folder: Path,
) -> None:
    fast = PATTI.model_copy(update={"limits": replace(PATTI.limits, rate_pa_s=1e12)})
    bench = Bench(folder, guard_parameters(fast))
    bench.press(15e3)
    bench.say(Stream.COMMAND, pressure_pa=-15e3)
    assert not bench.run(2) & Reason.COMMANDED


def test_a_guard_begins_in_its_own_memory_alone(tmp_path: Path) -> None:
    main = tmp_path / "main.c"
    main.write_text(
        '#include "guard.h"\n'
        "int main(void) {"
        " static struct guard two[2]; static struct guard_parameters table;"
        " guard_start(&two[1], &table); guard_start(&two[0], &table);"
        " return (two[1].parameters == &table) ? 0 : 1; }\n"
    )
    words = ["cc", f"-I{SOURCE}", main, *SOURCES, "-o", tmp_path / "main"]
    subprocess.run([str(word) for word in words], check=True)
    subprocess.run([tmp_path / "main"], check=True)


def test_an_age_is_held_at_its_end(bench: Bench) -> None:
    for _ in range(OLDEST + 3):
        bench.tick()
    assert bench.run(4) == 0


def test_the_header_compiles_into_a_freestanding_program(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "firmware_sim.guard", "configs/controllers/gpc.yaml"]
    made = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    (tmp_path / "guard_parameters.h").write_text(made)
    main = tmp_path / "main.c"
    main.write_text(
        '#include "guard_parameters.h"\n'
        "uint8_t run(struct guard *guard);\n"
        "uint8_t run(struct guard *guard) { guard_start(guard, &GUARD_PARAMETERS);"
        " return guard_tick(guard); }\n"
    )
    out = tmp_path / "all.o"
    subprocess.run(["cc", *FLAGS, f"-I{SOURCE}", "-c", main, "-o", out], check=True)
    subprocess.run(["cc", *FLAGS, "-r", "-nostdlib", *SOURCES, "-o", out], check=True)
    undefined = subprocess.run(["nm", "-u", out], capture_output=True, text=True, check=True)
    assert undefined.stdout.split() == []  # it calls nothing


def test_cppcheck_finds_no_breach_of_misra_c(tmp_path: Path) -> None:
    if shutil.which("cppcheck") is None:
        assert "UTANK_HIL_CI" not in os.environ, "cppcheck is missing: apt-get install cppcheck"
        pytest.skip("cppcheck is missing: apt-get install cppcheck")
    words = ["cppcheck", "--addon=misra", "--std=c99", "--enable=all", "--error-exitcode=1"]
    words += ["--quiet", "--suppress=missingIncludeSystem", "--suppress=unusedFunction"]
    seeded = tmp_path / "guard.c"  # that it would find one
    (tmp_path / "guard.h").write_bytes((SOURCE / "guard.h").read_bytes())
    text = (SOURCE / "guard.c").read_text()
    seeded.write_text(text.replace("> (limits->heel * HEEL_SCALE)", "> limits->heel * HEEL_SCALE"))
    breach = subprocess.run([*words, seeded], capture_output=True, text=True)
    assert breach.returncode == 1
    assert "misra-c2012-12.1" in breach.stderr
    result = subprocess.run([*words, *SOURCES], capture_output=True, text=True)
    assert (result.returncode, result.stderr) == (0, "")


@pytest.mark.parametrize(("change", "word"), [({"pump": None}, "no pump")])
def test_a_ship_without_a_pump_has_no_guard(change: dict[str, Any], word: str) -> None:
    config = PATTI.model_copy(update={"vessel": PATTI.vessel.model_copy(update=change)})
    with pytest.raises(ValueError, match=word):
        guard_parameters(config)


def test_the_streams_are_those_of_the_header() -> None:
    text = (SOURCE / "guard.h").read_text()
    for stream in Stream:
        assert f"#define GUARD_{stream.name} {stream.value}U\n" in text
    assert STREAMS[Stream.ORDER_2] == (OperatorCommand, Address.OPERATOR_2)
    for reason in Reason:
        assert f"#define GUARD_{reason.name} {reason.value}U" in text
