"""Commissioning in lockstep: a ship that is as her files say passes; whatever is not is named."""

import math
import random
import tracemalloc
from collections.abc import Iterable
from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from fault_bench import SECOND, Failing, FaultBench, altered, dropped
from quay import ARM_S, another_ship, commissioned, controller, still_water

from firmware_sim import plant_kernel as kernel
from firmware_sim.scenario_sea import RegularSea
from firmware_sim.ship_side import build_ship_side
from utank_hil.assembly import build_commissioning_node, build_controller_node, build_law
from utank_hil.base.arrays import FloatArray
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import (
    DriveFault,
    DriveState,
    Fault,
    Frame,
    Mode,
    PumpCommand,
    SensorMotion,
    SensorPump,
    SensorTank,
    Switch,
)
from utank_hil.canbus.events import AlarmEvent, RetuningEvent
from utank_hil.canbus.frame import STANDARD
from utank_hil.canbus.profiles.drive_plan import SENT_2
from utank_hil.configuration.devices import DevicesSection
from utank_hil.nodes.commissioning.checks import RATE_SCALE
from utank_hil.nodes.commissioning.node import PUSH_S, REST_S, Stage
from utank_hil.nodes.commissioning.precision import SCALE, times_needed
from utank_hil.nodes.commissioning.pulses import ROW_S, plan_pulses
from utank_hil.nodes.commissioning.remedies import Each, remedies_of
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.nodes.redundancy import Redundancy
from utank_hil.runners import Lockstep, SimulatedBus
from utank_hil.runners.lockstep import with_more
from utank_hil.telemetry.events import event_text
from utank_hil.telemetry.frame_log import RECORD
from utank_hil.telemetry.node_tap import NodeTap
from utank_hil.telemetry.replay import entries_of, replay

NAVAL = controller("naval_constrained_gpc")
LEVELS = ("port_level_m", "starboard_level_m")
SIDES = ("port_level", "starboard_level")
MOTION = ("roll_rad", "roll_rate_rad_s")

Record = dict[str, FloatArray]


@pytest.fixture(scope="module")
def healthy():
    return commissioned(NAVAL)


def failed(node):
    """Checks that failed, with their remedies."""
    return {check.name: check.remedy for check in node.checks() if not check.passed}


@pytest.mark.evidence("gpc", "naval_constrained_gpc", "patti_b_constrained_gpc")
@pytest.mark.parametrize(
    "name", ["gpc", "naval_constrained_gpc", "patti_b_constrained_gpc", "pump_with_valve"]
)
def test_every_shipped_ship_passes_with_room_to_spare(name):
    node = commissioned(controller(name), seed=2)
    assert node.stage is Stage.DONE
    assert not node.ended
    checks = node.checks()
    assert len(checks) == (20 if name == "pump_with_valve" else 18)
    for check in checks:
        assert abs(check.measured - check.expected) <= 0.5 * check.tolerance, check


def scaled(names, factor):
    return lambda record: {
        name: factor * column if name in names else column for name, column in record.items()
    }


def shifted(name, offset):
    return lambda record: {**record, name: record[name] + offset}


def swapped(record):
    port, starboard = (record[name] for name in LEVELS)
    return {**record, "port_level_m": starboard, "starboard_level_m": port}


def noisy(record, noise_m):
    more = np.random.default_rng(81).normal(size=(2, len(record["roll_rad"])))
    return {
        **record,
        **{name: record[name] + noise_m * each for name, each in zip(LEVELS, more, strict=True)},
    }


def test_noise_of_the_gauges_biases_no_scale(healthy, monkeypatch):
    """Least squares alone find 1.2 for either gauge, and 0.2 for the roll."""
    monkeypatch.setattr(healthy, "rest", noisy(healthy.rest, 0.008))
    monkeypatch.setattr(healthy, "moved", noisy(healthy.moved, 0.008))
    scales = {check.name: check.measured for check in healthy.checks()}
    assert [scales[name] for name in SIDES] == pytest.approx([1.0, 1.0], abs=0.06)
    assert scales["roll"] == pytest.approx(1.0, abs=0.3)


def test_pulses_go_on_for_as_long_as_the_gauges_are_noisy(healthy, monkeypatch):
    once = healthy.length_s
    plan = plan_pulses(NAVAL.plant)
    assert times_needed(healthy.rest, plan.of_noise) < 2
    times = times_needed(noisy(healthy.rest, 0.012), plan.of_noise)
    assert 8 < times < plan.most_times
    assert replace(plan, times=math.ceil(times)).duration_s > 4 * once
    monkeypatch.setattr(healthy, "rest", noisy(healthy.rest, 0.025))
    assert "noise" in failed(healthy)


# no measurement steers the pump: what a wrong sensor would have shown follows from a good record
@pytest.mark.parametrize(
    ("wrong", "names", "word"),
    [
        (swapped, {"port_level", "starboard_level"}, "port and starboard are swapped"),
        (scaled(LEVELS[:1], -1), {"port_level"}, "Only the port gauge counts downwards"),
        (scaled(LEVELS[1:], -1), {"starboard_level"}, "Only the starboard gauge counts downwards"),
        (scaled(LEVELS[1:], 0), {"starboard_level"}, "does not move"),
        (scaled(LEVELS[:1], 1.4), {"port_level"}, "Correct the port gauge's scaling"),
        (scaled(LEVELS, 0.7), {"port_level", "starboard_level"}, "gauge's scaling"),
        (scaled(MOTION, -1), {"roll"}, "Turn the motion sensor round"),
        (scaled(MOTION[:1], -1), {"roll", "roll_rate"}, "The roll has the wrong sign"),
        (scaled(MOTION[1:], -1), {"roll_rate"}, "The roll rate has the wrong sign"),
        (scaled(MOTION[1:], 180 / np.pi), {"roll_rate"}, "scaling of the roll rate"),
        (scaled(MOTION[1:], 0.9), {"roll_rate"}, "Correct the scaling of the roll rate"),
        (scaled(MOTION[1:], 1.05), {"roll_rate"}, "Correct the scaling of the roll rate"),
        (scaled(LEVELS, 1.1), {"port_level", "starboard_level"}, "gauge's scaling"),
        (scaled(("pressure_pa",), 0.9), {"pressure", "port_level", "starboard_level"},
         "correct the pressure sensor's scaling"),
        (scaled(MOTION, 2), {"roll"}, "Correct the roll's scaling"),
        (scaled(MOTION, 0), {*SIDES, "roll", "roll_rate", "roll_period"},
         "The motion sensor shows no"),
        (scaled(("pressure_pa",), -1), {"pressure", *(f"{x}_level" for x in ("port", "starboard")),
                                        "roll"}, "exchange its sides"),
        (scaled(("pressure_pa",), 0.5), {"pressure", "port_level", "starboard_level", "roll"},
         "correct the pressure sensor's scaling"),
        (shifted("port_level_m", 0.05), {"port_level_zero", "water_heel"},
         "Set the port gauge's zero"),
        (shifted("roll_rad", 0.03), {"roll_zero", "port_level_zero", "starboard_level_zero",
                                    "water_heel"},
         "mount the motion sensor level"),
        (shifted("roll_rate_rad_s", 0.01), {"roll_rate_zero"}, "zero of the gyroscope"),
        (shifted("roll_rad", 0.005), {"water_heel"}, "zeros of motion sensor, gauges and pressure"),
        (shifted("pressure_pa", 600), {"pressure_zero", "water_heel"},
         "Set the pressure sensor's zero"),
        (shifted("high_level", 1.0), {"high_level_switches"}, "Check the switches"),
    ],
)  # fmt: skip
def test_a_wrong_sensor_fails_its_own_checks_with_its_remedy(
    healthy, monkeypatch, wrong, names, word
):
    assert not failed(healthy)
    monkeypatch.setattr(healthy, "rest", wrong(dict(healthy.rest)))
    monkeypatch.setattr(healthy, "moved", wrong(dict(healthy.moved)))
    found = failed(healthy)
    assert set(found) == names
    assert word in found[min(names, key=list(found).index)]


@pytest.mark.evidence("0.6-blockage", "0.0-no pressure")
@pytest.mark.parametrize(("factor", "word"), [(-1.0, "pushes to port"), (0.6, "blockage"),
                                              (0.0, "no pressure")])  # fmt: skip
def test_a_pump_that_turns_the_other_way_is_weak_or_stalled_is_named(factor, word):
    def wrong(command):
        return command._replace(pressure_pa=factor * command.pressure_pa)

    found = failed(commissioned(NAVAL, spoil={"controller": altered(PumpCommand, wrong)}))
    assert word in found.pop("pressure")
    assert bool(found) is (factor == 0.0)


@pytest.mark.evidence
def test_a_pressure_sensor_that_sends_nothing_but_zero_is_named():
    def dead(pump):
        return pump._replace(pressure_pa=0.0)

    found = failed(commissioned(NAVAL, spoil={"sensors": altered(SensorPump, dead)}))
    assert "no pressure" in found["pressure"]


def test_another_tank_and_another_loading_fail_by_their_periods():
    vessel = NAVAL.vessel
    shorter = replace(vessel.tank, duct_area_m2=1.4 * vessel.tank.duct_area_m2)
    found = failed(commissioned(NAVAL, nodes=another_ship(NAVAL, vessel.ship, shorter)))
    assert set(found) == {"tank_period"}
    tender = replace(vessel.ship, stiffness_nm_rad=0.7 * vessel.ship.stiffness_nm_rad)
    node = commissioned(NAVAL, nodes=another_ship(NAVAL, tender, vessel.tank))
    assert set(failed(node)) == {"roll_period"}
    measured = next(check.measured for check in node.checks() if check.name == "roll_period")
    truth_s = 2 * np.pi / tender.natural_frequency_rad_s
    assert measured == pytest.approx(truth_s, rel=0.05)


def test_a_list_that_gauges_and_motion_sensor_agree_on_is_named_by_the_roll_alone():
    vessel = NAVAL.vessel
    heeled = replace(vessel.ship, offset_moment_nm=0.03 * vessel.ship.stiffness_nm_rad)
    node = commissioned(NAVAL, nodes=another_ship(NAVAL, heeled, vessel.tank))
    # she starts upright, and is not at rest yet
    assert set(failed(node)) == {"roll_zero", "roll_rate_zero", "roll_still", "level_still"}
    assert not node.moved  # nothing was pushed
    assert node.node.mode is not Mode.ACTIVE


def test_a_ship_that_moves_by_herself_is_not_pushed():
    scenario = still_water(NAVAL).model_copy(
        update={"sea": RegularSea(kind="regular", amplitude_m=0.02, period_s=5.6)}
    )
    nodes = build_ship_side(scenario, 1, scenario.operator).nodes
    node = commissioned(NAVAL, nodes=nodes)
    assert "roll_still" in failed(node)
    assert not node.moved


def test_pulses_stay_within_their_bounds_and_the_pump_ends_at_zero(healthy):
    plan, limits = plan_pulses(NAVAL.plant), NAVAL.limits
    assert plan.pressure_pa <= 0.12 * limits.pressure_pa
    assert plan.level_m <= 0.2 * limits.level_m
    assert plan.roll_rad <= 0.035
    record = healthy.moved
    push = round(PUSH_S / ROW_S) + 1
    assert np.abs(record["command_pa"][:-push]).max() == pytest.approx(plan.pressure_pa)
    assert record["command_pa"].max() == pytest.approx(plan.push_pa)
    assert plan.push_pa <= 0.12 * limits.pressure_pa
    level_m = np.abs(record["starboard_level_m"] - record["port_level_m"]).max() / 2
    assert level_m == pytest.approx(plan.level_m, rel=0.15)
    assert healthy.node.command_pa == 0.0


class LeavesTicksOut:
    """A commissioning of whose ticks the loop leaves some out, by their number."""

    name = "controller"

    def __init__(self, node, leaves_out):
        self.period_ns = node.period_ns
        self.receive = node.receive
        self._node = node
        self._leaves_out = leaves_out

    def tick(self, now_ns):
        return () if self._leaves_out(now_ns // TICK_NS) else self._node.tick(now_ns)


def test_a_loop_held_up_measures_the_zeros_anew():
    node = build_commissioning_node(NAVAL)
    scenario = still_water(NAVAL)
    ship = build_ship_side(scenario, 1, scenario.operator).nodes
    # three seconds of the twenty
    lockstep = Lockstep([*ship, LeavesTicksOut(node, lambda tick: 1000 <= tick < 1300)])
    lockstep.run_until(round((REST_S + 2.0) * SECOND))
    assert node.stage is Stage.REST
    lockstep.run_until(round((13.0 + REST_S + 1.0) * SECOND))
    assert node.stage is Stage.ARM
    assert len(node.rest["roll_rad"]) == pytest.approx(REST_S / ROW_S, abs=1)


def test_pulses_end_where_the_loop_is_held_up():
    node = build_commissioning_node(NAVAL)
    scenario = still_water(NAVAL)
    ship = build_ship_side(scenario, 1, scenario.operator).nodes
    first = round((ARM_S + 5.0) * 100)
    out = range(first, first + 15)
    lockstep = Lockstep([*ship, LeavesTicksOut(node, lambda tick: tick in out)])
    lockstep.run_until(round((ARM_S + 6.0) * SECOND))
    assert node.stage is Stage.DONE
    assert node.ended.startswith(("DRIVE_FAULT", "OVERRUN"))


@pytest.mark.evidence
def test_ticks_that_the_loop_leaves_out_leave_out_no_check():
    config = controller("pump_with_valve")
    node = build_commissioning_node(config)
    scenario = still_water(config)
    ship = build_ship_side(scenario, 1, scenario.operator).nodes
    lockstep = Lockstep([*ship, LeavesTicksOut(node, lambda tick: tick % 10 == 0)])
    while node.stage is not Stage.DONE and lockstep.now_ns < 100 * SECOND:
        lockstep.run_until(lockstep.now_ns + SECOND)
    assert not node.ended
    checks = node.checks()
    assert len(checks) == 20
    assert all(check.passed for check in checks)
    # the stage ended when its time was over, with a row for each 50 ms of it
    assert len(node.moved["roll_rad"]) == pytest.approx(node.length_s / ROW_S, abs=1)


class HeldUp(Failing):
    """Holds an inclinometer's frames for 90 ms, one time of five, once the pulses may begin."""

    def __init__(self, node):
        super().__init__(node)
        self._late, self._until_ns, self._random = [], 0, random.Random(1)

    def tick(self, now_ns):
        frames = super().tick(now_ns)
        self._late += [frame for frame in frames if frame.can_id & 0x7FF == 0x185]
        frames = [frame for frame in frames if frame not in self._late]
        if now_ns < self._until_ns:
            return frames
        if now_ns > ARM_S * SECOND and self._random.random() < 0.2:
            self._until_ns = now_ns + 90_000_000
        late, self._late = self._late, []
        return frames + late


def test_a_derived_rate_that_late_frames_spoil_is_not_to_be_scaled():
    device = {"profile": "cia410", "node": 5, "bus": "can1", "accept_unprotected": True,
              "age_ms": 500}  # fmt: skip
    thesis = controller("gpc")
    vessel = thesis.vessel.model_copy(
        update={"devices": DevicesSection.model_validate({"motion": device}),
                "redundancy": Redundancy(second_motion_sensor=True)}
    )  # fmt: skip
    config = thesis.model_copy(update={"vessel": vessel, "delay_s": 0.08})
    scenario = still_water(config)
    ship = [HeldUp(each) for each in build_ship_side(scenario, 1, scenario.operator).nodes]
    node = build_commissioning_node(config)
    lockstep = Lockstep([*ship, node], with_more(SimulatedBus(), 1, config.bit_rate))
    lockstep.run_until(round(75 * SECOND))
    assert (node.stage, node.ended) == (Stage.DONE, "")
    (remedy,) = failed(node).values()
    assert "up to 90 ms after one another where 10 was promised" in remedy


@pytest.mark.parametrize(
    ("late_ms", "limit_ms", "passes"),
    [(0, 150, True), (200, 150, False), (200, 350, True), (9e9, 350, False)],
)
def test_the_time_to_stop_is_measured_and_held_against_the_ships_file(late_ms, limit_ms, passes):
    """A drive that goes on with its last pressure for so long before it brakes."""
    vessel = NAVAL.vessel.model_copy(
        update={"devices": DevicesSection.model_validate({"pump": {"stop_within_ms": limit_ms}})}
    )
    config = NAVAL.model_copy(update={"vessel": vessel})
    scenario = still_water(config)
    ship = build_ship_side(scenario, 3, scenario.operator)
    plant, asked = ship.plant, 0.0
    held: list[float] = []

    def drive(setpoint_pa, *, enabled):
        nonlocal asked
        asked = setpoint_pa
        held.clear()
        type(plant).drive_pump(plant, setpoint_pa, enabled=enabled)

    def brake():
        held.append(asked)
        if len(held) * TICK_NS * 1e-6 > late_ms:
            type(plant).drive_pump(plant, 0.0, enabled=True)
            plant._state[kernel.REFERENCE] = 0.0

    plant.drive_pump, plant.brake_pump = drive, brake
    node = commissioned(config, nodes=ship.nodes)
    assert (node.stage, node.ended) == (Stage.DONE, "")
    (stop,) = (check for check in node.checks() if check.name == "stop_ms")
    assert stop.passed is passes
    if late_ms < 1e9:
        assert stop.measured == pytest.approx(60 + late_ms, abs=30)
    else:
        assert np.isnan(stop.measured)
    assert failed(node).keys() == (set() if passes else {"stop_ms"})


def test_who_arms_before_the_zeros_are_right_has_to_arm_again():
    early = TimedAction(ARM_S - 10.0, Action.ARM)
    again = (TimedAction(ARM_S + 4.0, Action.DISARM), TimedAction(ARM_S + 6.0, Action.ARM))
    scenario = still_water(NAVAL).model_copy(update={"operator": (early, *again)})
    ship = build_ship_side(scenario, 1, scenario.operator).nodes
    node = build_commissioning_node(NAVAL)
    lockstep = Lockstep([*ship, node])
    lockstep.run_until(round((ARM_S + 4.0) * SECOND))
    assert (node.stage, node.node.mode) == (Stage.ARM, Mode.STANDBY)
    lockstep.run_until(round((ARM_S + 8.0) * SECOND))
    assert (node.stage, node.node.mode) == (Stage.MOVING, Mode.ACTIVE)


def test_time_that_the_computer_was_up_for_costs_no_memory():
    node = build_commissioning_node(NAVAL)
    tracemalloc.start()
    try:
        for tick in range(10):
            list(node.tick(2 * 86_400 * SECOND + tick * TICK_NS))
        _, peak_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert node.stage is Stage.WAITING
    assert peak_bytes < 1_000_000


def test_the_operators_stop_ends_it():
    stop = TimedAction(ARM_S + 8.0, Action.STOP)
    node = commissioned(NAVAL, stop)
    assert node.ended == "Disarmed before the end."
    assert node.node.command_pa == 0.0
    assert node.node.mode is Mode.STANDBY
    names = {check.name for check in node.checks()}
    assert "port_level_zero" in names
    assert not names & {"pressure", "port_level"}  # the sound gauges would be called wrong


def test_all_pulses_are_judged_that_were_done_before_the_end():
    """Of a ship with pump and valve: 4.5 periods of 10.7 s, then three seconds of the valve."""
    stop = TimedAction(ARM_S + 1.0 + 4.5 * 10.7 + 2.0, Action.STOP)
    node = commissioned(controller("pump_with_valve"), stop)
    assert node.ended == "Disarmed before the end."
    names = {check.name for check in node.checks()}
    assert "pressure" in names
    assert "valve_open" not in names


def test_a_level_far_beyond_the_plan_ends_it():
    def far(tank):
        return tank._replace(**{name: 4 * getattr(tank, name) for name in LEVELS})

    node = commissioned(NAVAL, spoil={"sensors": altered(SensorTank, far)})
    assert node.ended.startswith("The level went 3 times as far as planned")
    assert node.node.command_pa == 0.0


def test_a_fault_ends_it_with_its_words():
    begin_ns = round((ARM_S + 8.0) * SECOND)

    def high(tank):
        return tank._replace(port_high=Switch.ON)

    node = commissioned(NAVAL, spoil={"sensors": altered(SensorTank, high)}, begin_ns=begin_ns)
    assert node.ended.startswith("LEVEL_LIMIT: The water in a reservoir is too high")
    assert node.node.command_pa == 0.0


def test_a_fault_in_the_moment_of_arming_ends_it_before_anything_moved():
    """Not one row of what moved is recorded then."""
    scenario = still_water(NAVAL)
    ship = build_ship_side(scenario, 1, scenario.operator)
    drive = ship.drive
    tick, enabled = drive.tick, count()

    def tripping(now_ns):
        # as soon as the controller has heard that it is enabled
        if drive._states.state is DriveState.OPERATION_ENABLED and next(enabled) == 2:
            drive.fail(DriveFault.STALL)
        return tick(now_ns)

    drive.tick = tripping
    node = commissioned(NAVAL, nodes=tuple(ship.nodes))
    assert node.stage is Stage.DONE
    assert node.ended.startswith("DRIVE_FAULT")


@pytest.mark.evidence("sensors_2")
@pytest.mark.parametrize("silent", ["sensors", "sensors_2"])
def test_a_second_motion_sensor_that_is_not_heard_is_waited_for(silent):
    """The controller could do without; its zeros and signs would be those of nothing."""
    config = controller("valve_on_off")
    vessel = config.vessel.model_copy(
        update={"pump": None, "redundancy": Redundancy(second_motion_sensor=True)}
    )
    config = config.model_copy(update={"vessel": vessel})
    gone = dropped(SensorMotion) if silent == "sensors" else dropped()
    node = commissioned(config, spoil={silent: gone}, end_s=10)  # with both it rests after 2 s
    assert node.stage is Stage.WAITING
    assert "motion sensor is silent" in node.missing
    assert node.checks() == []


def test_without_a_signs_meaning_two_faults_at_a_time_are_both_named():
    remedies = remedies_of(Each(-1.0, 1.0, 1.0, -1.0, 1.0))
    assert "pushes to port" in remedies.pressure
    assert "Turn the motion sensor round" in remedies.roll
    remedies = remedies_of(Each(1.0, -1.0, -1.0, 1.0, -1.0))
    assert "swapped" in remedies.port
    assert "wrong sign" in remedies.rate


def test_arming_is_refused_until_it_was_passed_and_the_bus_and_the_alarm_say_so():
    events: list[AlarmEvent | RetuningEvent] = []
    scenario = still_water(NAVAL)
    ship = build_ship_side(scenario, 1, scenario.operator)
    log: list[bytes] = []
    # nothing is said of a commissioning
    controller = build_controller_node(
        NAVAL, event_sink=lambda event, start_ns: events.append(event)
    )
    node = NodeTap(controller, lambda records, now_ns: log.append(records))
    Lockstep([*ship.nodes, node]).run_until(round((ARM_S + 2.0) * SECOND))
    assert (ship.panel.status.mode, ship.panel.status.fault) == (
        Mode.STANDBY,
        Fault.NOT_COMMISSIONED,
    )
    assert [alarm.code for alarm in ship.panel.alarms] == [Fault.NOT_COMMISSIONED]
    assert "utank-hil commission" in event_text(events[0])
    law = build_law(NAVAL)
    blocks = [np.frombuffer(b"".join(log), RECORD)]
    assert replay(entries_of(blocks), NAVAL, law, commissioned=False).exact
    armed = replay(entries_of(blocks), NAVAL, law)
    assert armed.first is not None


LEVELS_BY_PUMP = dict.fromkeys(LEVELS, (1 + SCALE) ** 2)
"""Gauges that pass by a pressure that passes, too."""


@pytest.mark.evidence("rate too small", "levels", "levels and pressure", "pressure")
@pytest.mark.slow
@pytest.mark.parametrize(
    "scaled",
    [
        {SensorMotion: {"roll_rate_rad_s": 1 + RATE_SCALE}},
        {SensorMotion: {"roll_rate_rad_s": 1 - RATE_SCALE}},
        {SensorTank: dict.fromkeys(LEVELS, 1 + SCALE)},
        {SensorTank: LEVELS_BY_PUMP, SensorPump: {"pressure_pa": 1 + SCALE}},
        {SensorPump: {"pressure_pa": 1 - SCALE}},
    ],
    ids=["rate too great", "rate too small", "levels", "levels and pressure", "pressure"],
)
def test_what_passes_at_the_quay_does_not_trip_at_sea(scaled):
    def by(factors):
        return lambda message: message._replace(
            **{name: factor * getattr(message, name) for name, factor in factors.items()}
        )

    spoilt = [altered(kind, by(factors)) for kind, factors in scaled.items()]

    def spoil(frame):
        frames: Iterable[Frame] = (frame,)
        for each in spoilt:
            frames = [changed for one in frames for changed in each(one)]
        return frames

    bench = FaultBench(seed=2)
    bench.sensors.begin_ns, bench.sensors.spoil = 0, spoil
    bench.run(60.0)
    assert (bench.mode, bench.node.fault) == (Mode.ACTIVE, Fault.NONE)


@pytest.mark.parametrize(
    ("told", "failed"),
    [
        pytest.param(1.0, set(), marks=pytest.mark.evidence),  # as 0.8
        (0.8, set()),
        (1.3, {"drive_speed"}),
        (0.0, {"drive_speed"}),
        (-1.0, {"drive_speed", "pressure"}),
        (60 / math.tau, {"drive_speed", "pressure", "stop_ms"}),
    ],
)
def test_a_drive_that_tells_another_speed_than_the_pumps_is_named(told, failed):
    drive = {
        "profile": "cia402", "bus": "can1", "node": 5, "mode": "torque",
        "pressure_pa_per_unit": 80.0, "speed_rad_s_per_unit": 1e-3, "identity": [1, 2, 3, 4],
    }  # fmt: skip
    thesis = controller("gpc")
    vessel = thesis.vessel.model_copy(
        update={"devices": DevicesSection.model_validate({"pump": drive})}
    )
    config = thesis.model_copy(update={"vessel": vessel})
    scenario = still_water(config)
    ship, node = build_ship_side(scenario, 1, scenario.operator), build_commissioning_node(config)
    bus = with_more(SimulatedBus(), 1, config.bit_rate)
    queue = bus.queue

    def send(sender, frame, now_ns):
        if frame.can_id & 0x7FF == SENT_2 + 5 and frame.can_id & STANDARD:
            speed = round(told * int.from_bytes(frame.data[:4], "little", signed=True))
            data = speed.to_bytes(4, "little", signed=True) + frame.data[4:]
            frame = Frame(frame.can_id, data)
        queue(sender, frame, now_ns)

    bus.queue = send
    lockstep = Lockstep([*ship.nodes, node], bus)
    while node.stage is not Stage.DONE and lockstep.now_ns < 300 * SECOND:
        lockstep.run_until(lockstep.now_ns + SECOND)
    assert {check.name for check in node.checks() if not check.passed} == failed
    (speed,) = (check for check in node.checks() if check.name == "drive_speed")
    assert speed.measured == pytest.approx(told, rel=0.01, abs=0.001)
