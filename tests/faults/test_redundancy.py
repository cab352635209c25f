"""A ship with a second motion sensor and hard-wired inputs: no broken node alone goes unseen."""

import math
import random
from functools import cache

import pytest
from fault_bench import ARMED, MS, SECOND, Failing, altered, dropped, storm
from quay import ARM_S, commissioned, controller

from firmware_sim.ship_side import ShipSide, build_ship_side
from utank_hil.assembly import build_controller_node
from utank_hil.canbus import (
    Address,
    Fault,
    HardwiredInputs,
    Mode,
    Quality,
    SensorMotion,
    SensorTank,
    Switch,
    load_catalogue,
)
from utank_hil.nodes.commissioning.node import CommissioningNode, Stage
from utank_hil.nodes.redundancy import Redundancy
from utank_hil.runners import Lockstep

CATALOGUE = load_catalogue()
T0_S = 12.0
T0 = round(T0_S * SECOND)
PERIOD_S = 10.7
BOTH = Redundancy(second_motion_sensor=True, hardwired_inputs=True)


@cache
def config(redundancy=BOTH, name="gpc"):
    given = storm().controllers[name]
    vessel = given.vessel.model_copy(update={"redundancy": redundancy})
    return given.model_copy(update={"vessel": vessel})


@cache
def scenario(redundancy=BOTH):
    controllers = {"gpc": config(redundancy)}
    return storm().model_copy(
        update={"vessel": controllers["gpc"].vessel, "controllers": controllers}
    )


class Bench:
    """The storm with the ship's redundant nodes, each behind a `Failing`."""

    def __init__(self, redundancy=BOTH):
        self.ship: ShipSide = build_ship_side(scenario(redundancy), 1, ARMED)
        self.node = build_controller_node(config(redundancy), commissioned=True)
        self.failing = {node.name: Failing(node) for node in (*self.ship.nodes, self.node)}
        self.lockstep = Lockstep([*self.failing.values()])
        self.degraded: set[Fault] = set()

    @property
    def used(self):
        """Place of the motion sensor in use."""
        return self.node.safety._motion

    def fail(self, name, spoil, begin_ns=T0):
        self.failing[name].begin_ns = begin_ns
        self.failing[name].spoil = spoil

    def run(self, until_s):
        self.lockstep.run_until(round(until_s * SECOND))

    def run_to_fault(self, until_s):
        """Run to FAULT; when it was."""
        while self.node.mode is not Mode.FAULT and self.lockstep.now_ns < until_s * SECOND:
            self.lockstep.run_until(self.lockstep.now_ns + 10 * MS)
        assert self.node.mode is Mode.FAULT
        return self.lockstep.now_ns * 1e-9


def motion(change, address=None):
    """What a motion sensor sends instead of roll and rate."""
    receiver = CATALOGUE.receiver(SensorMotion, address)
    transmitter = CATALOGUE.transmitter(SensorMotion, address)

    def alter(frame):
        if frame.can_id != receiver.can_id:
            return (frame,)
        message = receiver.accept(frame)
        transmitter.counter = frame.data[1] - 1
        roll_rad, rate_rad_s = change(message.roll_rad, message.roll_rate_rad_s)
        return (transmitter.frame(SensorMotion(roll_rad, rate_rad_s, Quality.GOOD)),)

    return alter


def test_in_health_the_first_sensor_is_used_and_nothing_is_degraded():
    bench = Bench()
    degraded = False
    while bench.lockstep.now_ns < 60 * SECOND:
        bench.run(bench.lockstep.now_ns * 1e-9 + 1.0)
        degraded |= bench.node.safety.supervisor.degraded
    assert bench.node.mode is Mode.ACTIVE
    assert not degraded
    assert bench.used == 0


@pytest.mark.parametrize("first", [True, False])
def test_one_silent_motion_sensor_leaves_the_other(first):
    bench = Bench()
    bench.fail("sensors" if first else "sensors_2", dropped(SensorMotion) if first else dropped())
    bench.run(T0_S + 5.0)
    assert bench.used == int(first)
    assert bench.node.mode is Mode.ACTIVE
    assert not bench.node.safety.supervisor.degraded  # as a ship that has one sensor
    assert Fault.MOTION_SILENT in {alarm.code for alarm in bench.ship.panel.alarms}
    assert bench.node.motion.roll_rad == pytest.approx(bench.ship.plant.roll_rad, abs=0.01)


def test_both_silent_end_it_in_time():
    bench = Bench()
    bench.fail("sensors", dropped(SensorMotion))
    bench.fail("sensors_2", dropped(), T0 + SECOND)
    found_s = bench.run_to_fault(T0_S + 3.0) - T0_S - 1.0
    assert bench.node.fault is Fault.MOTION_SILENT
    assert found_s <= 0.05 + 1e-9
    bench.run(T0_S + 1.0 + 0.26)  # the tick at 250 ms included
    assert bench.node.command_pa == 0.0


def noisy(times):
    draw = random.Random(1).gauss
    return lambda roll, rate: (roll + draw(0, times * 2e-4), rate + draw(0, times * 5e-4))


def held():
    kept: list[tuple[float, float]] = []

    def change(roll, rate):
        kept.append((roll, rate))
        return kept[0]

    return change


WRONG = {
    "flipped": lambda roll, rate: (-roll, -rate),
    "roll flipped": lambda roll, rate: (-roll, rate),
    "rate flipped": lambda roll, rate: (roll, -rate),
    "noisy": noisy(20.0),
    "in degrees": lambda roll, rate: (3 * roll, 3 * rate),
}


@pytest.mark.evidence(
    "noisy-sensors", "in degrees-sensors", "a degree apart-sensors", "a degree apart-sensors_2"
)
@pytest.mark.parametrize(
    ("wrong", "name"),
    [  # the noise of one that is not in use is no difference
        (wrong, name)
        for wrong in (*WRONG, "both stuck", "a degree apart")
        for name in ("sensors", "sensors_2")
        if (wrong, name) != ("noisy", "sensors_2")
    ],
)
def test_where_the_two_disagree_the_pressure_falls_to_zero(wrong, name):
    """Within the roll that a wrong sensor may do: nobody knows which one is wrong."""
    change = WRONG.get(wrong) or (
        held() if wrong == "both stuck" else lambda roll, rate: (roll + 0.0175, rate)
    )
    bench = Bench()
    bench.fail(name, motion(change, Address.SENSORS_2 if name == "sensors_2" else None))
    found_s = bench.run_to_fault(T0_S + PERIOD_S) - T0_S
    # whatever else speaks against the one in use is as good a reason
    assert bench.node.fault in (Fault.SENSORS_DISAGREE, Fault.DRIFT, Fault.SPIKES)
    assert found_s <= PERIOD_S / 4
    bench.run(T0_S + found_s + 1.1)
    assert bench.node.command_pa == 0.0


def test_gauges_that_are_swapped_are_no_reason_to_change_the_motion_sensor():
    bench = Bench()

    def swap(tank):
        return tank._replace(
            port_level_m=tank.starboard_level_m, starboard_level_m=tank.port_level_m
        )

    bench.fail("sensors", altered(SensorTank, swap), 0)
    bench.run_to_fault(40.0)
    assert bench.node.fault in (Fault.MOTION_SIGN_FLIP, Fault.SIGN_FLIP, Fault.STUCK_SIGNAL)
    assert bench.used == 0


def test_one_broken_node_cannot_hide_both_gauge_and_switch():
    def broken(tank):
        return SensorTank(0.0, 0.0, Switch.OFF, Switch.OFF, Quality.GOOD)

    bench = Bench()
    bench.fail("sensors", altered(SensorTank, broken), T0)
    limit_m = scenario().sensors.high_level_m
    plant = bench.ship.plant
    bench.run(T0_S)
    # the water is driven over the switch, whatever the monitors would have said before
    bench.node.safety.monitors = None
    assert bench.node.mode is Mode.ACTIVE
    while abs(plant.level_m) <= limit_m and bench.lockstep.now_ns < 600 * SECOND:
        bench.lockstep.run_until(bench.lockstep.now_ns + 10 * MS)
    high_ns = bench.lockstep.now_ns
    assert not bench.node.measured.high_level  # the gauges' node hides it
    bench.run_to_fault(high_ns * 1e-9 + 1.0)
    assert bench.node.fault is Fault.LEVEL_LIMIT
    assert bench.lockstep.now_ns - high_ns <= 120 * MS
    assert bench.node.command_pa == 0.0


def test_the_hard_wired_stop_ends_it_at_once_and_holds_the_reset():
    bench = Bench()
    hardwired = bench.ship.hardwired
    bench.run(T0_S)
    assert bench.node.mode is Mode.ACTIVE
    hardwired.stop_pressed = True
    found_s = bench.run_to_fault(T0_S + 1.0) - T0_S
    assert bench.node.fault is Fault.HARDWIRED_STOP
    assert found_s <= 0.07  # its cycle and two ticks
    assert bench.node.command_pa == 0.0


def test_a_stop_that_is_let_go_before_the_next_look_is_heard():
    node = build_controller_node(config(), commissioned=True)
    transmitter = CATALOGUE.transmitter(HardwiredInputs)
    shut = HardwiredInputs(Switch.OFF, Switch.OFF, Switch.OFF, Quality.GOOD)
    for stop in (Switch.OFF, Switch.ON, Switch.OFF):
        node.receive(transmitter.frame(shut._replace(stop_loop=stop)), 0)
    node.tick(10 * MS)
    assert node.measured.hardwired_stop
    node.tick(20 * MS)
    assert not node.measured.hardwired_stop


@pytest.mark.parametrize("switch", [Switch.ON, Switch.ERROR, None])
def test_a_stop_loop_that_is_not_shut_acts_out_of_sequence_and_in_bad_quality(switch):
    node = build_controller_node(config(), commissioned=True)
    transmitter = CATALOGUE.transmitter(HardwiredInputs)
    shut = HardwiredInputs(Switch.OFF, Switch.OFF, Switch.OFF, Quality.GOOD)
    for tick in range(3):
        node.receive(transmitter.frame(shut), tick * 50 * MS)
    hardwired = node.inbox.hardwired
    assert not hardwired.stop
    transmitter.counter += 7
    bad = HardwiredInputs(Switch.OFF, Switch.OFF, switch, Quality.BAD)
    node.receive(transmitter.frame(bad), 200 * MS)
    assert hardwired.stop
    assert hardwired.heard_ns == 100 * MS
    for tick in range(4, 8):
        node.receive(transmitter.frame(shut), tick * 50 * MS)
    assert not hardwired.stop


def test_silent_hard_wired_inputs_end_it_and_are_waited_for():
    bench = Bench()
    bench.fail("hardwired", dropped())
    found_s = bench.run_to_fault(T0_S + 1.0) - T0_S
    assert bench.node.fault is Fault.HARDWIRED_SILENT
    assert found_s <= 0.21
    bench = Bench()
    bench.fail("hardwired", dropped(HardwiredInputs), 0)
    bench.run(3.0)
    assert (bench.node.mode, bench.node.fault) == (Mode.INIT, Fault.HARDWIRED_SILENT)


def test_a_second_motion_sensor_of_another_version_keeps_it_from_arming():
    bench = Bench()
    node = bench.failing["sensors_2"].node
    node._housekeeping._configuration_version += 1
    bench.run(3.0)
    assert (bench.node.mode, bench.node.fault) == (Mode.INIT, Fault.VERSION_MISMATCH)


def test_a_ship_with_redundancy_is_another_configuration_and_one_without_is_as_before():
    without, both = config(Redundancy()).vessel, config().vessel
    assert without.version == storm().vessel.version
    versions = {
        config(Redundancy(*each)).vessel.version
        for each in ((False, False), (True, False), (False, True), (True, True))
    }
    assert len(versions) == 4
    assert both.version != without.version


@pytest.mark.evidence
def test_commissioning_checks_the_second_sensor_against_the_first():
    naval = controller("naval_constrained_gpc")
    vessel = naval.vessel.model_copy(update={"redundancy": BOTH})
    naval = naval.model_copy(update={"vessel": vessel})
    node = commissioned(naval)
    assert all(check.passed for check in node.checks())
    assert {"roll_2_zero", "roll_rate_2_zero", "roll_2", "roll_rate_2"} <= {
        check.name for check in node.checks()
    }
    wrong = motion(lambda roll, rate: (-roll, -rate), Address.SENSORS_2)
    node = commissioned(naval, spoil={"sensors_2": wrong})
    assert [check.name for check in node.checks() if not check.passed] == ["roll_2"]


def naval_with_both():
    naval = controller("naval_constrained_gpc")
    vessel = naval.vessel.model_copy(update={"redundancy": BOTH})
    return naval.model_copy(update={"vessel": vessel})


@pytest.mark.evidence("<lambda>-roll_2_zero", "<lambda>-roll_rate_2_zero")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("wrong", "check"),
    [
        (lambda roll, rate: (1.08 * roll, 1.08 * rate), "roll_2"),
        (lambda roll, rate: (roll + math.radians(0.6), rate), "roll_2_zero"),
        (lambda roll, rate: (roll, rate + math.radians(0.04)), "roll_rate_2_zero"),
    ],
)
def test_commissioning_finds_each_error_of_the_second_sensor(wrong, check):
    node = commissioned(naval_with_both(), spoil={"sensors_2": motion(wrong, Address.SENSORS_2)})
    assert [each.name for each in node.checks() if not each.passed] == [check]


@pytest.mark.slow
def test_commissioning_ends_where_the_second_sensor_falls_silent_during_the_pulses():
    begin_ns = round((ARM_S + 8.0) * SECOND)
    node = commissioned(naval_with_both(), spoil={"sensors_2": dropped()}, begin_ns=begin_ns)
    assert node.ended.startswith("A motion sensor is silent.")


def test_a_sensor_that_falls_silent_in_the_tick_of_active_ends_the_commissioning(monkeypatch):
    said = "A motion sensor is silent."

    def missing(node):
        return said if node.node.mode is Mode.ACTIVE else ""

    monkeypatch.setattr(CommissioningNode, "missing", property(missing))
    node = commissioned(naval_with_both())
    assert (node.stage, node.ended) == (Stage.DONE, said)


@pytest.mark.evidence("-1.0")
@pytest.mark.slow
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_commissioning_ends_where_the_level_goes_too_far_to_either_side(sign):
    far = altered(
        SensorTank,
        lambda tank: tank._replace(port_level_m=-sign * 1.0, starboard_level_m=sign * 1.0),
    )
    begin_ns = round((ARM_S + 8.0) * SECOND)
    node = commissioned(naval_with_both(), spoil={"sensors": far}, begin_ns=begin_ns)
    assert node.ended.startswith("The level went")
