import math
from collections.abc import Callable
from enum import Enum
from pathlib import Path

import pytest
from controller_bench import CATALOGUE, MS, VERSION, VESSEL
from hypothesis import given
from hypothesis import strategies as st

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from utank_hil.assembly import measure_of
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import (
    Address,
    AddressClaim,
    DriveFault,
    DriveState,
    DriveStatus1,
    DriveStatus2,
    Frame,
    HardwiredInputs,
    Heartbeat,
    Mode,
    NodeState,
    OperatorCommand,
    Quality,
    ResetCause,
    SensorMotion,
    SensorPump,
    SensorTank,
    Station,
    Switch,
    ValveFault,
    ValveState,
    ValveStatus,
)
from utank_hil.canbus.measurements import Measurements
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control import LevelObserver
from utank_hil.nodes.inbox import Inbox
from utank_hil.nodes.plausibility import NEVER_HEARD_NS
from utank_hil.nodes.redundancy import Redundancy
from utank_hil.runners import Lockstep
from utank_hil.safety.monitors.thresholds import SensorFigures, thresholds_of

NAN = math.nan
LEVEL_LIMIT_M = 4.88
GOOD: dict[type, tuple[object, ...]] = {
    SensorMotion: SensorMotion(0.1, -0.05, Quality.GOOD),
    SensorTank: SensorTank(-0.5, 0.75, Switch.OFF, Switch.OFF, Quality.GOOD),
    SensorPump: SensorPump(8e3, 3.0, Quality.GOOD),
    DriveStatus1: DriveStatus1(8e3, 9.0, DriveState.OPERATION_ENABLED, 4, *(False,) * 4),
    DriveStatus2: DriveStatus2(DriveFault.NONE, 1000.0, 20.0, 40.0, 40.0, *(False,) * 4),
    OperatorCommand: OperatorCommand(Mode.ACTIVE, True, False, False, False),
}
AGES: dict[type, Callable[[Measurements], float]] = {
    SensorMotion: lambda seen: seen.motions[0].age_ms,
    SensorTank: lambda seen: seen.tank_age_ms,
    SensorPump: lambda seen: seen.pump_age_ms,
    DriveStatus1: lambda seen: seen.drive_age_ms,
    OperatorCommand: lambda seen: seen.panel_age_ms,
}
# what a law may measure: attribute of the emulated ship, and how far noise and delay may be off it
TRUE = {
    "roll_rad": ("roll_rad", 0.003),
    "roll_rate_rad_s": ("roll_rate_rad_s", 0.005),
    "level_m": ("level_m", 0.03),
}


class Line:
    """An inbox and everybody who sends to it."""

    def __init__(self):
        self.inbox = Inbox(CATALOGUE, VERSION, LEVEL_LIMIT_M)
        self.senders = {kind: CATALOGUE.transmitter(kind) for kind in GOOD}
        self.now_ns = 1000

    def frame(self, message):
        return self.senders[type(message)].frame(message)

    def say(self, message):
        self.hear(self.frame(message))

    def hear(self, frame):
        self.now_ns += 10
        self.inbox.receive(frame, self.now_ns)

    def beat(self, address, catalogue, configuration):
        beat = Heartbeat(
            NodeState.OPERATIONAL, ResetCause.POWER_ON, 0.0, catalogue, configuration, NAN, NAN
        )
        self.hear(CATALOGUE.transmitter(Heartbeat, address).frame(beat))

    @property
    def seen(self):
        return self.inbox.snapshot(self.now_ns)

    @property
    def protected(self):
        """Whether all that control stands on arrives intact, with the first motion sensor."""
        seen = self.seen
        return seen.protection_valid and seen.motions[0].valid

    def content(self):
        """Everything that the inbox keeps but counts of frames and cycles."""
        counts = {"receiver", "rejected", "frames", "foreign", "_lost", "_counted", "_due_ns"}
        parts = (
            self.inbox,
            self.inbox._levels,
            self.inbox._drive,
            self.inbox._valve,
            self.inbox._nodes,
        )
        orders = self.inbox.stations.orders[Station.OPERATOR]
        return {
            **{
                f"{name}_{place}": value
                for place, part in enumerate(parts)
                for name, value in vars(part).items()
                if name not in counts and isinstance(value, bool | int | float | Enum | None)
            },
            **{
                f"{name}_{place}": getattr(sensor, name)
                for place, sensor in enumerate(self.inbox.motions)
                for name in ("roll_rad", "roll_rate_rad_s", "heard_ns")
            },
            **{name: value for name, value in vars(orders).items() if name not in counts},
        }


def test_good_frames_are_kept_with_the_time_they_came():
    line = Line()
    for message in GOOD.values():
        line.say(message)
    assert line.seen.panel_age_ms > 1e12  # without a heartbeat a panel is not live
    line.beat(Address.OPERATOR, CATALOGUE.version, VERSION)
    line.now_ns -= 10
    seen = line.seen
    motion = seen.motions[0]
    assert (motion.roll_rad, motion.roll_rate_rad_s) == pytest.approx((0.1, -0.05))
    assert (seen.port_level_m, seen.starboard_level_m) == pytest.approx((-0.5, 0.75))
    assert seen.level_m == pytest.approx(0.625)
    assert seen.pressure_pa == 8e3
    assert seen.power_w == pytest.approx(20e3)
    assert seen.drive_state is DriveState.OPERATION_ENABLED
    assert seen.requested_mode is Mode.ACTIVE
    ages_ns = {kind: 10 * (len(GOOD) - 1 - index) for index, kind in enumerate(GOOD)}
    assert {kind: age_ms(seen) * MS for kind, age_ms in AGES.items()} == pytest.approx(
        {kind: ages_ns[kind] for kind in AGES}
    )
    assert (line.now_ns - seen.tank_ns, line.now_ns - seen.drive_echo_ns) == (
        ages_ns[SensorTank], ages_ns[DriveStatus1],
    )  # fmt: skip
    assert seen.drive_echo == 4
    assert seen.frames == len(GOOD) + 1
    assert line.protected


@pytest.mark.parametrize(
    "message",
    [
        SensorMotion(NAN, 0.0, Quality.GOOD),
        SensorMotion(0.0, NAN, Quality.GOOD),
        SensorMotion(0.0, 0.0, Quality.BAD),
        SensorMotion(0.0, 0.0, None),
        SensorTank(NAN, 0.0, Switch.OFF, Switch.OFF, Quality.GOOD),
        SensorTank(0.0, NAN, Switch.OFF, Switch.OFF, Quality.GOOD),
        SensorTank(0.0, 0.0, Switch.OFF, Switch.OFF, Quality.BAD),
        SensorTank(-30.0, 30.0, Switch.OFF, Switch.OFF, Quality.GOOD),
        SensorTank(30.0, -30.0, Switch.OFF, Switch.OFF, Quality.GOOD),
        SensorTank(-5.4, 5.4, Switch.OFF, Switch.OFF, Quality.GOOD),
        SensorTank(2.5, 0.0, Switch.OFF, Switch.OFF, Quality.GOOD),
        SensorTank(-1.3, -1.3, Switch.OFF, Switch.OFF, Quality.GOOD),
        SensorPump(NAN, 0.0, Quality.GOOD),
        SensorPump(0.0, 0.0, None),
    ],
)
def test_what_is_no_measurement_changes_nothing(message):
    line = Line()
    for good in GOOD.values():
        line.say(good)
    before = line.content()
    line.say(message)
    assert line.content() == before


@pytest.mark.parametrize(
    ("port_m", "starboard_m"), [(-5.3, 5.3), (5.3, -5.3), (2.4, 0.0), (-1.2, -1.2)]
)
def test_levels_within_the_margins_of_gauges_and_sloshing_are_measurements(port_m, starboard_m):
    line = Line()
    line.say(SensorTank(port_m, starboard_m, Switch.OFF, Switch.OFF, Quality.GOOD))
    assert line.seen.port_level_m == pytest.approx(port_m)
    assert line.seen.starboard_level_m == pytest.approx(starboard_m)


def test_where_no_limit_is_known_any_level_is_a_measurement():
    line = Line()
    line.inbox = Inbox(CATALOGUE, VERSION)
    line.say(SensorTank(-9.0, 9.0, Switch.OFF, Switch.OFF, Quality.GOOD))
    assert line.seen.level_m == pytest.approx(9.0)


@pytest.mark.parametrize("kind", GOOD)
def test_damaged_repeated_and_foreign_frames_change_nothing(kind):
    line = Line()
    for good in GOOD.values():
        line.say(good)
    line.beat(Address.DRIVE, CATALOGUE.version, VERSION)
    line.beat(Address.SENSORS, CATALOGUE.version, VERSION)
    repeated = line.frame(GOOD[kind])
    line.hear(repeated)
    before = line.content()
    following = line.frame(GOOD[kind])
    damaged = [repeated]
    for bit in range(64):
        data = bytearray(following.data)
        data[bit // 8] ^= 1 << bit % 8
        damaged.append(Frame(following.can_id, bytes(data)))
    damaged += [
        Frame(following.can_id, following.data[:7]),
        Frame(following.can_id, b""),
        Frame(0x18FF7782, following.data),
    ]
    for frame in damaged:
        line.hear(frame)
        assert line.content() == before
    line.hear(following)  # and the good one is still taken
    assert line.content() != before or kind is DriveStatus2


@given(
    can_id=st.sampled_from(sorted(CATALOGUE.can_ids))
    | st.integers(0, (1 << 29) - 1)
    | st.integers(0, (1 << 21) - 1).map(lambda above: above << 8 | Address.CONTROLLER),
    data=st.binary(min_size=8, max_size=8) | st.binary(max_size=8),
    crc_error=st.integers(1, 255),
)
def test_noise_on_the_bus_is_never_a_measurement(can_id, data, crc_error):
    own = can_id & 0xFF == Address.CONTROLLER  # by SAE J1939-21, the sender's address
    line = Line()
    before = line.content()
    frames = [Frame(can_id, data)]
    if len(data) == 8:  # of two frames that differ in the CRC alone, one is wrong for certain
        frames.append(Frame(can_id, bytes([data[0] ^ crc_error]) + data[1:]))
    unchanged = 0
    for frame in frames:
        twin = Line()
        twin.hear(frame)
        unchanged += twin.content() == before
        assert (twin.seen.address_conflict) == own
    assert unchanged >= 1 or own


def test_switches_count_even_when_the_gauges_are_bad_and_broken_ones_are_closed():
    for port, starboard, closed in (
        (Switch.OFF, Switch.OFF, False),
        (Switch.ON, Switch.OFF, True),
        (Switch.OFF, Switch.ON, True),
        (None, Switch.OFF, True),
        (Switch.OFF, None, True),
    ):
        for level_m, quality in ((0.0, Quality.GOOD), (NAN, Quality.GOOD), (0.0, Quality.BAD)):
            line = Line()
            line.say(SensorTank(level_m, 0.0, port, starboard, quality))
            assert line.seen.high_level == closed


@pytest.mark.parametrize("kind", [SensorMotion, SensorTank, DriveStatus1])
def test_every_stream_that_control_stands_on_counts_for_the_protection(kind):
    line = Line()
    for message in GOOD.values():
        line.say(message)
    assert line.protected
    for _ in range(5):
        frame = line.frame(GOOD[kind])
        line.hear(Frame(frame.can_id, frame.data[:-1] + bytes((frame.data[-1] ^ 1,))))
    assert not line.protected


def test_versions_match_only_when_drive_and_sensors_both_say_so():
    line = Line()
    assert not line.seen.versions_match
    line.beat(Address.DRIVE, CATALOGUE.version, VERSION)
    assert not line.seen.versions_match
    line.beat(Address.SENSORS, CATALOGUE.version ^ 1, VERSION)
    assert not line.seen.versions_match
    line = Line()
    line.beat(Address.DRIVE, CATALOGUE.version, VERSION)
    line.beat(Address.SENSORS, CATALOGUE.version, VERSION)
    assert line.seen.versions_match


@pytest.mark.parametrize("address", [Address.SENSORS, Address.DRIVE, Address.OPERATOR])
def test_an_address_that_is_claimed_under_another_name_has_two_holders(address):
    line, claims = Line(), CATALOGUE.transmitter(AddressClaim, address)
    for name, second in ((5, False), (5, False), (6, True)):
        line.hear(claims.frame(AddressClaim(name)))
        assert line.seen.claimed_twice is second
    line.now_ns += 10_000 * MS
    assert line.seen.claimed_twice
    line.hear(claims.frame(AddressClaim(6)))  # replaced: it is the one there is
    assert not line.seen.claimed_twice


def test_drive_of_an_unknown_fault_is_not_healthy():
    line = Line()
    line.say(GOOD[DriveStatus2]._replace(fault=None))
    assert line.seen.drive_fault


def test_drive_status_without_a_state_is_as_if_it_had_not_come():
    line, status = Line(), GOOD[DriveStatus1]._replace(power_limited=True)
    line.say(status._replace(state=None))
    assert (line.seen.drive_state, line.seen.drive_echo_ns) == (None, NEVER_HEARD_NS)
    line.say(status)
    heard_ns = line.seen.drive_echo_ns
    line.say(status._replace(state=None, power_limited=False, command_echo=9))
    seen = line.seen
    assert (seen.drive_state, seen.drive_held_back) == (DriveState.OPERATION_ENABLED, True)
    assert not seen.drive_at_speed
    assert (seen.drive_echo_ns, seen.drive_echo) == (heard_ns, 4)


def test_a_mode_nobody_asked_for_is_standby():
    line = Line()
    assert line.seen.requested_mode is Mode.STANDBY
    line.say(OperatorCommand(None, True, False, False, False))
    assert line.seen.requested_mode is Mode.STANDBY


class Listener:
    """An inbox on the bus."""

    name = "listener"
    period_ns = TICK_NS

    def __init__(self):
        self.inbox = Inbox(CATALOGUE, VERSION)

    def receive(self, frame, now_ns):
        self.inbox.receive(frame, now_ns)

    def tick(self, now_ns):
        return ()


def test_emulated_sensors_are_what_a_law_measures():
    scenario = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
    ship, listener = build_ship_side(scenario, 1, ()), Listener()
    measure, level = measure_of(tuple(TRUE)), LevelObserver(VESSEL.tank, 0.02)
    run, largest = Lockstep([ship.sensors, listener]), dict.fromkeys(TRUE, 0.0)
    for time_ms in range(20_000, 60_000, 250):
        run.run_until(time_ms * 1_000_000)
        seen = listener.inbox.snapshot(time_ms * 1_000_000)
        for name, value in zip(TRUE, measure(seen, seen.motions[0], level), strict=True):
            attribute, off = TRUE[name]
            assert value == pytest.approx(getattr(ship.plant, attribute), abs=off), name
            largest[name] = max(largest[name], abs(value))
    assert all(largest[name] > 3 * off for name, (_, off) in TRUE.items())


def test_a_measurement_that_does_not_exist_is_refused_with_those_that_do():
    with pytest.raises(ValueError, match="no measurement 'rol_rad'; there are roll_rad"):
        measure_of(("level_m", "rol_rad"))


CYCLE_NS = CATALOGUE.codec(SensorTank).cycle_ns


def listening(**on_board):
    line = Line()
    line.inbox = Inbox(CATALOGUE, VERSION, LEVEL_LIMIT_M, **on_board)
    return line


def test_new_it_knows_nothing_and_trusts_nothing():
    for inbox in (Inbox(CATALOGUE, VERSION), Inbox(CATALOGUE, VERSION, pump=False, valve=True)):
        seen = inbox.snapshot(0)
        (motion,) = seen.motions
        assert (motion.roll_rad, motion.roll_rate_rad_s, motion.valid) == (0.0, 0.0, False)
        for name in ("port_level_m", "starboard_level_m", "pressure_pa", "power_w", "frames",
                     "foreign", "tank_cycles"):  # fmt: skip
            assert getattr(seen, name) == 0, name
        assert {motion.heard_ns, seen.tank_ns, seen.valve_heard_ns} == {NEVER_HEARD_NS}
        assert seen.valve_opening == 1.0
        for name in ("high_level", "drive_held_back", "drive_at_speed", "drive_warns",
                     "versions_match", "panel_matches", "protection_valid", "drive_fault",
                     "valve_fault", "valve_following", "address_conflict",
                     "claimed_twice"):  # fmt: skip
            assert getattr(seen, name) is False, name


def test_a_ship_with_a_pump_and_no_valve_hears_and_awaits_the_drive_alone():
    line = listening()
    inbox = line.inbox
    seen = line.seen
    assert seen.drive_state is None
    assert min(seen.pump_age_ms, seen.drive_age_ms) > 1e12
    beats = {address: CATALOGUE.receiver(Heartbeat, address).can_id for address in Address
             if any(m[:2] == (Heartbeat, address) for m in CATALOGUE.messages)}  # fmt: skip
    expected = {CATALOGUE.codec(DriveStatus2).can_id, beats[Address.DRIVE], beats[Address.SENSORS]}
    assert inbox.expected == expected
    heard = {receiver.can_id for receiver in inbox.watched}
    assert heard == expected | {CATALOGUE.codec(kind).can_id for kind in GOOD} | {
        beats[Address.OPERATOR], beats[Address.OPERATOR_2],
        CATALOGUE.codec(OperatorCommand, Address.OPERATOR_2).can_id,
        CATALOGUE.codec(HardwiredInputs).can_id,  # obeyed wherever they are heard
    }  # fmt: skip
    assert CATALOGUE.codec(ValveStatus).can_id not in heard


def test_without_a_pump_its_drive_is_enabled_never_late_and_not_awaited():
    line = listening(pump=False, valve=True)
    inbox = line.inbox
    century_ns = 100 * 366 * 86_400 * 1_000_000_000
    seen = inbox.snapshot(century_ns)
    assert seen.drive_state is DriveState.OPERATION_ENABLED
    assert max(seen.pump_age_ms, seen.drive_age_ms) < 0
    line.say(GOOD[SensorMotion])
    line.say(GOOD[SensorTank])
    assert line.protected
    line.beat(Address.SENSORS, CATALOGUE.version, VERSION)
    assert not line.seen.versions_match
    line.beat(Address.VALVE, CATALOGUE.version, VERSION)
    assert line.seen.versions_match
    assert CATALOGUE.codec(DriveStatus1).can_id not in {each.can_id for each in inbox.watched}


def test_what_the_valve_says_is_kept_with_the_echo_of_the_last_status():
    line = listening(valve=True)
    sender = CATALOGUE.transmitter(ValveStatus)

    def say(opening, echo):
        flags = [False] * (len(ValveStatus._fields) - 5)
        status = ValveStatus(opening, ValveState.FOLLOWING, ValveFault.NONE, echo, None, *flags)
        line.hear(sender.frame(status))
        return line.seen

    seen = say(0.4, None)
    first_ns = line.now_ns
    assert (seen.valve_following, seen.valve_fault) == (True, False)
    assert (seen.valve_opening, seen.valve_heard_ns) == (pytest.approx(0.4, abs=0.01), first_ns)
    assert (seen.valve_echo_ns, seen.valve_echo) == (NEVER_HEARD_NS, None)
    seen = say(NAN, 3)  # without an opening
    assert (seen.valve_opening, seen.valve_heard_ns) == (pytest.approx(0.4, abs=0.01), first_ns)
    assert (seen.valve_echo_ns, seen.valve_echo) == (line.now_ns, 3)
    assert say(0.5, 3).valve_heard_ns == line.now_ns


@pytest.mark.parametrize(
    ("state", "fault", "faulty"),
    [
        (ValveState.FOLLOWING, ValveFault.NONE, False),
        (ValveState.FAULT, ValveFault.NONE, True),
        (ValveState.FOLLOWING, ValveFault.INTERNAL, True),
        (ValveState.FOLLOWING, None, True),
    ],
)
def test_a_valve_is_at_fault_by_its_state_or_its_fault(state, fault, faulty):
    line = listening(valve=True)
    flags = [False] * (len(ValveStatus._fields) - 5)
    status = ValveStatus(0.4, state, fault, 3, None, *flags)
    line.hear(CATALOGUE.transmitter(ValveStatus).frame(status))
    assert line.seen.valve_fault is faulty


def test_a_drive_is_not_heard_before_both_its_messages_came():
    line = Line()
    line.say(GOOD[DriveStatus1])
    assert line.seen.drive_age_ms > 1e12
    line.say(GOOD[DriveStatus2])
    assert line.seen.drive_age_ms < 1.0
    kinds = (DriveStatus1, DriveStatus2)
    watched = [each.can_id for each in line.inbox._drive.watched]
    assert watched == [CATALOGUE.codec(kind).can_id for kind in kinds]
    echo_ns = line.seen.drive_echo_ns
    line.say(GOOD[DriveStatus1])  # the same echo again is none
    assert line.seen.drive_echo_ns == echo_ns
    assert line.inbox._drive.words.startswith("drive: state 39 (OPERATION_ENABLED) in DRIVE_ST")


@pytest.mark.parametrize("limited", ["power_limited", "speed_limited"])
def test_a_drive_at_its_power_or_speed_is_held_back(limited):
    line, status = Line(), GOOD[DriveStatus1]
    for said in (True, False, True):
        line.say(status._replace(**{limited: said}))
        assert line.seen.drive_held_back is said
        assert line.seen.drive_at_speed is (said and limited == "speed_limited")
    line.say(status._replace(pressure_limited=True, rate_limited=True))
    assert not line.seen.drive_held_back


@pytest.mark.parametrize(
    "bit", ["temperature_warning", "voltage_warning", "command_warning", "sensor_warning"]
)
def test_a_drive_warns_by_any_bit_until_its_next_status(bit):
    line, status = Line(), GOOD[DriveStatus2]
    for said in (True, False, True):
        line.say(status._replace(**{bit: said}))
        assert line.seen.drive_warns is said


def test_the_panel_in_command_is_to_match_and_not_the_other():
    line = Line()
    for address, versions, matches in (
        (Address.OPERATOR_2, (CATALOGUE.version, VERSION), False),
        (Address.OPERATOR, (CATALOGUE.version, VERSION + 1), False),
        (Address.OPERATOR, (CATALOGUE.version, VERSION), True),
        (Address.OPERATOR_2, (CATALOGUE.version + 1, VERSION), True),
        (Address.OPERATOR, (CATALOGUE.version + 1, VERSION), False),
    ):
        line.hear(beat_of(address, *versions))
        assert line.seen.panel_matches is matches


BEATS = {address: CATALOGUE.transmitter(Heartbeat, address)
         for address in (Address.OPERATOR, Address.OPERATOR_2)}  # fmt: skip


def beat_of(address, catalogue, configuration):
    return BEATS[address].frame(
        Heartbeat(
            NodeState.OPERATIONAL, ResetCause.POWER_ON, 0.0, catalogue, configuration, NAN, NAN
        )
    )


@pytest.mark.parametrize(
    ("lost", "after_ns", "cycles"),
    [
        (0, CYCLE_NS, 1),
        (0, CYCLE_NS // 3, 1),  # it jitters
        (1, 2 * CYCLE_NS, 2),
        (3, 4 * CYCLE_NS, 4),
        (3, 4 * CYCLE_NS + CYCLE_NS // 2, 4),  # still what the counter says
        (3, 3 * CYCLE_NS + 2 * CYCLE_NS // 5, 4),
        (2, 3 * CYCLE_NS + 3 * CYCLE_NS // 5, 3),
        (2, 4 * CYCLE_NS + 2 * CYCLE_NS // 5, 3),
        (2, 4 * CYCLE_NS + CYCLE_NS // 2 + 1, 5),  # beyond it the time does: 4.5 and a little
        (1, 9 * CYCLE_NS + CYCLE_NS // 3, 9),
        (0, 17 * CYCLE_NS, 17),
    ],
)
def test_cycles_of_the_levels_are_counted_by_the_counter_and_long_gaps_by_the_time(
    lost, after_ns, cycles
):
    line = Line()
    inbox = line.inbox
    for _ in range(2):  # frames lost before are counted once
        line.now_ns += CYCLE_NS
        line.frame(GOOD[SensorTank])
        inbox.receive(line.frame(GOOD[SensorTank]), line.now_ns)
    before = line.seen.tank_cycles
    for _ in range(lost):
        line.frame(GOOD[SensorTank])
    line.now_ns += after_ns
    inbox.receive(line.frame(GOOD[SensorTank]), line.now_ns)
    assert line.seen.tank_cycles - before == cycles
    line.now_ns += CYCLE_NS
    inbox.receive(line.frame(GOOD[SensorTank]), line.now_ns)
    assert line.seen.tank_cycles - before == cycles + 1


def test_only_what_the_catalogue_does_not_know_is_foreign():
    line = Line()
    line.hear(CATALOGUE.transmitter(ValveStatus).frame(
        ValveStatus(*[0.0], *[None] * 4, *[False] * (len(ValveStatus._fields) - 5))
    ))  # fmt: skip
    assert (line.inbox.frames, line.inbox.foreign) == (1, 0)
    for number in (1, 2, 3):
        line.hear(Frame(0x1ABCDEF0, bytes(8)))
        assert (line.inbox.frames, line.inbox.foreign) == (1 + number, number)


THRESHOLDS = thresholds_of(
    load_config(Path("configs/controllers/gpc.yaml"), ControllerConfig).plant, 0.6, SensorFigures()
)
BOTH = Redundancy(second_motion_sensor=True, hardwired_inputs=True)


class RedundantLine(Line):
    """Two motion sensors and hard-wired inputs beside the rest."""

    def __init__(self, thresholds=None):
        super().__init__()
        self.inbox = Inbox(
            CATALOGUE, VERSION, LEVEL_LIMIT_M, thresholds=thresholds, redundancy=BOTH
        )
        self.second = CATALOGUE.transmitter(SensorMotion, Address.SENSORS_2)
        self.hardwired = CATALOGUE.transmitter(HardwiredInputs)

    def say_2(self, motion):
        self.hear(self.second.frame(motion))

    def shown(self, place):
        motion = self.seen.motions[place]
        return motion.roll_rad, motion.roll_rate_rad_s, motion.heard_ns


def test_each_of_two_motion_sensors_is_shown():
    line = RedundantLine()
    line.say(SensorMotion(0.1, -0.05, Quality.GOOD))
    first = line.shown(0)
    assert first == (pytest.approx(0.1), pytest.approx(-0.05), line.now_ns)
    line.say_2(SensorMotion(0.2, 0.025, Quality.DEGRADED))
    assert line.shown(0) == first
    assert line.shown(1) == (pytest.approx(0.2), pytest.approx(0.025), line.now_ns)
    line.now_ns += 5 * MS
    assert line.seen.motions[1].age_ms == 5.0


SPIKE = SensorMotion(0.6, -0.05, Quality.GOOD)


@pytest.mark.parametrize(
    ("wrong", "gated"),
    [
        (SensorMotion(NAN, -0.05, Quality.GOOD), False),
        (SensorMotion(0.1, NAN, Quality.GOOD), False),
        (SensorMotion(0.1, -0.05, Quality.BAD), True),
        (SensorMotion(0.1, -0.05, None), True),
        (SPIKE, True),
    ],
)
@pytest.mark.parametrize("second", [False, True])
def test_what_is_no_measurement_changes_neither_of_two_motion_sensors(wrong, gated, second):
    line = RedundantLine(THRESHOLDS if gated else None)
    say = line.say_2 if second else line.say
    say(SensorMotion(0.1, -0.05, Quality.GOOD))
    kept = line.shown(second)
    say(wrong)
    assert line.shown(second) == kept
    assert line.shown(not second) == (0.0, 0.0, NEVER_HEARD_NS)


def test_each_of_two_motion_sensors_has_a_gate_of_its_own():
    line = RedundantLine(THRESHOLDS)
    for say in (line.say, line.say_2):
        say(SensorMotion(0.0, -0.05, Quality.GOOD))
    for times, say in ((1, line.say), (3, line.say_2)):
        for _ in range(times):
            say(SPIKE)
    seen = line.seen
    assert [motion.discarded for motion in seen.motions] == [1, 3]
    assert seen.levels_discarded == 0
    assert line.inbox.discarded == 4


def test_each_motion_sensor_s_stream_counts_for_its_own_protection():
    line = RedundantLine()
    for message in GOOD.values():
        line.say(message)
    line.say_2(SensorMotion(0.0, 0.0, Quality.GOOD))
    for _ in range(5):
        frame = line.second.frame(SensorMotion(0.0, 0.0, Quality.GOOD))
        line.hear(Frame(frame.can_id, frame.data[:-1] + bytes((frame.data[-1] ^ 1,))))
    assert [motion.valid for motion in line.seen.motions] == [True, False]
    assert line.protected


def test_hard_wired_inputs_are_heard_and_their_stop_acts_out_of_sequence():
    line = RedundantLine()
    hardwired = line.inbox.hardwired
    shut = HardwiredInputs(Switch.OFF, Switch.OFF, Switch.OFF, Quality.GOOD)
    line.hear(line.hardwired.frame(shut))
    assert (hardwired.heard_ns, hardwired.stop) == (line.now_ns, False)
    assert hardwired.receiver in line.inbox.watched
    line.hardwired.counter += 7
    line.hear(line.hardwired.frame(shut._replace(stop_loop=Switch.ON)))
    assert hardwired.stop


def test_redundant_nodes_have_to_match_and_the_second_sensor_may_be_missing():
    line = RedundantLine()
    for address in (Address.DRIVE, Address.SENSORS):
        line.beat(address, CATALOGUE.version, VERSION)
    assert not line.seen.versions_match
    line.beat(Address.HARDWIRED, CATALOGUE.version, VERSION)
    assert line.seen.versions_match
    beats = CATALOGUE.transmitter(Heartbeat, Address.SENSORS_2)
    beat = Heartbeat(
        NodeState.OPERATIONAL, ResetCause.POWER_ON, 0.0, CATALOGUE.version, VERSION + 1, NAN, NAN
    )
    line.hear(beats.frame(beat))
    strange_ns = line.now_ns
    for after_ns, match in ((0, False), (10**9, False), (10**9 + 1, True)):  # silent since
        assert line.inbox.snapshot(strange_ns + after_ns).versions_match is match
    line.hear(beats.frame(beat))
    line.hear(beats.frame(beat._replace(configuration_version=VERSION)))
    assert line.seen.versions_match
    expected = {CATALOGUE.receiver(Heartbeat, address).can_id
                for address in (Address.HARDWIRED, Address.SENSORS_2)}  # fmt: skip
    assert expected <= line.inbox.expected


@pytest.mark.parametrize("address", [Address.HARDWIRED, Address.SENSORS_2])
def test_addresses_of_redundant_nodes_are_held_once_too(address):
    line, claims = RedundantLine(), CATALOGUE.transmitter(AddressClaim, address)
    for name, second in ((5, False), (6, True)):
        line.hear(claims.frame(AddressClaim(name)))
        assert line.seen.claimed_twice is second


def test_link_is_lost_for_a_command_cycle_after_an_error():
    line = Line()
    assert not line.seen.link_lost
    line.inbox.link_error(line.now_ns, 20 * MS)
    for after_ns, lost in ((0, True), (20 * MS, True), (20 * MS + 1, False)):
        assert line.inbox.snapshot(line.now_ns + after_ns).link_lost is lost


def test_a_second_sender_is_gone_after_ten_seconds():
    line = Line()
    line.hear(Frame(0x18FF7700 | Address.CONTROLLER, bytes(8)))
    for after_ns, conflict in ((0, True), (10_000 * MS, True), (10_000 * MS + 1, False)):
        assert line.inbox.snapshot(line.now_ns + after_ns).address_conflict is conflict
