"""The guard on the bench: silent beside a healthy controller, and a cut where a drive disobeys."""

import math
from pathlib import Path
from typing import Any

import pytest
from device_ship import PUMP, scenario_of

from firmware_sim.fault_injection.nodes import Pump, Silenced
from firmware_sim.faulty_bench import FaultyBench
from firmware_sim.guard.reference import Reason
from firmware_sim.scenario import Scenario
from utank_hil.canbus import DriveState, Mode
from utank_hil.configuration import load_config
from utank_hil.nodes.panel import Action, TimedAction

SECOND = 1_000_000_000


def bench(name: str, controller: str, *, guard: bool = True) -> FaultyBench:
    scenario = load_config(Path(f"configs/scenarios/{name}.yaml"), Scenario)
    scenario = scenario.model_copy(update={"guard": guard})
    config = scenario.controllers[controller]
    return FaultyBench(scenario, config, seed=1, script=scenario.operator)


def test_it_lets_a_healthy_controller_be() -> None:
    found = bench("storm", "gpc")
    guard = found.ship.guard
    assert guard is not None
    assert guard.guard.reasons == Reason.WAITING
    for second in range(2, 25):
        found.run(second * SECOND)
        assert guard.guard.reasons == 0
    assert found.node.mode is Mode.ACTIVE
    assert abs(found.ship.plant.pressure_pa) > 100


@pytest.mark.parametrize("devices", [{}, {"pump": PUMP}])
def test_it_lets_a_drive_be_that_holds_zero_pressure_in_passive(devices: dict[str, Any]) -> None:
    """Whatever the drive is told, and also where nobody is at the panel any more."""
    scenario = scenario_of(devices)
    script = TimedAction(1.0, Action.ARM), TimedAction(4.0, Action.DISARM)
    found = FaultyBench(scenario, scenario.controllers["gpc"], seed=1, script=script)
    found.run(8 * SECOND)
    found.place([Silenced(kind="hangs", node="panel")])
    for second in range(9, 19):
        found.run(second * SECOND)
        guard = found.ship.guard
        assert guard is not None
        assert (found.node.mode, guard.guard.reasons) == (Mode.PASSIVE, 0)
    assert found.node.measured.drive_state is DriveState.OPERATION_ENABLED


@pytest.mark.evidence("fault1", "fault2", "fault3")
@pytest.mark.slow
@pytest.mark.parametrize(
    "fault",
    [
        *(Pump(kind="pump", times=0, plus_pa=pa, off_too=True) for pa in (5e3, 20e3)),
        Pump(kind="pump", times=-1.0, off_too=True),
        Silenced(kind="hangs", node="drive"),
    ],
)
def test_patti_b_stays_below_her_roll_limit_whatever_the_drive_does(fault: Any) -> None:
    found = bench("patti_b", "constrained")
    found.run(40 * SECOND)
    found.place([fault])
    most_rad = 0.0
    for tenth in range(1, 300):
        found.run(40 * SECOND + tenth * SECOND // 10)
        most_rad = max(most_rad, abs(found.ship.plant.roll_rad))
    assert most_rad < 0.19
    assert math.isinf(found.ship.plant.capsized_s)
    assert found.node.mode is Mode.FAULT


def test_the_hard_wired_stop_cuts_a_pump_that_obeys_nobody() -> None:
    found = bench("patti_b", "constrained", guard=False)
    found.run(8 * SECOND)
    found.place([Pump(kind="pump", times=0, plus_pa=5e3, off_too=True)])
    found.run(9 * SECOND)
    assert found.ship.plant.pressure_pa == pytest.approx(5e3)
    assert found.ship.hardwired is not None
    found.ship.hardwired.stop_pressed = True
    found.run(10 * SECOND)
    assert abs(found.ship.plant.pressure_pa) < 1e3
    found.ship.hardwired.stop_pressed = False
    found.run(11 * SECOND)
    assert found.ship.plant.pressure_pa == pytest.approx(5e3)
