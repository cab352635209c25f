"""Gauges that are silent for less than a second: control goes on, the water keeps its limit."""

from pathlib import Path

import pytest
from fault_bench import ARMED, SECOND, FaultBench, dropped

from firmware_sim.scenario import Scenario
from utank_hil.canbus import Mode, SensorTank
from utank_hil.configuration import load_config

NAVAL = load_config(Path("configs/scenarios/naval_vessel.yaml"), Scenario)
HIGHER = NAVAL.model_copy(update={"sea": NAVAL.sea.model_copy(update={"hs_m": 0.8})})


@pytest.mark.evidence
@pytest.mark.parametrize("seed", [2, 3, 4])
def test_a_law_that_plans_keeps_its_level_limit_through_gaps_of_the_gauges(seed):
    """With the last level held it took the water to the high-level switches in all three seas."""
    bench = FaultBench(seed, ARMED, "constrained", scenario=HIGHER)
    bench.sensors.spoil = dropped(SensorTank)
    for begin_s in range(60, 400, 10):
        bench.sensors.begin_ns = begin_s * SECOND
        bench.sensors.end_ns = bench.sensors.begin_ns + 900_000_000
        bench.run(begin_s + 10)
        assert bench.mode is Mode.ACTIVE, f"{bench.node.fault.name} after {begin_s} s"
