import math
from collections.abc import Iterable
from operator import attrgetter
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
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control import LevelObserver
from utank_hil.nodes.inbox import MEASURED, Inbox
from utank_hil.nodes.motion_sensors import MotionSensors
from utank_hil.nodes.observer import Observer
from utank_hil.nodes.orders import NEVER_HEARD_NS
from utank_hil.nodes.redundancy import Redundancy
from utank_hil.runners import Lockstep
from utank_hil.safety.monitors.spikes import SpikeGates
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
TIMES = {
    SensorMotion: "motion_ns",
    SensorTank: "tank_ns",
    SensorPump: "pump_ns",
    DriveStatus1: "drive_ns",
    OperatorCommand: "stations.heard_ns",
}
# what a law may measure: attribute of the emulated ship, and how far noise and delay may be off it
TRUE = {
    "roll_rad": ("roll_rad", 0.003),
    "roll_rate_rad_s": ("roll_rate_rad_s", 0.005),
    "level_m": ("level_m", 0.03),
}


class Line:
    """An inbox and everybody who sends to it."""

    def __init__(self) -> None:
        self.inbox = Inbox(CATALOGUE, VERSION, LEVEL_LIMIT_M)
        self.inbox.pump_echo.sent(4)
        self.senders = {kind: CATALOGUE.transmitter(kind) for kind in GOOD}
        self.now_ns = 1000

    def frame(self, message: tuple[object, ...]) -> Frame:
        return self.senders[type(message)].frame(message)  # type: ignore[arg-type]

    def say(self, message: tuple[object, ...]) -> None:
        self.hear(self.frame(message))

    def hear(self, frame: Frame) -> None:
        self.now_ns += 10
        self.inbox.receive(frame, self.now_ns)

    def beat(self, address: Address, catalogue: int, configuration: int) -> None:
        beat = Heartbeat(
            NodeState.OPERATIONAL, ResetCause.POWER_ON, 0.0, catalogue, configuration, NAN, NAN
        )
        self.hear(CATALOGUE.transmitter(Heartbeat, address).frame(beat))

    def content(self) -> dict[str, object]:
        """Everything that the inbox shows but the count of frames."""
        shown = {name for name in vars(self.inbox) if not name.startswith("_")} - {
            "frames",
            "foreign",
            "watched",
            "expected",
            "stations",
            "pump_echo",
            "valve_echo",
        }
        return {
            "pump_echo": self.inbox.pump_echo.heard_ns,
            "valve_echo": self.inbox.valve_echo.heard_ns,
            **{name: getattr(self.inbox, name) for name in shown | {"level_m"}},
            **{
                name: value
                for name, value in vars(self.inbox.stations.orders[Station.OPERATOR]).items()
                if name != "receiver"
            },
        }


def test_good_frames_are_kept_with_the_time_they_came() -> None:
    line = Line()
    for message in GOOD.values():
        line.say(message)
    inbox = line.inbox
    assert (inbox.roll_rad, inbox.roll_rate_rad_s) == pytest.approx((0.1, -0.05))
    assert (inbox.port_level_m, inbox.starboard_level_m) == pytest.approx((-0.5, 0.75))
    assert inbox.level_m == pytest.approx(0.625)
    assert inbox.pressure_pa == 8e3
    assert inbox.power_w == pytest.approx(20e3)
    assert inbox.drive_state is DriveState.OPERATION_ENABLED
    assert inbox.stations.requested_mode is Mode.ACTIVE
    came_ns = {kind: 1010 + 10 * index for index, kind in enumerate(GOOD)}
    assert {kind: attrgetter(name)(inbox) for kind, name in TIMES.items()} == {
        kind: came_ns[kind] for kind in TIMES
    }
    assert inbox.pump_echo.heard_ns == inbox.drive_ns
    assert inbox.frames == len(GOOD)
    assert inbox.protection_valid


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
def test_what_is_no_measurement_changes_nothing(message: tuple[object, ...]) -> None:
    line = Line()
    for good in GOOD.values():
        line.say(good)
    before = line.content()
    line.say(message)
    assert line.content() == before


@pytest.mark.parametrize(
    ("port_m", "starboard_m"), [(-5.3, 5.3), (5.3, -5.3), (2.4, 0.0), (-1.2, -1.2)]
)
def test_levels_within_the_margins_of_gauges_and_sloshing_are_measurements(
    port_m: float, starboard_m: float
) -> None:
    line = Line()
    line.say(SensorTank(port_m, starboard_m, Switch.OFF, Switch.OFF, Quality.GOOD))
    assert line.inbox.port_level_m == pytest.approx(port_m)
    assert line.inbox.starboard_level_m == pytest.approx(starboard_m)


def test_where_no_limit_is_known_any_level_is_a_measurement() -> None:
    line = Line()
    line.inbox = Inbox(CATALOGUE, VERSION)
    line.say(SensorTank(-9.0, 9.0, Switch.OFF, Switch.OFF, Quality.GOOD))
    assert line.inbox.level_m == pytest.approx(9.0)


@pytest.mark.parametrize("kind", GOOD)
def test_damaged_repeated_and_foreign_frames_change_nothing(kind: type) -> None:
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
def test_noise_on_the_bus_is_never_a_measurement(can_id: int, data: bytes, crc_error: int) -> None:
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
        assert (twin.inbox.conflict_ns > 0) == own
    assert unchanged >= 1 or own


def test_switches_count_even_when_the_gauges_are_bad_and_broken_ones_are_closed() -> None:
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
            assert line.inbox.high_level == closed


@pytest.mark.parametrize("kind", [SensorMotion, SensorTank, DriveStatus1])
def test_every_stream_that_control_stands_on_counts_for_the_protection(kind: type) -> None:
    line = Line()
    for message in GOOD.values():
        line.say(message)
    assert line.inbox.protection_valid
    for _ in range(5):
        frame = line.frame(GOOD[kind])
        line.hear(Frame(frame.can_id, frame.data[:-1] + bytes((frame.data[-1] ^ 1,))))
    assert not line.inbox.protection_valid


def test_an_echo_is_fresh_only_when_it_moves_and_follows_the_commands() -> None:
    line = Line()
    echo = line.inbox.pump_echo
    echo.sent(5)
    for counter, fresh in ((None, False), (3, True), (3, False), (4, True), (9, False), (2, True)):
        before = echo.heard_ns
        line.say(GOOD[DriveStatus1]._replace(command_echo=counter))  # type: ignore[attr-defined]
        assert (echo.heard_ns == line.now_ns) is (echo.heard_ns != before) is fresh
        assert line.inbox.drive_ns == line.now_ns


def test_versions_match_only_when_drive_and_sensors_both_say_so() -> None:
    line = Line()
    assert not line.inbox.versions_match
    line.beat(Address.DRIVE, CATALOGUE.version, VERSION)
    assert not line.inbox.versions_match
    line.beat(Address.SENSORS, CATALOGUE.version ^ 1, VERSION)
    assert not line.inbox.versions_match
    line = Line()
    line.beat(Address.DRIVE, CATALOGUE.version, VERSION)
    line.beat(Address.SENSORS, CATALOGUE.version, VERSION)
    assert line.inbox.versions_match


@pytest.mark.parametrize("address", [Address.SENSORS, Address.DRIVE, Address.OPERATOR])
def test_an_address_that_is_claimed_under_another_name_has_two_holders(address: Address) -> None:
    line, claims = Line(), CATALOGUE.transmitter(AddressClaim, address)
    for name, second in ((5, False), (5, False), (6, True)):
        line.hear(claims.frame(AddressClaim(name)))
        assert (line.inbox.claimed_twice_ns == line.now_ns) is second
    line.hear(claims.frame(AddressClaim(6)))  # replaced: it is the one there is
    assert line.inbox.claimed_twice_ns < line.now_ns


def test_drive_of_an_unknown_fault_is_not_healthy() -> None:
    line = Line()
    line.say(GOOD[DriveStatus2]._replace(fault=None))  # type: ignore[attr-defined]
    assert line.inbox.drive_fault is None


def test_drive_status_without_a_state_is_as_if_it_had_not_come() -> None:
    line, status = Line(), GOOD[DriveStatus1]._replace(power_limited=True)  # type: ignore[attr-defined]
    line.say(status._replace(state=None))
    assert (line.inbox.drive_state, line.inbox.drive_ns) == (None, NEVER_HEARD_NS)
    line.say(status)
    heard_ns = line.inbox.drive_ns
    line.inbox.pump_echo.sent(9)
    line.say(status._replace(state=None, power_limited=False, command_echo=9))
    inbox = line.inbox
    assert (inbox.drive_state, inbox.drive_held_back) == (DriveState.OPERATION_ENABLED, True)
    assert inbox.drive_ns == inbox.pump_echo.heard_ns == heard_ns


def test_a_mode_nobody_asked_for_is_standby() -> None:
    line = Line()
    assert line.inbox.stations.requested_mode is Mode.STANDBY
    line.say(OperatorCommand(None, True, False, False, False))
    assert line.inbox.stations.requested_mode is Mode.STANDBY


class Listener:
    """An inbox on the bus."""

    name = "listener"
    period_ns = TICK_NS

    def __init__(self) -> None:
        self.inbox = Inbox(CATALOGUE, VERSION)

    def receive(self, frame: Frame, now_ns: int) -> None:
        self.inbox.receive(frame, now_ns)

    def tick(self, now_ns: int) -> Iterable[Frame]:
        return ()


def test_emulated_sensors_are_what_a_law_measures() -> None:
    assert list(TRUE) == list(MEASURED)
    scenario = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
    ship, listener = build_ship_side(scenario, 1, ()), Listener()
    measure, level = measure_of(MEASURED), LevelObserver(VESSEL.tank, 0.02)
    run, largest = Lockstep([ship.sensors, listener]), dict.fromkeys(MEASURED, 0.0)
    for time_ms in range(20_000, 60_000, 250):
        run.run_until(time_ms * 1_000_000)
        for name, value in zip(MEASURED, measure(listener.inbox, level), strict=True):
            attribute, off = TRUE[name]
            assert value == pytest.approx(getattr(ship.plant, attribute), abs=off), name
            largest[name] = max(largest[name], abs(value))
    assert all(largest[name] > 3 * off for name, (_, off) in TRUE.items())


def test_a_measurement_that_does_not_exist_is_refused_with_those_that_do() -> None:
    with pytest.raises(ValueError, match="no measurement 'rol_rad'; there are roll_rad"):
        measure_of(("level_m", "rol_rad"))


CYCLE_NS = CATALOGUE.codec(SensorTank).cycle_ns


def listening(**on_board: bool) -> Line:
    line = Line()
    line.inbox = Inbox(CATALOGUE, VERSION, LEVEL_LIMIT_M, **on_board)
    return line


def test_new_it_knows_nothing_and_trusts_nothing() -> None:
    for inbox in (Inbox(CATALOGUE, VERSION), Inbox(CATALOGUE, VERSION, pump=False, valve=True)):
        for name in ("roll_rad", "roll_rate_rad_s", "port_level_m", "starboard_level_m",
                     "pressure_pa", "power_w", "frames", "foreign", "tank_cycles"):  # fmt: skip
            assert getattr(inbox, name) == 0, name
        for name in ("motion_ns", "tank_ns", "valve_ns", "conflict_ns"):
            assert getattr(inbox, name) == NEVER_HEARD_NS, name
        assert inbox.valve_opening == 1.0
        assert inbox.valve_state is None
        assert inbox.drive_fault is DriveFault.NONE
        for name in ("high_level", "drive_held_back", "drive_warns", "versions_match",
                     "panel_matches", "protection_valid"):  # fmt: skip
            assert getattr(inbox, name) is False, name


def test_a_ship_with_a_pump_and_no_valve_hears_and_awaits_the_drive_alone() -> None:
    line = listening()
    inbox = line.inbox
    assert inbox.drive_state is None
    assert {inbox.pump_ns, inbox.drive_ns, inbox.pump_echo.heard_ns} == {NEVER_HEARD_NS}
    beats = {address: CATALOGUE.receiver(Heartbeat, address).can_id for address in Address
             if (Heartbeat, address) in CATALOGUE._codecs}  # fmt: skip
    expected = {CATALOGUE.codec(DriveStatus2).can_id, beats[Address.DRIVE], beats[Address.SENSORS]}
    assert inbox.expected == expected
    heard = {receiver.can_id for receiver in inbox.watched}
    assert heard == expected | {CATALOGUE.codec(kind).can_id for kind in GOOD} | {
        beats[Address.OPERATOR], beats[Address.OPERATOR_2],
        CATALOGUE.codec(OperatorCommand, Address.OPERATOR_2).can_id,
    }  # fmt: skip
    assert CATALOGUE.codec(ValveStatus).can_id not in heard


def test_without_a_pump_its_drive_is_enabled_never_late_and_not_awaited() -> None:
    line = listening(pump=False, valve=True)
    inbox = line.inbox
    assert inbox.drive_state is DriveState.OPERATION_ENABLED
    century_ns = 100 * 366 * 86_400 * 1_000_000_000
    assert min(inbox.pump_ns, inbox.drive_ns, inbox.pump_echo.heard_ns) > century_ns
    line.say(GOOD[SensorMotion])
    line.say(GOOD[SensorTank])
    assert inbox.protection_valid
    line.beat(Address.SENSORS, CATALOGUE.version, VERSION)
    assert not inbox.versions_match
    line.beat(Address.VALVE, CATALOGUE.version, VERSION)
    assert inbox.versions_match
    assert CATALOGUE.codec(DriveStatus1).can_id not in {each.can_id for each in inbox.watched}


def test_what_the_valve_says_is_kept_and_its_echo_is_fresh_only_when_it_moves() -> None:
    line = listening(valve=True)
    inbox, sender = line.inbox, CATALOGUE.transmitter(ValveStatus)
    inbox.valve_echo.sent(4)

    def say(opening: float, echo: int | None) -> int:
        flags = [False] * (len(ValveStatus._fields) - 5)
        status = ValveStatus(opening, ValveState.FOLLOWING, ValveFault.NONE, echo, None, *flags)
        line.hear(sender.frame(status))
        return line.now_ns

    first_ns = say(0.4, None)
    assert inbox.valve_state is ValveState.FOLLOWING
    assert (inbox.valve_opening, inbox.valve_ns) == (pytest.approx(0.4, abs=0.01), first_ns)
    assert inbox.valve_echo.heard_ns == NEVER_HEARD_NS
    say(NAN, None)
    assert (inbox.valve_opening, inbox.valve_ns) == (pytest.approx(0.4, abs=0.01), first_ns)
    second_ns = say(0.5, 3)
    assert (inbox.valve_ns, inbox.valve_echo.heard_ns) == (second_ns, second_ns)
    third_ns = say(0.5, 3)
    say(0.5, None)
    assert (inbox.valve_ns > third_ns, inbox.valve_echo.heard_ns) == (True, second_ns)
    assert say(0.5, 4) == inbox.valve_echo.heard_ns


@pytest.mark.parametrize("limited", ["power_limited", "speed_limited"])
def test_a_drive_at_its_power_or_speed_is_held_back(limited: str) -> None:
    line, status = Line(), GOOD[DriveStatus1]
    for said in (True, False, True):
        line.say(status._replace(**{limited: said}))  # type: ignore[attr-defined]
        assert line.inbox.drive_held_back is said
    line.say(status._replace(pressure_limited=True, rate_limited=True))  # type: ignore[attr-defined]
    assert not line.inbox.drive_held_back


@pytest.mark.parametrize(
    "bit", ["temperature_warning", "voltage_warning", "command_warning", "sensor_warning"]
)
def test_a_drive_warns_by_any_bit_until_its_next_status(bit: str) -> None:
    line, status = Line(), GOOD[DriveStatus2]
    for said in (True, False, True):
        line.say(status._replace(**{bit: said}))  # type: ignore[attr-defined]
        assert line.inbox.drive_warns is said


def test_the_panel_in_command_is_to_match_and_not_the_other() -> None:
    line = Line()
    for address, versions, matches in (
        (Address.OPERATOR_2, (CATALOGUE.version, VERSION), False),
        (Address.OPERATOR, (CATALOGUE.version, VERSION + 1), False),
        (Address.OPERATOR, (CATALOGUE.version, VERSION), True),
        (Address.OPERATOR_2, (CATALOGUE.version + 1, VERSION), True),
        (Address.OPERATOR, (CATALOGUE.version + 1, VERSION), False),
    ):
        line.hear(beat_of(address, *versions))
        assert line.inbox.panel_matches is matches


BEATS = {address: CATALOGUE.transmitter(Heartbeat, address)
         for address in (Address.OPERATOR, Address.OPERATOR_2)}  # fmt: skip


def beat_of(address: Address, catalogue: int, configuration: int) -> Frame:
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
    lost: int, after_ns: int, cycles: int
) -> None:
    line = Line()
    inbox = line.inbox
    for _ in range(2):  # frames lost before are counted once
        line.now_ns += CYCLE_NS
        line.frame(GOOD[SensorTank])
        inbox.receive(line.frame(GOOD[SensorTank]), line.now_ns)
    before = inbox.tank_cycles
    for _ in range(lost):
        line.frame(GOOD[SensorTank])
    line.now_ns += after_ns
    inbox.receive(line.frame(GOOD[SensorTank]), line.now_ns)
    assert inbox.tank_cycles - before == cycles
    line.now_ns += CYCLE_NS
    inbox.receive(line.frame(GOOD[SensorTank]), line.now_ns)
    assert inbox.tank_cycles - before == cycles + 1


def test_only_what_the_catalogue_does_not_know_is_foreign() -> None:
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

    def __init__(self, gates: SpikeGates | None = None) -> None:
        super().__init__()
        self.inbox = Inbox(CATALOGUE, VERSION, LEVEL_LIMIT_M, gates=gates, redundancy=BOTH)
        self.second = CATALOGUE.transmitter(SensorMotion, Address.SENSORS_2)
        self.hardwired = CATALOGUE.transmitter(HardwiredInputs)

    def motions(self) -> MotionSensors:
        assert self.inbox.motions is not None
        return self.inbox.motions

    def say_2(self, motion: SensorMotion) -> None:
        self.hear(self.second.frame(motion))

    def shown(self) -> tuple[float, float, int]:
        inbox = self.inbox
        return inbox.roll_rad, inbox.roll_rate_rad_s, inbox.motion_ns


def test_of_two_motion_sensors_the_one_in_use_is_shown_and_both_are_kept() -> None:
    line = RedundantLine()
    inbox, motions = line.inbox, line.motions()
    assert motions.used is motions.first
    line.say(SensorMotion(0.1, -0.05, Quality.GOOD))
    first_ns, first = line.now_ns, line.shown()
    assert first == (pytest.approx(0.1), pytest.approx(-0.05), first_ns)
    line.say_2(SensorMotion(0.2, 0.025, Quality.DEGRADED))
    second_ns = line.now_ns
    assert line.shown() == first
    assert (motions.second.roll_rad, motions.second.heard_ns) == (pytest.approx(0.2), second_ns)
    inbox.exchange_motion(motions)
    assert line.shown() == (pytest.approx(0.2), pytest.approx(0.025), second_ns)
    line.say(SensorMotion(0.3, 0.0, Quality.GOOD))
    assert line.shown()[2] == second_ns
    assert (motions.first.roll_rad, motions.first.heard_ns) == (pytest.approx(0.3), line.now_ns)
    line.say_2(SensorMotion(0.4, -0.1, Quality.GOOD))
    assert line.shown() == (pytest.approx(0.4), pytest.approx(-0.1), line.now_ns)


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
def test_what_is_no_measurement_changes_neither_of_two_motion_sensors(
    wrong: SensorMotion, gated: bool, second: bool
) -> None:
    line = RedundantLine(SpikeGates(THRESHOLDS) if gated else None)
    say, sensor = line.say, line.motions().first
    if second:
        line.inbox.exchange_motion(line.motions())
        say, sensor = line.say_2, line.motions().second
    say(SensorMotion(0.1, -0.05, Quality.GOOD))
    kept = (sensor.roll_rad, sensor.roll_rate_rad_s, sensor.heard_ns)
    say(wrong)
    assert (sensor.roll_rad, sensor.roll_rate_rad_s, sensor.heard_ns) == kept == line.shown()


def test_each_of_two_motion_sensors_has_a_gate_of_its_own() -> None:
    gates = SpikeGates(THRESHOLDS)
    line = RedundantLine(gates)
    for say in (line.say, line.say_2):
        say(SensorMotion(0.0, -0.05, Quality.GOOD))
    for times, say in ((1, line.say), (3, line.say_2)):
        for _ in range(times):
            say(SPIKE)
    assert [gate.discarded for gate in gates.motions] == [1, 3]
    assert gates.levels_discarded == 0


def test_the_stream_of_the_motion_sensor_in_use_counts_for_the_protection() -> None:
    line = RedundantLine()
    for message in GOOD.values():
        line.say(message)
    line.say_2(SensorMotion(0.0, 0.0, Quality.GOOD))
    for _ in range(5):
        frame = line.second.frame(SensorMotion(0.0, 0.0, Quality.GOOD))
        line.hear(Frame(frame.can_id, frame.data[:-1] + bytes((frame.data[-1] ^ 1,))))
    assert line.inbox.protection_valid
    line.inbox.exchange_motion(line.motions())
    assert not line.inbox.protection_valid


def test_hard_wired_inputs_are_heard_and_their_stop_acts_out_of_sequence() -> None:
    line = RedundantLine()
    hardwired = line.inbox.hardwired
    shut = HardwiredInputs(Switch.OFF, Switch.OFF, Switch.OFF, Quality.GOOD)
    line.hear(line.hardwired.frame(shut))
    assert (hardwired.heard_ns, hardwired.stop) == (line.now_ns, False)
    assert hardwired.receiver in line.inbox.watched
    line.hardwired.counter += 7
    line.hear(line.hardwired.frame(shut._replace(stop_loop=Switch.ON)))
    assert hardwired.stop


def test_redundant_nodes_have_to_match_and_the_second_sensor_may_be_missing() -> None:
    line = RedundantLine()
    for address in (Address.DRIVE, Address.SENSORS):
        line.beat(address, CATALOGUE.version, VERSION)
    assert not line.inbox.versions_match
    line.beat(Address.HARDWIRED, CATALOGUE.version, VERSION)
    assert line.inbox.versions_match
    beats = CATALOGUE.transmitter(Heartbeat, Address.SENSORS_2)
    beat = Heartbeat(
        NodeState.OPERATIONAL, ResetCause.POWER_ON, 0.0, CATALOGUE.version, VERSION + 1, NAN, NAN
    )
    line.hear(beats.frame(beat))
    strange_ns = line.inbox.second_strange_ns
    assert strange_ns == line.now_ns
    observer = Observer(line.inbox, 250_000, 20 * MS)
    for after_ns, match in ((0, False), (10**9, False), (10**9 + 1, True)):  # silent since
        observer.observe(strange_ns + after_ns, 0)
        assert observer.seen.versions_match is match
    line.hear(beats.frame(beat))
    line.hear(beats.frame(beat._replace(configuration_version=VERSION)))
    observer.observe(line.now_ns, 0)
    assert observer.seen.versions_match
    expected = {CATALOGUE.receiver(Heartbeat, address).can_id
                for address in (Address.HARDWIRED, Address.SENSORS_2)}  # fmt: skip
    assert expected <= line.inbox.expected


@pytest.mark.parametrize("address", [Address.HARDWIRED, Address.SENSORS_2])
def test_addresses_of_redundant_nodes_are_held_once_too(address: Address) -> None:
    line, claims = RedundantLine(), CATALOGUE.transmitter(AddressClaim, address)
    for name, second in ((5, False), (6, True)):
        line.hear(claims.frame(AddressClaim(name)))
        assert (line.inbox.claimed_twice_ns == line.now_ns) is second
