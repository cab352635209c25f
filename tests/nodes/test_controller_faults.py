import math

import numpy as np
import pytest
from controller_bench import CATALOGUE, LIMITS, MS, VERSION, ControllerBench

from utank_hil.base.tick import TICK_NS, TICK_S
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
    OperatorCommand,
    PumpCommand,
    Quality,
    SensorMotion,
    SensorPump,
    SensorTank,
    Switch,
)
from utank_hil.safety.situation import Demand

START_NS = 7_000_000_123
LEVEL = 20e3  # a pressure away from every limit


def motion(**changes):
    return lambda bench: setattr(bench, "motion", bench.motion._replace(**changes))


def spoilt(change):
    """Each frame of the motion sensor is as `change` leaves it."""
    return lambda bench: setattr(
        bench, "spoil", lambda kind, frame: (change(frame) if kind is SensorMotion else frame,)
    )


def stand(bench):
    first = bench.encode(bench.motion)
    bench.send(first)
    spoilt(lambda _: first)(bench)


def flipped(frame):
    return Frame(frame.can_id, frame.data[:3] + bytes([frame.data[3] ^ 0x10]) + frame.data[4:])


# What takes the motion sensor's samples away; each must look like silence.
MOTION_FAULTS = {
    "no roll": motion(roll_rad=math.nan),
    "no rate": motion(roll_rate_rad_s=math.nan),
    "bad quality": motion(quality=Quality.BAD),
    "no quality": motion(quality=None),
    "silence": lambda bench: bench.silent.add(SensorMotion),
    "wrong identifier": spoilt(lambda frame: frame._replace(can_id=frame.can_id + 0x100)),
    "standing counter": stand,
    "flipped bit": spoilt(flipped),
    "short": spoilt(lambda frame: Frame(frame.can_id, frame.data[:6])),
}


@pytest.mark.parametrize("fault", MOTION_FAULTS)
def test_without_good_motion_samples_pressure_is_zero_within_250_ms(fault):
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    bench.motion = SensorMotion(0.02, 0.01, Quality.GOOD)
    bench.run(100)
    rows = len(bench.rows)
    last_good_ns = bench.now_ns - TICK_NS
    MOTION_FAULTS[fault](bench)
    bench.run(2000)
    # five repeated frames are there before the sample is too old
    repeated = fault == "standing counter"
    assert bench.node.fault is (Fault.PROTECTION if repeated else Fault.MOTION_SILENT)
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
def test_fault_of_any_partner_ends_at_zero_and_stays_there(change, fault, within_ms):
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    change(bench)
    began_ns = bench.now_ns
    bench.run(within_ms + 500)
    assert (bench.node.mode, bench.node.fault) == (Mode.FAULT, fault)
    after = [(t, c.pressure_pa) for t, c in bench.commands if t - began_ns >= within_ms * MS]
    assert after
    assert {pressure_pa for _, pressure_pa in after} == {0.0}
    assert bench.status.alarm


@pytest.mark.parametrize("state", [DriveState.FAULT_REACTION_ACTIVE, DriveState.FAULT])
def test_drive_that_brakes_for_a_fault_or_has_it_is_found_by_its_next_status(state):
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    bench.drive_follows, bench.drive_state = False, state
    bench.run(30)  # the cycle of DRIVE_STATUS_1, and a tick
    assert (bench.node.mode, bench.node.fault) == (Mode.FAULT, Fault.DRIVE_FAULT)


def test_stale_levels_halve_the_pressure_before_they_stop_it():
    bench = ControllerBench(START_NS)
    bench.drive_at(LIMITS.pressure_pa)
    bench.silent.add(SensorTank)
    bench.run(600)
    assert bench.node.mode is Mode.ACTIVE
    assert bench.pressure_pa == LIMITS.pressure_pa / 2
    assert bench.status.degraded


@pytest.mark.parametrize(
    "own",
    [
        CATALOGUE.transmitter(PumpCommand).can_id,
        CATALOGUE.transmitter(Heartbeat, Address.CONTROLLER).can_id,
        CATALOGUE.transmitter(AddressClaim, Address.CONTROLLER).can_id,
    ],
)
@pytest.mark.parametrize("data", [bytes(8), b""])
def test_a_second_sender_of_an_own_identifier_stops_until_it_is_silent(own, data):
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    bench.send(Frame(own, data))
    bench.run(40)
    assert bench.node.fault is Fault.ADDRESS_CONFLICT
    assert bench.pressure_pa == 0.0
    bench.order_is(arm=False, mode_request=Mode.STANDBY, reset=True)
    bench.run(400)
    bench.order_is(arm=True, mode_request=Mode.ACTIVE)
    bench.run(400)
    assert bench.node.mode is Mode.FAULT
    assert bench.node.safety.supervisor.reset_refused_by is Fault.ADDRESS_CONFLICT
    bench.order_is(arm=False, reset=False)
    bench.run(9500)
    bench.order_is(reset=True)
    bench.run(600)
    assert bench.node.mode is Mode.STANDBY
    bench.order_is(arm=True, reset=False)
    bench.run(600)
    assert bench.node.mode is Mode.ACTIVE


def test_an_own_identifier_before_arming_is_said_to_be_the_reason():
    bench = ControllerBench(START_NS)
    bench.run(400)
    bench.send(Frame(CATALOGUE.transmitter(PumpCommand).can_id, b""))
    bench.order_is(arm=True, mode_request=Mode.ACTIVE)
    bench.run(9000)
    assert (bench.status.mode, bench.status.fault) == (Mode.INIT, Fault.ADDRESS_CONFLICT)
    bench.run(2000)
    assert bench.node.mode is Mode.STANDBY


@pytest.mark.parametrize("off", [0, 1])
def test_a_panel_of_other_versions_can_not_arm_and_ends_it(off):
    wrong = [CATALOGUE.version, VERSION]
    wrong[off] ^= 1
    bench = ControllerBench(START_NS)
    bench.panel_versions = (wrong[0], wrong[1])
    bench.run(400)
    bench.order_is(arm=True, mode_request=Mode.ACTIVE)
    bench.run(400)
    assert (bench.node.mode, bench.node.fault) == (Mode.STANDBY, Fault.VERSION_MISMATCH)
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    bench.panel_versions = (wrong[0], wrong[1])
    bench.run(400)
    assert (bench.node.mode, bench.node.fault) == (Mode.FAULT, Fault.VERSION_MISMATCH)


def test_lost_link_cuts_at_once_and_comes_back_without_arming():
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


@pytest.mark.parametrize("late_ticks", range(1, 15))
def test_one_overrun_counts_for_every_tick_that_it_missed(late_ticks):
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    # the loop hands over what arrived meanwhile, so nothing is stale
    bench.tick(late_ticks=late_ticks)
    bench.tick()
    assert bench.node.safety.situation.overruns_in_ten == min(late_ticks, 9)
    assert bench.node.fault is (Fault.OVERRUN if late_ticks >= 3 else Fault.NONE)
    stopped = bench.node.safety.supervisor.demand is Demand.ZERO
    assert stopped == (late_ticks >= 5)  # up to 60 ms late


def test_three_overruns_in_ten_ticks_ramp_down_two_do_not():
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


@pytest.mark.parametrize("answer_pa", [math.nan, math.inf, -math.inf])
def test_law_that_fails_stops_the_pump(answer_pa):
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    bench.law.answer_pa = answer_pa
    bench.run(240)
    assert bench.node.fault is Fault.INTERNAL
    assert bench.pressure_pa == 0.0
    assert "reset" in bench.law.calls
    bench.law.answer_pa = LEVEL
    bench.run(500)
    assert bench.pressure_pa == 0.0


def test_law_that_raises_stops_the_pump_until_the_operator_resets():
    bench = ControllerBench(START_NS)
    bench.drive_at(LEVEL)
    step = bench.law.step

    def fail(*_):
        raise ZeroDivisionError("of what")

    bench.law.step = fail
    bench.run(240)
    assert bench.node.fault is Fault.INTERNAL
    assert bench.node.law.error == "ZeroDivisionError: of what"
    assert bench.pressure_pa == 0.0
    bench.law.step = step
    bench.order_is(mode_request=Mode.STANDBY, arm=False)
    bench.run(1000)  # the law answers again, which nobody trusts
    assert bench.node.mode is Mode.FAULT
    bench.law.calls.clear()
    bench.order_is(reset=True)
    bench.run(20)
    assert bench.law.calls[:1] == ["reset"]
    assert bench.node.mode is Mode.STANDBY


def test_a_law_that_fails_gives_no_pressure_in_that_very_tick(monkeypatch):
    bench = ControllerBench()
    bench.drive_at(20e3)

    def fail(*_):
        raise ZeroDivisionError("of what")

    monkeypatch.setattr(bench.law, "step", fail)
    while not bench.node.law.error:
        assert bench.node.command_pa == 20e3
        bench.tick()
    assert bench.node.mode is Mode.ACTIVE  # it is seen in the next tick
    assert bench.node.command_pa == 20e3 - LIMITS.rate_pa_s * TICK_S
    bench.tick()
    assert bench.node.command_pa == 0.0


def test_an_answer_that_was_no_number_once_keeps_nobody_from_arming():
    bench = ControllerBench()
    bench.law.answer_pa = math.nan
    bench.run(400)
    bench.law.answer_pa = 0.0
    bench.arm()
    assert bench.node.law.error == "its answer is nan Pa"


def test_of_several_errors_of_a_law_the_first_is_said(monkeypatch):
    bench = ControllerBench()
    bench.law.answer_pa = math.nan
    bench.run(400)

    def fail(*_):
        raise ZeroDivisionError("of what")

    monkeypatch.setattr(bench.law, "step", fail)
    bench.run(400)
    assert bench.node.law.error == "its answer is nan Pa"


@pytest.mark.parametrize("answer", [[], [1e3, 2e3]])
def test_law_that_answers_too_few_or_too_many_commands_stops_the_pump(answer):
    bench = ControllerBench()
    bench.drive_at(LEVEL)
    bench.law.step = lambda y, reference=None: np.array(answer)
    bench.run(300)
    assert (bench.node.mode, bench.node.fault) == (Mode.FAULT, Fault.INTERNAL)
    assert bench.pressure_pa == 0.0
    assert bench.node.law.error.startswith("ValueError: zip() argument 2 is ")


def test_a_drive_that_has_never_sent_a_command_back_is_silent():
    bench = ControllerBench()
    bench.hear = lambda frames: None
    bench.run(1000)
    assert (bench.node.mode, bench.node.fault) == (Mode.INIT, Fault.DRIVE_SILENT)
