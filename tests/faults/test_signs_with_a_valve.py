"""A motion sensor with the wrong sign on a ship with a valve, which hides a part of the water."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from pydantic import TypeAdapter

from firmware_sim.fault_injection.kinds import AnyFault
from firmware_sim.faulty_bench import FaultyBench
from firmware_sim.scenario import Scenario
from utank_hil.assembly import build_law
from utank_hil.canbus import Fault, Mode
from utank_hil.configuration import load_config
from utank_hil.nodes.panel import Action, TimedAction

SECOND = 1_000_000_000
FLIPPED = {"kind": "sign", "message": "SENSOR_MOTION", "signals": ["roll_rad", "roll_rate_rad_s"]}
OPPOSITE = {"kind": "law", "fails": "opposite"}


@cache
def scenario():
    return load_config(Path("configs/scenarios/semi_active.yaml"), Scenario)


@pytest.mark.parametrize("controller", ["pump_with_valve", "on_off"])
@pytest.mark.parametrize("flipped", [False, True])
def test_both_signs_wrong_are_told_by_water_that_a_valve_holds_back(controller, flipped):
    config = scenario().controllers[controller]
    script = (TimedAction(1.0, Action.ARM),)
    bench = FaultyBench(scenario(), config, build_law(config), seed=1, script=script)
    if flipped:
        bench.place([TypeAdapter(AnyFault).validate_python(FLIPPED)])
    bench.run(16 * SECOND)
    told = Fault.MOTION_SIGN_FLIP if flipped else Fault.NONE
    assert (bench.node.mode is Mode.FAULT, bench.node.fault) == (flipped, told)


def test_pump_law_that_is_turned_against_the_ship_is_found_by_her_twin():
    config = scenario().controllers["pump_with_valve"]
    script = (TimedAction(1.0, Action.ARM),)
    bench = FaultyBench(scenario(), config, build_law(config), seed=11, script=script)
    bench.place([TypeAdapter(AnyFault).validate_python({**OPPOSITE, "at_s": 40.0})])
    bench.run(65 * SECOND)
    assert (bench.node.mode, bench.node.fault) == (Mode.FAULT, Fault.ROLL_AMPLIFIED)


class Shut:
    """Keeps the valve shut."""

    def __init__(self, law):
        self._law = law.controller()
        self.sample_time_s = self._law.sample_time_s

    def step(self, y, reference=None):
        self._law.step(y, reference)
        return np.array([1e12])

    def applied(self, u):
        self._law.applied(u)

    def reset(self):
        self._law.reset()


@pytest.mark.evidence
@pytest.mark.parametrize("pump", [False, True])
def test_a_valve_that_rolls_the_ship_more_than_an_open_one_is_found_by_her_twin(pump):
    """In a long swell the shut valve leaves her 1.4 times the roll."""
    config = scenario().controllers["on_off"]
    vessel = config.vessel if pump else config.vessel.model_copy(update={"pump": None})
    config = config.model_copy(update={"vessel": vessel})
    sea = scenario().sea.model_copy(update={"tp_s": 11.0, "hs_m": 3.0})
    long = scenario().model_copy(
        update={"sea": sea, "vessel": vessel, "controllers": {"on_off": config}}
    )
    law = build_law(config)
    shut = replace(law, controller=lambda: Shut(law))
    script = (TimedAction(1.0, Action.ARM),)
    bench = FaultyBench(long, config, shut, seed=3, script=script)
    bench.run(280 * SECOND)
    assert (bench.node.mode, bench.node.fault) == (Mode.FAULT, Fault.ROLL_AMPLIFIED)
