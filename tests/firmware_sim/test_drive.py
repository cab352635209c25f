import math
import re
from itertools import pairwise
from pathlib import Path

import pytest
from drive_bench import CATALOGUE, ENABLE, MS, DriveBench
from hypothesis import given
from hypothesis import strategies as st

from firmware_sim.drive import MISCODED_COMMANDS_TO_TRIP
from firmware_sim.scenario_sections import DriveLimits
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import (
    Address,
    AddressClaim,
    ControlWord,
    DriveFault,
    DriveState,
    DriveStatus2,
    Frame,
    Heartbeat,
    NodeState,
    PumpCommand,
)
from utank_hil.configuration import Vessel, load_config

START_NS = 5_123_456_789


def armed(pressure_pa: float = 20e3, start_ns: int = START_NS) -> DriveBench:
    bench = DriveBench(start_ns=start_ns)
    bench.enable()
    bench.drive_at(pressure_pa)
    assert bench.told.state is DriveState.OPERATION_ENABLED
    return bench


@pytest.mark.slow
def test_enabled_drive_brings_the_pump_to_the_commanded_pressure() -> None:
    bench = armed(20e3)
    for _ in range(50):
        bench.command(20e3)
        bench.ticks(2)
    assert bench.told.pressure_pa == pytest.approx(20e3, rel=0.02)
    assert bench.told.speed_rad_s > 0


def test_pressure_is_ignored_until_operation_is_enabled() -> None:
    bench = DriveBench()
    bench.tick()
    for word in ENABLE[:2]:
        for _ in range(20):
            bench.command(2000.0, word)
            bench.ticks(2)
            assert abs(bench.told.pressure_pa) <= 8.0
    assert bench.told.state is DriveState.SWITCHED_ON


@pytest.mark.parametrize("timeout_ms", [20, 50, 100])
@pytest.mark.parametrize("offset_ns", [0, 1, 4 * MS, TICK_NS - 1])
def test_set_point_is_zero_within_the_frames_own_timeout_and_one_tick(
    timeout_ms: int, offset_ns: int
) -> None:
    bench = armed()
    bench.now_ns += offset_ns  # frames come between the ticks
    bench.command(20e3, timeout_s=timeout_ms * 1e-3)
    last_ns = bench.now_ns
    bench.now_ns += TICK_NS - offset_ns
    while bench.told.state is DriveState.OPERATION_ENABLED:
        bench.tick()
        assert bench.now_ns - last_ns < 200 * MS
    assert bench.drive.setpoint_pa == 0.0
    tripped_ns = bench.sent_ns[-1]
    assert timeout_ms * MS < tripped_ns - last_ns <= timeout_ms * MS + TICK_NS
    assert bench.told.state is DriveState.FAULT_REACTION_ACTIVE
    bench.ticks(10)
    assert bench.told.state is DriveState.FAULT
    assert bench.status_2.fault is DriveFault.COMMAND_TIMEOUT


@pytest.mark.parametrize("pressure_pa", [5e3, 20e3, 45e3, -50e3])
@pytest.mark.parametrize("cause", ["silence", "quick stop"])
def test_stop_takes_the_pressure_away_with_the_motor(pressure_pa: float, cause: str) -> None:
    bench = armed(pressure_pa)
    for _ in range(100):
        bench.command(pressure_pa)
        bench.ticks(2)
    at_stop_pa = bench.plant.pressure_pa
    last_ns = bench.now_ns - 2 * TICK_NS
    if cause == "quick stop":
        bench.command(0.0, ControlWord.QUICK_STOP)
        last_ns = bench.now_ns
    left_pa = {}
    while bench.now_ns - last_ns < 600 * MS:
        bench.tick()
        left_pa[(bench.now_ns - TICK_NS - last_ns) // MS] = abs(bench.plant.pressure_pa)
    print(cause, [round(left_pa[ms]) for ms in (50, 80, 100, 110, 120, 130, 150, 200, 400)])
    # after a silence the timeout of 50 ms goes first; then a tick passes until the drive looks
    begun_ms = 60 if cause == "silence" else 0
    for braked_ms, share in ((0, 1.01), (20, 0.6), (40, 0.3), (60, 0.12), (80, 0.04)):
        left = left_pa[begun_ms + braked_ms]
        assert left < max(share * abs(at_stop_pa), 0.02 * DriveLimits().pressure_pa)
    # off, the rotor's inertia presses against the water, whose flow changes in seconds
    assert all(left < 3e3 for ms, left in left_pa.items() if ms > begun_ms + 80)
    assert bench.told.state in (DriveState.FAULT, DriveState.SWITCH_ON_DISABLED)


def test_motor_that_can_not_take_the_pressure_away_is_switched_off_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench = armed(20e3)
    monkeypatch.setattr(bench.plant, "brake_pump", lambda: None)
    bench.ticks(40)
    assert bench.told.state is DriveState.FAULT_REACTION_ACTIVE
    bench.ticks(20)
    assert bench.told.state is DriveState.FAULT


def test_commands_after_a_timeout_do_not_start_the_pump_again() -> None:
    bench = armed()
    bench.ticks(10)
    for _ in range(200):
        bench.command(0.0, ControlWord.ENABLE_OPERATION)
        bench.ticks(2)
        assert bench.told.state is DriveState.FAULT
    for word in (ControlWord.FAULT_RESET, *ENABLE[:2]):  # but an explicit reset and sequence do
        bench.command(0.0, word)
        bench.ticks(2)
    assert bench.told.state is DriveState.SWITCHED_ON


@pytest.mark.parametrize(
    "command",
    [
        pytest.param((50.1e3, 0.05), id="over the pressure limit"),
        pytest.param((-50.1e3, 0.05), id="under the pressure limit"),
        pytest.param((20e3 + 250e3 * 0.03 + 16, 0.05), id="over the rate limit"),
        pytest.param((-8.0, 0.05), id="through zero over the rate limit"),
        pytest.param((math.nan, 0.05), id="pressure not available"),
        pytest.param((20e3, math.nan), id="timeout not available"),
        pytest.param((20e3, 0.105), id="timeout too long"),
        pytest.param((20e3, 0.0), id="no timeout"),
    ],
)
def test_refused_command_changes_nothing_and_is_not_echoed(command: tuple[float, float]) -> None:
    bench = armed()
    bench.command(20e3)
    good = bench.commands.counter
    bench.ticks(2)
    pressure_pa, timeout_s = command
    bench.command(pressure_pa, timeout_s=timeout_s)
    bench.ticks(2)
    assert bench.drive.refused == 1
    assert bench.told.command_echo == good
    assert bench.told.state is DriveState.OPERATION_ENABLED
    # nor does it feed the timeout: 50 ms after the good one, 40 of which have passed
    bench.ticks(3)
    assert bench.told.state is DriveState.FAULT_REACTION_ACTIVE


STOPS = [ControlWord.QUICK_STOP, ControlWord.DISABLE_VOLTAGE, ControlWord.SHUTDOWN]


@pytest.mark.parametrize("word", STOPS)
def test_a_word_that_says_stop_stops_whatever_pressure_came_with_it(word: ControlWord) -> None:
    bench = armed(20e3)
    bench.command(math.nan, word)
    bench.tick()
    assert bench.told.state is not DriveState.OPERATION_ENABLED
    assert bench.drive.refused == 1


@pytest.mark.parametrize("lost", [3, 4, 12])
@pytest.mark.parametrize("word", STOPS)
def test_a_stop_out_of_sequence_is_heard_and_an_enable_is_not(lost: int, word: ControlWord) -> None:
    bench = armed(20e3)
    for _ in range(lost):
        bench.commands.frame(PumpCommand(20e3, ControlWord.ENABLE_OPERATION, 0.05))
    bench.command(20e3, word)
    bench.tick()
    assert bench.told.state is not DriveState.OPERATION_ENABLED
    bench = DriveBench()
    bench.enable()
    echo = bench.told.command_echo
    for _ in range(4):
        bench.commands.frame(PumpCommand(0.0, ControlWord.ENABLE_OPERATION, 0.05))
    bench.command(2000.0)
    bench.ticks(2)
    assert bench.told.command_echo == echo


PAGE = Path("docs/how-to/drive.md").read_text(encoding="utf-8")
STOP_ROWS = re.findall(r"^\| ([A-Z_]+) \| ([A-Z_]+) \| ([\d.]+) kPa \| ([\d.]+) s \|$", PAGE, re.M)


def test_the_page_for_makers_says_of_each_stop_word_what_it_does() -> None:
    assert {row[0] for row in STOP_ROWS} == {word.name for word in STOPS}
    assert "from 30 kPa" in PAGE


@pytest.mark.parametrize(("word", "state", "left_kpa", "five_percent_s"), STOP_ROWS)
def test_a_stop_word_brakes_or_not_as_the_page_for_makers_says(
    word: str, state: str, left_kpa: str, five_percent_s: str
) -> None:
    bench = armed(30e3)
    for _ in range(100):
        bench.command(30e3)
        bench.ticks(2)
    stopped_ns = bench.now_ns
    bench.command(0.0, ControlWord[word])
    bench.tick()
    assert bench.told.state is DriveState[state]
    left_pa = {0: 30e3}
    while (after_ms := (bench.now_ns - stopped_ns) // MS) <= 800:
        bench.tick()
        left_pa[after_ms] = abs(bench.plant.pressure_pa)
    assert left_pa[130] == pytest.approx(float(left_kpa) * 1e3, abs=100.0)
    assert bench.told.state is not DriveState.OPERATION_ENABLED
    little = [ms for ms, left in left_pa.items() if left < 0.05 * DriveLimits().pressure_pa]
    assert min(little) * 1e-3 == pytest.approx(float(five_percent_s), abs=0.011)
    assert (min(little) <= 130) is (word == "QUICK_STOP")


def test_status_can_say_the_power_of_every_shipped_pump() -> None:
    vessels = [load_config(file, Vessel) for file in Path("configs/ships").glob("*.yaml")]
    most_w = max(vessel.pump.max_power_w for vessel in vessels if vessel.pump is not None)
    assert most_w > 2e6
    for power_w in (most_w, -most_w):
        bench = DriveBench()
        bench.plant.pump_power_w = power_w  # stays for the first tick, in which it does not move
        bench.tick()
        said_w = bench.status_2.bus_voltage_v * bench.status_2.current_a
        assert said_w == pytest.approx(power_w, rel=1e-3)


def test_a_power_that_status_can_not_say_is_not_available() -> None:
    bench = DriveBench()
    bench.plant.pump_power_w = 5.3e6
    bench.tick()
    assert math.isnan(bench.status_2.current_a)


RATE_PA_S = DriveLimits().pressure_rate_pa_s


@given(st.lists(st.tuples(st.integers(0, 25), st.floats(-1e3, 5e3)), max_size=60))
def test_set_point_never_moves_faster_than_the_rate_and_a_tick_in_all(
    frames: list[tuple[int, float]],
) -> None:
    bench = DriveBench()
    bench.enable()
    bench.command(0.0)
    taken = [(bench.now_ns, 0.0)]
    for later_ms, step_pa in frames:
        bench.now_ns += later_ms * MS
        pressure_pa = 8.0 * round((taken[-1][1] + step_pa) / 8.0)
        bench.command(pressure_pa)
        if not bench.drive.refused:
            taken.append((bench.now_ns, pressure_pa))
        bench.drive.refused = 0
    for at, (begin_ns, begin_pa) in enumerate(taken):
        for end_ns, end_pa in taken[at:]:
            free_pa = abs(begin_pa)  # down to zero it may step
            allowed_pa = RATE_PA_S * (end_ns - begin_ns + TICK_NS) * 1e-9 + 8.0
            assert abs(end_pa - begin_pa) <= free_pa + allowed_pa + 1e-6
            if begin_pa * end_pa >= 0:
                assert abs(end_pa) - abs(begin_pa) <= allowed_pa + 1e-6


@pytest.mark.parametrize("silent_s", [0.2, 10.0])
def test_a_silence_before_it_was_enabled_gives_no_room_for_a_step(silent_s: float) -> None:
    bench = DriveBench(start_ns=START_NS)
    bench.ticks(2)
    for word in ENABLE[:2]:
        bench.command(0.0, word)
        bench.ticks(2)
    bench.ticks(round(silent_s / 0.01))  # only an enabled drive minds
    bench.command(4e3, ENABLE[2])  # 2.5 kPa are a tick's worth
    bench.tick()
    assert bench.drive.refused == 1
    assert bench.drive.setpoint_pa == 0.0
    bench.command(2.5e3, ENABLE[2])
    bench.tick()
    assert bench.drive.setpoint_pa == pytest.approx(2.5e3, abs=8.0)


@pytest.mark.parametrize("count", [3, 40])
def test_commands_to_a_drive_that_is_off_leave_nothing_to_pay_when_it_is_on(count: int) -> None:
    bench = DriveBench(start_ns=START_NS)
    bench.ticks(2)
    for word in (ENABLE[2], ENABLE[1]):
        for _ in range(count):
            bench.command(30e3, word)
            bench.ticks(2)
    for word in ENABLE[:2]:
        bench.command(30e3, word)
        bench.ticks(2)
    bench.command(0.0)
    bench.ticks(2)
    bench.drive_at(20e3, 4e3)  # 200 kPa/s of 250
    assert bench.drive.refused == 0
    assert bench.told.state is DriveState.OPERATION_ENABLED


@pytest.mark.parametrize("lost", [0, 7])
def test_an_unknown_word_switches_it_off_whatever_pressure_came_with_it(lost: int) -> None:
    bench = armed()
    for _ in range(lost):
        bench.commands.frame(PumpCommand(0.0, ENABLE[2], 0.05))
    unknown = PumpCommand(math.nan, None, 0.05)  # type: ignore[arg-type]
    bench.drive.receive(bench.commands.frame(unknown), bench.now_ns)
    bench.tick()
    assert bench.told.state is DriveState.SWITCH_ON_DISABLED


def test_the_pressure_limit_holds_for_a_step_that_the_rate_allows() -> None:
    limit_pa = DriveLimits().pressure_pa
    for sign in (1, -1):
        bench = armed(sign * limit_pa)
        bench.command(sign * (limit_pa + 8.0))
        assert bench.drive.refused == 1
        assert bench.drive.setpoint_pa == sign * limit_pa


@pytest.mark.parametrize("end", ["silence", "quick stop", "disable voltage", "fault"])
def test_whatever_ends_it_no_set_point_is_left(end: str) -> None:
    bench = armed(20e3)
    assert bench.drive.setpoint_pa == 20e3
    assert bench.drive.enabled
    if end == "silence":
        bench.ticks(6)
    elif end == "fault":
        bench.drive.fail(DriveFault.OVERCURRENT)
    else:
        bench.command(20e3, ControlWord[end.upper().replace(" ", "_")])
    bench.tick()
    assert bench.drive.setpoint_pa == 0.0
    assert not bench.drive.enabled
    tripped = end in ("silence", "fault")
    assert (bench.told.state is DriveState.FAULT_REACTION_ACTIVE) is tripped


@pytest.mark.parametrize("wrong", ["refused", "out of sequence"])
def test_only_a_good_command_enables(wrong: str) -> None:
    bench = DriveBench()
    bench.ticks(2)
    for word in ENABLE[:2]:
        bench.command(0.0, word)
        bench.ticks(2)
    if wrong == "out of sequence":
        for _ in range(4):
            bench.commands.frame(PumpCommand(0.0, ControlWord.ENABLE_OPERATION, 0.05))
    bench.command(math.nan if wrong == "refused" else 0.0, ENABLE[2])
    bench.ticks(2)
    assert bench.told.state is DriveState.SWITCHED_ON


def test_a_new_drive_has_no_set_point_and_warns_of_nothing() -> None:
    bench = DriveBench()
    assert bench.drive.setpoint_pa == 0.0
    bench.tick()
    assert not bench.status_2.command_warning


def test_the_pressure_limit_holds_but_for_half_a_step_of_the_bus() -> None:
    for beyond_pa, refused in ((3.5, 0), (4.5, 1)):
        bench = DriveBench(DriveLimits(pressure_pa=2000.0 - beyond_pa))
        bench.enable()
        bench.command(2000.0)
        assert bench.drive.refused == refused


def test_a_drive_that_is_switched_off_by_itself_is_in_no_fault() -> None:
    bench = armed()
    bench.drive.fail(DriveFault.NONE)
    bench.tick()
    assert bench.told.state is DriveState.SWITCH_ON_DISABLED  # at once, without braking
    bench.command(20e3)
    bench.ticks(20)
    assert bench.told.state is DriveState.SWITCH_ON_DISABLED
    assert bench.status_2.fault is DriveFault.NONE


def test_status_2_comes_every_100_ms_and_warns_of_refused_commands_only() -> None:
    bench = armed()
    sent: dict[int, Frame] = {}
    for k in range(40):
        # one is refused, just before the second status
        bench.command(60e3 if k - 10 in sent and len(sent) == 1 else 20e3)
        bench.tick()
        for frame in bench.frames:
            if frame.can_id == CATALOGUE.codec(DriveStatus2).can_id:
                sent[k] = frame
    assert len(sent) == 4
    warned = [CATALOGUE.codec(DriveStatus2).decode(frame.data) for frame in sent.values()]
    shown = [each.command_warning for each in warned if each is not None]
    assert shown == [False, True, True, False]
    for each in warned:
        warnings = each.temperature_warning, each.voltage_warning, each.sensor_warning
        assert not any(warnings)


def discard(bench: DriveBench, why: str) -> None:
    """Send a command that the drive does not take, or lose one."""
    if why == "refused":
        bench.command(60e3)
        return
    if why in ("lost", "out of sequence"):
        for _ in range(1 if why == "lost" else 4):
            bench.commands.frame(PumpCommand(0.0, ControlWord.ENABLE_OPERATION, 0.05))
        bench.command()
        return
    frame = bench.commands.frame(PumpCommand(0.0, ControlWord.ENABLE_OPERATION, 0.05))
    data = frame.data[:3] if why == "short" else bytes([frame.data[0] ^ 1]) + frame.data[1:]
    bench.drive.receive(Frame(frame.can_id, data), bench.now_ns)


WHYS = ["refused", "CRC", "short", "lost", "out of sequence"]


@pytest.mark.parametrize("phase", range(10))
@pytest.mark.parametrize("why", WHYS)
def test_one_command_that_was_rejected_or_lost_is_told_in_two_messages(
    why: str, phase: int
) -> None:
    bench = DriveBench()
    bench.enable()
    told = []
    for tick in range(60):
        if tick == 20 + phase:
            discard(bench, why)
        elif tick % 2 == 0:
            bench.command()
        bench.tick()
        if any(frame.can_id == CATALOGUE.codec(DriveStatus2).can_id for frame in bench.frames):
            told.append(bench.status_2.command_warning)
    assert len(told) == 6
    # the command after one that was discarded tells that it is missing, too
    assert sum(told) in ((2,) if why in ("refused", "lost") else (2, 3))
    assert sum(a is not b for a, b in pairwise(told)) == 2
    assert told[:2] == [False, False]
    assert not told[-1]


def test_the_warning_lasts_as_long_as_commands_are_rejected() -> None:
    bench = armed(2e3)
    told = []
    for tick in range(100):
        if tick % 2 == 0:
            bench.command(60e3 if tick % 8 == 0 else 2e3)  # one of four
        bench.tick()
        if any(frame.can_id == CATALOGUE.codec(DriveStatus2).can_id for frame in bench.frames):
            told.append(bench.status_2.command_warning)
    assert told == [True] * 10


def test_many_frames_in_a_moment_have_one_tick_of_grace_together() -> None:
    bench = DriveBench()
    bench.enable()
    bench.command(0.0)
    for pressure_pa in range(0, 48_000, 2400):
        bench.command(pressure_pa)
    assert bench.drive.refused == MISCODED_COMMANDS_TO_TRIP
    bench = DriveBench()
    bench.enable()
    bench.command(0.0)
    for step in range(1, 20):
        bench.now_ns += MS
        bench.command(2400.0 * step)
    assert bench.drive.refused == MISCODED_COMMANDS_TO_TRIP


def test_command_that_can_not_be_followed_is_not_judged_by_its_rate() -> None:
    bench = DriveBench()
    bench.enable()
    for step in range(5):
        bench.now_ns += 20 * MS
        bench.command(4e3 * step)
    bench.drive.fail(DriveFault.OVERCURRENT)
    bench.now_ns += 20 * MS
    bench.command(20e3)
    assert bench.drive.refused == 0
    assert bench.drive.setpoint_pa == 0.0


@given(st.lists(st.integers(0, 10), min_size=20, max_size=80), st.integers(0, 20))
def test_a_ramp_at_the_drives_own_limit_is_never_refused_for_jitter(
    late_ms: list[int], hold: int
) -> None:
    bench = DriveBench(DriveLimits(pressure_rate_pa_s=100_123.0))
    bench.enable()
    bench.command(0.0)
    sent_ns = bench.now_ns
    asked_pa, step_pa = 0.0, 100_123.0 * 0.02
    for index, late in enumerate(late_ms):
        sent_ns += 20 * MS
        if index >= hold:
            asked_pa = step_pa * ((index - hold) % 24)  # down at once, and up again
        bench.now_ns = sent_ns + late * MS
        bench.command(asked_pa)
    assert bench.drive.refused == 0


def test_steps_toward_zero_are_never_refused() -> None:
    bench = armed(40e3)
    bench.command(1e3)
    bench.command(0.0)
    assert bench.drive.refused == 0


def test_refusals_in_a_row_trip_the_drive_and_one_good_command_forgives() -> None:
    assert MISCODED_COMMANDS_TO_TRIP == 5
    bench = armed()
    for _ in range(MISCODED_COMMANDS_TO_TRIP - 1):
        bench.command(60e3)
    bench.command(20e3)
    for _ in range(MISCODED_COMMANDS_TO_TRIP - 1):
        bench.command(60e3)
    bench.tick()
    assert bench.told.state is DriveState.OPERATION_ENABLED
    bench.command(60e3)
    bench.ticks(10)
    assert bench.told.state is DriveState.FAULT
    assert bench.status_2.fault is DriveFault.COMMAND_REFUSED
    assert bench.drive.refused == 2 * MISCODED_COMMANDS_TO_TRIP - 1


def test_a_drive_trips_by_refusals_that_come_before_any_good_command() -> None:
    bench = DriveBench()
    for _ in range(MISCODED_COMMANDS_TO_TRIP - 1):
        bench.command(1e9)
    bench.tick()
    assert bench.told.state is DriveState.SWITCH_ON_DISABLED
    bench.command(1e9)
    bench.ticks(10)
    assert bench.told.state is DriveState.FAULT


def test_corrupted_and_foreign_frames_are_as_if_never_sent() -> None:
    bench = armed()
    good = bench.commands.counter
    frame = bench.commands.frame(PumpCommand(0.0, ControlWord.QUICK_STOP, 0.05))
    for position in range(64):
        data = bytearray(frame.data)
        data[position // 8] ^= 1 << position % 8
        bench.drive.receive(Frame(frame.can_id, bytes(data)), bench.now_ns)
    bench.drive.receive(Frame(frame.can_id + 1, frame.data), bench.now_ns)
    assert bench.drive.hears == {frame.can_id}
    bench.ticks(2)
    assert bench.told.state is DriveState.OPERATION_ENABLED
    assert bench.told.command_echo == good
    assert bench.drive.refused == 0


def test_status_comes_every_20_ms_and_at_once_when_the_state_changes() -> None:
    bench = DriveBench()
    bench.enable()
    bench.command(0.0)
    bench.ticks(3)  # the next regular status is one tick away
    bench.command(0.0, ControlWord.DISABLE_VOLTAGE)
    sent = len(bench.sent_ns)
    changed_ns = bench.now_ns
    bench.tick()
    assert bench.sent_ns[sent:] == [changed_ns]
    assert bench.told.state is DriveState.SWITCH_ON_DISABLED
    bench.sent_ns.clear()
    bench.ticks(20)
    assert len(bench.sent_ns) == 10
    steps = {later - earlier for earlier, later in pairwise(bench.sent_ns)}
    assert steps == {2 * TICK_NS}


def test_drive_claims_its_address_and_tells_its_fault_in_the_heartbeat() -> None:
    bench = DriveBench(start_ns=START_NS)
    beats = CATALOGUE.receiver(Heartbeat, Address.DRIVE)
    claim = CATALOGUE.receiver(AddressClaim, Address.DRIVE)
    bench.tick()
    assert [frame.can_id for frame in bench.frames].count(claim.can_id) == 1
    bench.now_ns = START_NS + TICK_NS
    states = []
    bench.enable()
    for _ in range(40):
        bench.tick()
        heard = [beats.accept(frame) for frame in bench.frames if frame.can_id == beats.can_id]
        states += [beat.state for beat in heard if beat is not None]
        assert claim.can_id not in [frame.can_id for frame in bench.frames]
    assert states[0] is NodeState.OPERATIONAL
    assert states[-1] is NodeState.FAULT  # no command came


@given(
    limit_pa=st.floats(1e3, 200e3),
    share=st.floats(-1, 1),
)
def test_rounding_on_the_bus_never_makes_a_permitted_pressure_a_refused_one(
    limit_pa: float, share: float
) -> None:
    limits = DriveLimits(pressure_pa=limit_pa, pressure_rate_pa_s=1e9)
    bench = DriveBench(limits)
    bench.enable()
    bench.command(share * limit_pa)
    assert bench.drive.refused == 0
