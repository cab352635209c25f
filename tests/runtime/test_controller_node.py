import math
from itertools import pairwise

import numpy as np
import pytest
from controller_bench import (
    CATALOGUE,
    LIMITS,
    MS,
    VERSION,
    VESSEL,
    ControllerBench,
    ToyLaw,
)
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.canbus import (
    Address,
    AddressClaim,
    ControlWord,
    DriveFault,
    DriveState,
    DriveStatus1,
    Fault,
    Frame,
    Heartbeat,
    Mode,
    NodeState,
    OperatorCommand,
    PumpCommand,
    Quality,
    SensorMotion,
    SensorPump,
    SensorTank,
    Switch,
)
from utank_hil.runtime.controller_node import TICK_NS
from utank_hil.runtime.signals import SIGNALS

START_NS = 7_000_000_123
LEVEL = 20e3  # a pressure away from every limit


def test_armed_controller_commands_the_laws_pressure_and_enables_the_drive_in_sequence() -> None:
    bench = ControllerBench(START_NS)
    bench.arm()
    words = [command.control_word for _, command in bench.commands]
    order = list(dict.fromkeys(words))
    assert order == [
        ControlWord.DISABLE_VOLTAGE,
        ControlWord.SHUTDOWN,
        ControlWord.SWITCH_ON,
        ControlWord.ENABLE_OPERATION,
    ]
    bench.law.answer_pa = LEVEL
    bench.run(600)
    assert bench.pressure_pa == LEVEL
    assert bench.status is not None
    assert bench.status.armed
    assert bench.status.configuration_version == VERSION


def test_law_is_stepped_every_sample_time_with_the_newest_sample_armed_or_not() -> None:
    bench = ControllerBench(START_NS)
    for index in range(200):
        bench.motion = SensorMotion(index * 1e-3, 0.0, Quality.GOOD)
        bench.tank = bench.tank._replace(port_level_m=-index * 1e-3, starboard_level_m=index * 3e-3)
        bench.tick()
    stepped = np.array(bench.law.seen)
    assert stepped.shape == (10, 2)
    # steps at ticks 0, 20, 40, ...; the frames of that very tick are heard before
    np.testing.assert_allclose(stepped[:, 0], np.arange(0, 200, 20) * 1e-3, atol=1e-4)
    np.testing.assert_allclose(stepped[:, 1], np.arange(0, 200, 20) * 2e-3, atol=1e-3)


def test_law_is_told_the_mean_of_what_left_before_each_answer() -> None:
    bench = ControllerBench(START_NS)
    bench.arm()
    rng = np.random.default_rng(3)
    for _ in range(400):
        bench.law.answer_pa = float(rng.uniform(-60e3, 60e3))  # beyond the limit too
        bench.tick()
    bench.order_is(mode_request=Mode.PASSIVE, arm=False)
    bench.run(800)
    calls = bench.law.calls
    assert calls == ["step", *["applied", "step"] * (len(calls) // 2)]
    times = np.array([time_ns for time_ns, _ in bench.commands]) - START_NS
    pressures = np.array([command.pressure_pa for _, command in bench.commands])
    for number, told_pa in enumerate(bench.law.told, start=1):
        window = (times >= (number - 1) * 200 * MS) & (times < number * 200 * MS)
        assert window.sum() == 10
        # the limiter moves every tick, a command leaves every other: half a tick's ramp apart
        assert told_pa == pytest.approx(pressures[window].mean(), abs=LIMITS.rate_pa_s * 0.005 + 8)
    assert max(abs(told) for told in bench.law.told) > 20e3


def test_sample_time_off_the_tick_is_refused() -> None:
    with pytest.raises(ValueError, match=r"0\.205 s is not a whole number of ticks"):
        ControllerBench(law=ToyLaw(sample_time_s=0.205))


def test_no_frame_is_early_and_cycles_are_those_of_the_catalogue() -> None:
    bench = ControllerBench(START_NS)
    bench.run(1000)
    times = [time_ns for time_ns, _ in bench.commands]
    assert {later - earlier for earlier, later in pairwise(times)} == {20 * MS}
    for sender, count in (
        (CATALOGUE.transmitter(Heartbeat, Address.CONTROLLER), 10),
        (CATALOGUE.transmitter(AddressClaim, Address.CONTROLLER), 1),
    ):
        assert [frame.can_id for frame in bench.sent].count(sender.can_id) == count


# What takes the motion sensor's samples away; each must look like silence.
def _nan(bench: ControllerBench) -> None:
    bench.motion = SensorMotion(math.nan, 0.0, Quality.GOOD)


def _rate_nan(bench: ControllerBench) -> None:
    bench.motion = SensorMotion(0.0, math.nan, Quality.GOOD)


def _bad_quality(bench: ControllerBench) -> None:
    bench.motion = bench.motion._replace(quality=Quality.BAD)


def _no_quality(bench: ControllerBench) -> None:
    bench.motion = bench.motion._replace(quality=None)


def _silence(bench: ControllerBench) -> None:
    bench.silent.add(SensorMotion)


def _wrong_identifier(bench: ControllerBench) -> None:
    bench.spoil = lambda kind, frame: (
        (frame._replace(can_id=frame.can_id + 0x100),) if kind is SensorMotion else (frame,)
    )


def _standing_counter(bench: ControllerBench) -> None:
    first = bench.encode(bench.motion)
    bench.send(first)
    bench.spoil = lambda kind, frame: (first,) if kind is SensorMotion else (frame,)


def _flipped_bit(bench: ControllerBench) -> None:
    def flip(kind: type, frame: Frame) -> tuple[Frame, ...]:
        if kind is not SensorMotion:
            return (frame,)
        data = bytearray(frame.data)
        data[3] ^= 0x10
        return (Frame(frame.can_id, bytes(data)),)

    bench.spoil = flip


def _short(bench: ControllerBench) -> None:
    bench.spoil = lambda kind, frame: (
        (Frame(frame.can_id, frame.data[:6]),) if kind is SensorMotion else (frame,)
    )


MOTION_FAULTS = [
    _nan, _rate_nan, _bad_quality, _no_quality, _silence, _wrong_identifier, _standing_counter,
    _flipped_bit, _short,
]  # fmt: skip


@pytest.mark.parametrize("fault", MOTION_FAULTS)
def test_without_good_motion_samples_pressure_is_zero_within_250_ms(fault) -> None:
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    bench.motion = SensorMotion(0.02, 0.01, Quality.GOOD)
    bench.run(100)
    rows = len(bench.rows)
    last_good_ns = bench.now_ns - TICK_NS
    fault(bench)
    bench.run(2000)
    assert bench.node.fault is Fault.MOTION_SILENT
    zero_ns = next(t for t, c in bench.commands if t > last_good_ns and c.pressure_pa == 0.0)
    assert zero_ns - last_good_ns <= 250 * MS
    assert all(c.pressure_pa == 0.0 for t, c in bench.commands if t >= zero_ns)
    assert bench.word is ControlWord.DISABLE_VOLTAGE
    # a rejected frame changes no value
    np.testing.assert_allclose(bench.column("roll_rad")[rows:], 0.02, rtol=0, atol=1e-9)
    np.testing.assert_allclose(bench.column("roll_rate_rad_s")[rows:], 0.01, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "fault", "within_ms"),
    [
        (lambda b: b.silent.add(SensorTank), Fault.TANK_SILENT, 2010),
        (lambda b: b.silent.add(SensorPump), Fault.PUMP_SENSOR_SILENT, 2010),
        (lambda b: b.silent.add(DriveStatus1), Fault.DRIVE_SILENT, 90),
        (lambda b: setattr(b, "drive_fault", DriveFault.STALL), Fault.DRIVE_FAULT, 120),
        (lambda b: (setattr(b, "drive_follows", False),
                    setattr(b, "drive_state", DriveState.SWITCHED_ON)), Fault.DRIVE_FAULT, 80),
        (lambda b: (setattr(b, "drive_follows", False),
                    setattr(b, "drive_state", DriveState.FAULT)), Fault.DRIVE_FAULT, 40),
        (lambda b: setattr(b, "tank", b.tank._replace(port_high=Switch.ON)), Fault.LEVEL_LIMIT, 40),
        (lambda b: setattr(b, "tank", b.tank._replace(starboard_high=None)), Fault.LEVEL_LIMIT, 40),
        (lambda b: setattr(b, "tank", b.tank._replace(port_high=Switch.ON, quality=Quality.BAD)),
         Fault.LEVEL_LIMIT, 40),
        (lambda b: setattr(b, "motion", SensorMotion(0.4, 0.0, Quality.GOOD)), Fault.HEEL_LIMIT,
         1020),
        (lambda b: b.silent.add(OperatorCommand), Fault.OPERATOR_SILENT, 6210),
        (lambda b: setattr(b, "versions", (b.versions[0], VERSION + 1)), Fault.VERSION_MISMATCH,
         120),
    ],
)  # fmt: skip
def test_fault_of_any_partner_ends_at_zero_and_stays_there(change, fault, within_ms) -> None:
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    change(bench)
    began_ns = bench.now_ns
    bench.run(within_ms + 500)
    assert (bench.node.mode, bench.node.fault) == (Mode.FAULT, fault)
    after = [(t, c.pressure_pa) for t, c in bench.commands if t - began_ns >= within_ms * MS]
    assert after
    assert {pressure_pa for _, pressure_pa in after} == {0.0}
    assert bench.status is not None
    assert bench.status.alarm


def test_stale_levels_halve_the_pressure_before_they_stop_it() -> None:
    bench = ControllerBench(START_NS)
    bench.drive_at(LIMITS.pressure_pa)
    bench.silent.add(SensorTank)
    bench.run(600)
    assert bench.node.mode is Mode.ACTIVE
    assert bench.pressure_pa == LIMITS.pressure_pa / 2
    assert bench.status is not None
    assert bench.status.degraded


@pytest.mark.parametrize(
    "own",
    [
        CATALOGUE.transmitter(PumpCommand).can_id,
        CATALOGUE.transmitter(Heartbeat, Address.CONTROLLER).can_id,
        CATALOGUE.transmitter(AddressClaim, Address.CONTROLLER).can_id,
    ],
)
def test_a_second_sender_of_an_own_identifier_stops_for_good(own: int) -> None:
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    bench.send(Frame(own, bytes(8)))
    bench.run(40)
    assert bench.node.fault is Fault.ADDRESS_CONFLICT
    assert bench.pressure_pa == 0.0
    bench.order_is(arm=False, mode_request=Mode.STANDBY, reset=True)
    bench.run(400)
    bench.order_is(arm=True, mode_request=Mode.ACTIVE)
    bench.run(400)
    assert bench.node.mode in (Mode.FAULT, Mode.INIT)


def test_lost_link_cuts_at_once_and_comes_back_without_arming() -> None:
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    bench.node.link_error(bench.now_ns, "interface down")
    bench.run(20)
    assert bench.node.fault is Fault.BUS_LOST
    assert bench.pressure_pa == 0.0
    bench.run(1000)  # the panel holds the arm bit all the time
    assert bench.node.mode is Mode.FAULT
    bench.order_is(reset=True)
    bench.run(1000)
    assert bench.node.mode is Mode.STANDBY
    assert {c.pressure_pa for _, c in bench.commands[-100:]} == {0.0}


@pytest.mark.parametrize(("late_ticks", "fault"), [(5, Fault.NONE), (6, Fault.OVERRUN)])
def test_one_long_overrun_stops(late_ticks: int, fault: Fault) -> None:
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    # the loop hands over what arrived meanwhile, so nothing is stale
    bench.tick(late_ticks=late_ticks)
    bench.tick()
    assert bench.node.fault is fault


def test_three_overruns_in_ten_ticks_ramp_down_two_do_not() -> None:
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    for late in (1, 0, 1, 0, 0, 0):
        bench.tick(late_ticks=late)
    assert bench.node.mode is Mode.ACTIVE
    bench.tick(late_ticks=1)
    assert bench.node.fault is Fault.OVERRUN
    assert bench.pressure_pa > 0  # a ramp, not a step
    bench.run(1000)
    assert bench.pressure_pa == 0.0


def test_law_that_fails_stops_the_pump() -> None:
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    bench.law.answer_pa = math.nan
    bench.run(240)
    assert bench.node.fault is Fault.INTERNAL
    assert bench.pressure_pa == 0.0
    assert "reset" in bench.law.calls
    bench.law.answer_pa = LEVEL
    bench.run(500)
    assert bench.pressure_pa == 0.0


def test_last_words_are_zero_pressure_and_quick_stop() -> None:
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    bench.hear(bench.node.stop(bench.now_ns + 3 * MS))
    assert bench.pressure_pa == 0.0
    assert bench.word is ControlWord.QUICK_STOP


def test_operator_may_go_from_active_to_standby_only_down_the_ramp() -> None:
    bench = ControllerBench(START_NS)
    bench.drive_at(LIMITS.pressure_pa)
    bench.order_is(mode_request=Mode.STANDBY, arm=False)
    bench.run(1000)
    pressures = [command.pressure_pa for _, command in bench.commands]
    assert max(abs(b - a) for a, b in pairwise(pressures)) <= LIMITS.rate_pa_s * 0.02 + 8
    assert bench.node.mode is Mode.STANDBY
    assert bench.pressure_pa == 0.0
    assert bench.word is ControlWord.DISABLE_VOLTAGE


def test_drive_fault_is_reset_only_on_the_operators_order() -> None:
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    bench.drive_follows = False
    bench.drive_state, bench.drive_fault = DriveState.FAULT, DriveFault.STALL
    bench.run(1000)
    assert ControlWord.FAULT_RESET not in [command.control_word for _, command in bench.commands]
    bench.order_is(reset=True)
    bench.run(40)
    assert bench.word is ControlWord.FAULT_RESET
    bench.drive_follows, bench.drive_fault = True, DriveFault.NONE
    bench.drive_state = DriveState.SWITCH_ON_DISABLED
    bench.run(500)
    assert bench.node.mode is Mode.STANDBY
    assert bench.word is ControlWord.DISABLE_VOLTAGE


def test_telemetry_tells_what_was_heard_commanded_and_decided() -> None:
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    bench.motion = SensorMotion(0.0123, -0.02, Quality.GOOD)
    bench.tank = bench.tank._replace(port_level_m=-0.25, starboard_level_m=0.5)
    bench.pump = SensorPump(16e3, 2.0, Quality.DEGRADED)
    bench.run(20)
    row = dict(zip(SIGNALS, bench.rows[-1], strict=True))
    assert row["time_s"] == pytest.approx((bench.now_ns - TICK_NS - START_NS) * 1e-9)
    assert row["roll_rad"] == pytest.approx(0.0123)
    assert row["roll_rate_rad_s"] == pytest.approx(-0.02)
    assert (row["port_level_m"], row["starboard_level_m"]) == (-0.25, 0.5)
    assert row["pressure_command_pa"] == LEVEL
    assert row["pressure_actual_pa"] == 16e3
    assert row["pump_power_w"] == pytest.approx(12e3)
    assert row["mode"] == Mode.ACTIVE
    assert row["fault"] == Fault.NONE
    assert len(bench.rows) == round(bench.ms / 10)
    np.testing.assert_allclose(np.diff(bench.column("time_s")), 0.01, atol=1e-9)


def test_bus_load_is_what_was_heard_and_said_over_the_time_it_took() -> None:
    bench = ControllerBench(START_NS)
    bench.run(2000)
    # sent a second: 100 + 50 + 50 + 50 + 10 + 2 x 10 + 5 by the others, 50 + 10 + 10 by the node
    expected = 355 * 143 / 250e3
    assert bench.column("bus_load")[-1] == pytest.approx(expected, rel=0.02)
    for _ in range(100):  # every other tick is skipped, so that a window takes two seconds
        bench.tick(late_ticks=1)
    bench.tick()
    assert bench.column("bus_load")[-1] == pytest.approx(expected / 2, rel=0.05)


orders = st.builds(
    OperatorCommand,
    mode_request=st.sampled_from([Mode.STANDBY, Mode.PASSIVE, Mode.ACTIVE, Mode.ACTIVE, None]),
    arm=st.booleans(),
    stop=st.sampled_from([False, False, False, True]),
    reset=st.booleans(),
    acknowledge=st.booleans(),
)
events = st.one_of(
    orders,
    st.floats(-80e3, 80e3),
    st.sampled_from([SensorMotion, SensorTank, SensorPump, DriveStatus1, OperatorCommand]),
    st.just("all well"),
    st.builds(
        SensorTank,
        port_level_m=st.floats(-4, 4),
        starboard_level_m=st.floats(-4, 4),
        port_high=st.sampled_from([Switch.OFF, Switch.OFF, Switch.ON, None]),
        starboard_high=st.just(Switch.OFF),
        quality=st.sampled_from([*Quality, None]),
    ),
)

STOP_CLASS = {
    Fault.BUS_LOST, Fault.ADDRESS_CONFLICT, Fault.VERSION_MISMATCH, Fault.DRIVE_FAULT,
    Fault.DRIVE_SILENT, Fault.LEVEL_LIMIT, Fault.INTERNAL, Fault.OVERRUN, Fault.BUS_OVERLOAD,
}  # fmt: skip


@given(st.lists(st.tuples(events, st.integers(1, 40)), max_size=15))
def test_pressure_only_while_armed_and_never_faster_than_the_rate_limit(history) -> None:
    bench = ControllerBench(START_NS)
    bench.arm()
    bench.law.answer_pa = 40e3
    bench.run(300)
    modes: list[Mode] = []  # since the last command
    for event, ticks in history:
        if isinstance(event, OperatorCommand):
            bench.order_is(**event._asdict())
        elif isinstance(event, float):
            bench.law.answer_pa = event
        elif isinstance(event, SensorTank):
            bench.tank = event
        elif isinstance(event, type):
            bench.silent.add(event)
        else:
            bench.silent.clear()
            bench.tank = SensorTank(0.0, 0.0, Switch.OFF, Switch.OFF, Quality.GOOD)
        for _ in range(ticks):
            before, mode_before, count = bench.pressure_pa, bench.node.mode, len(bench.commands)
            bench.tick()
            mode, fault, pressure_pa = bench.node.mode, bench.node.fault, bench.pressure_pa
            modes.append(mode)
            assert abs(pressure_pa) <= LIMITS.pressure_pa
            if mode is Mode.ACTIVE and mode_before is not Mode.ACTIVE:
                assert bench.order.arm
            if len(bench.commands) == count:
                continue
            if mode in (Mode.INIT, Mode.STANDBY):
                assert pressure_pa == 0.0
            if abs(pressure_pa - before) > LIMITS.rate_pa_s * 0.02 + 8:
                # only a cut may be faster
                assert pressure_pa == 0.0
                off = bench.tank.port_high is Switch.OFF and bench.tank.starboard_high is Switch.OFF
                assert (
                    bench.order.stop
                    or fault in STOP_CLASS
                    or (mode is Mode.FAULT and (not off or DriveStatus1 in bench.silent))
                    or fault is Fault.MOTION_SILENT  # what its ramp left after 200 ms
                    or Mode.INIT in modes  # disarmed, and then not even ready
                )
            modes.clear()


@pytest.mark.parametrize("index", range(len(SIGNALS)))
def test_every_signal_is_finite_from_the_first_row(index: int) -> None:
    bench = ControllerBench()
    bench.tick()
    assert math.isfinite(bench.rows[0][index])


def test_heartbeat_tells_the_fault() -> None:
    bench = ControllerBench(START_NS)
    beats = CATALOGUE.receiver(Heartbeat, Address.CONTROLLER)
    bench.drive_at(LEVEL)
    bench.node.link_error(bench.now_ns, "interface down")
    bench.run(200)
    heard = [beats.accept(frame) for frame in bench.sent if frame.can_id == beats.can_id]
    assert heard[-1] is not None
    assert heard[-1].state is NodeState.FAULT
    assert VESSEL.version == VERSION == heard[-1].configuration_version
