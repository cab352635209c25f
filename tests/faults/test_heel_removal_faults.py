"""Heel removal on the bench: cargo at the quay, and each fault that the mode has."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml
from pydantic import TypeAdapter

from firmware_sim.fault_injection.kinds import AnyFault
from firmware_sim.faulty_bench import FaultyBench
from firmware_sim.scenario import Scenario
from utank_hil.assembly import build_law
from utank_hil.canbus import Fault, Mode
from utank_hil.configuration import load_config
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.nodes.signals import SIGNALS

SECOND = 1_000_000_000
CARGO = Path("configs/scenarios/heel_removal.yaml")
VALVE = ("VALVE_FAULT", "VALVE_NOT_FOLLOWING")
HEELED = {"offset_moment_nm": 4.0e6}  #: Half a degree to starboard.
LEVELS = {"message": "SENSOR_TANK", "signals": ["port_level_m", "starboard_level_m"]}


@cache
def scenario():
    return load_config(CARGO, Scenario)


class Quay:
    """The ship of the scenario, heeled from the start, armed after 5 s."""

    def __init__(self, *faults, ship=HEELED, sea=None):
        update = {"voyage": (), "actual_ship": ship}
        if sea is not None:
            update["sea"] = sea
        there = scenario().model_copy(update=update)
        config = there.controllers["heel_removal"]
        self.rows = []
        self.bench = FaultyBench(
            there, config, build_law(config), seed=1, script=(TimedAction(5.0, Action.ARM),),
            sink=lambda row: self.rows.append(row.copy()), sink_every=10,
        )  # fmt: skip
        self.node, self.plant, self.valve = (
            self.bench.node, self.bench.ship.plant, self.bench.ship.valve
        )  # fmt: skip
        self.bench.place([TypeAdapter(AnyFault).validate_python(fault) for fault in faults])

    def run(self, until_s):
        """Go on until a time, or a second after the end of ACTIVE; return when that was."""
        while self.bench.lockstep.now_ns < until_s * SECOND:
            now_ns = self.bench.lockstep.now_ns
            self.bench.run(now_ns + SECOND // 10)
            if self.node.mode is Mode.FAULT:
                self.bench.run(now_ns + 2 * SECOND)
                return now_ns / SECOND
        return None

    def column(self, name):
        return np.array(self.rows)[:, SIGNALS.index(name)]

    @property
    def found(self):
        return self.node.mode, self.node.fault


def assert_held(quay):
    """The safe state: no pressure, a shut valve, and water that stays where it is."""
    level_m = quay.plant.level_m
    quay.bench.run(quay.bench.lockstep.now_ns + 5 * SECOND)
    assert quay.node.command_pa == 0
    assert quay.valve.opening == 0
    assert quay.plant.level_m == pytest.approx(level_m, abs=1e-9)


def test_a_heel_is_taken_away_and_the_water_is_held():
    quay = Quay()
    assert quay.run(75) is None
    assert abs(quay.plant.level_m) > 0.1  # it is on its way
    assert quay.run(230) is None
    assert quay.node.mode is Mode.ACTIVE
    assert_held(quay)
    pressure, opening = quay.column("pressure_command_pa"), quay.column("valve_opening")
    # a tenth of a second for the ramp from what holds the water, once the valve is at its seat
    assert not (
        pressure[10:][np.convolve(opening > 1e-4, np.ones(10))[: len(opening)][10:] == 0]
    ).any()
    assert opening[10:].max() < 0.05
    assert np.degrees(abs(quay.column("roll_rad")[-200:].mean())) < 0.15


@pytest.mark.parametrize("until_s", [40, 72])
def test_what_stops_the_controller_shuts_the_valve_on_the_water(until_s):
    quay = Quay({"kind": "hangs", "node": "controller", "at_s": until_s})
    quay.bench.run((until_s + 1) * SECOND)
    level_m = quay.plant.level_m
    quay.bench.run((until_s + 60) * SECOND)
    assert (quay.valve.opening, quay.plant.level_m) == (0, level_m)
    assert abs(quay.plant.pressure_pa) < 1500


# the first pumping begins 67.9 s after the start and lasts for 10 s
@pytest.mark.parametrize(
    ("fault", "told", "within_s"),
    [
        ({"kind": "valve", "fails": "stuck", "at_s": 60}, VALVE, 69),
        ({"kind": "valve", "fails": "stuck", "at_s": 72}, VALVE, 90),
        ({"kind": "stuck", **LEVELS, "at_s": 60}, ("STUCK_SIGNAL",), 74),
        ({"kind": "sign", **LEVELS, "at_s": 60}, ("MOTION_SIGN_FLIP", "SPIKES"), 74),
        ({"kind": "pump", "times": 0.0, "plus_pa": -12e3, "at_s": 72},
         ("DRIVE_NOT_FOLLOWING",), 80),
        ({"kind": "pump", "times": -1.0, "at_s": 60}, ("SIGN_FLIP", "DRIVE_NOT_FOLLOWING"), 69),
        ({"kind": "offset", "message": "SENSOR_MOTION", "signals": ["roll_rad"],
          "at_s": 30, "by": 0.02},
         ("DRIFT", "MOTION_SILENT"), 40),
    ],
    ids=["valve stuck shut", "valve stuck open", "levels stuck", "levels swapped",
         "drive goes on", "pump reversed", "roll sensor slips"],
)  # fmt: skip
def test_a_fault_ends_it_in_time(fault, told, within_s):
    quay = Quay(fault)
    ended_s = quay.run(within_s)
    assert (ended_s is not None, quay.node.fault.name in told) == (True, True), quay.found
    assert quay.node.command_pa == 0
    if not (fault["kind"] == "valve" and fault["at_s"] == 72):
        assert_held(quay)


def test_a_valve_that_leaks_is_found_when_it_is_shut():
    quay = Quay()
    assert quay.run(82) is None
    quay.plant.set_valve_loss(quay.bench.ship.vessel.valve.loss(quay.bench.ship.vessel.tank, 0.005))
    quay.valve.stuck = True  # it says that it is shut
    assert quay.run(110) is not None
    assert quay.found == (Mode.FAULT, Fault.VALVE_NOT_FOLLOWING)


def test_a_ship_aground_is_left_alone_after_two_pumpings():
    ship = scenario().vessel.ship
    heavier = {"stiffness_nm_rad": 30 * ship.stiffness_nm_rad, "offset_moment_nm": 30 * 2.6e6}
    quay = Quay(ship=heavier | {"inertia_kg_m2": 30 * ship.inertia_kg_m2})
    assert quay.run(420) is not None, quay.found
    assert quay.found == (Mode.FAULT, Fault.STUCK_SIGNAL)
    assert_held(quay)


def test_a_ship_without_stability_is_left_alone_after_two_pumpings():
    stiffness = scenario().vessel.ship.stiffness_nm_rad
    quay = Quay(ship={"stiffness_nm_rad": stiffness / 4.5, "offset_moment_nm": 1.0e6})
    assert quay.run(420) is not None
    assert quay.found == (Mode.FAULT, Fault.STABILITY_LOW)


def test_at_sea_it_is_not_armed_and_says_why():
    sea = load_config(Path("configs/scenarios/storm.yaml"), Scenario).sea
    quay = Quay(sea=sea, ship={})
    quay.bench.run(7 * SECOND)
    ended_s = quay.run(60)
    assert ended_s is None or ended_s < 30
    assert quay.node.fault is Fault.HEEL_LIMIT
    assert_held(quay)


def test_what_the_shipped_scenario_says_of_itself():
    text = yaml.safe_load(CARGO.read_text(encoding="utf-8"))
    assert text["voyage"][-1]["time_s"] < text["duration_s"]
