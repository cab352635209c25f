"""The semi-active tank in lockstep: armed, at work, and at its fail position after each fault."""

from pathlib import Path

import numpy as np
import pytest

from firmware_sim.plant import Plant
from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from firmware_sim.valve import ValveNode
from utank_hil.assembly import build_controller_node, build_law
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Address, Fault, Mode, PumpCommand, ValveCommand, load_catalogue
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.nodes.controller import ControllerNode
from utank_hil.nodes.panel import Action, OperatorPanel, TimedAction
from utank_hil.nodes.signals import SIGNALS
from utank_hil.runners import Lockstep

SCENARIO = load_config(Path("configs/scenarios/semi_active.yaml"), Scenario)
SECOND_NS = 1_000_000_000


class Bench:
    """The ship of the scenario and a controller, armed after two seconds."""

    def __init__(self, controller: str, scenario: Scenario = SCENARIO) -> None:
        ship = build_ship_side(scenario, 1, (TimedAction(2.0, Action.ARM),))
        assert isinstance(ship.valve, ValveNode)
        self.valve: ValveNode = ship.valve
        self.panel: OperatorPanel = ship.panel
        self.plant: Plant = ship.plant
        self.rows: list[np.ndarray] = []
        self.controller: ControllerNode = build_controller_node(
            scenario.controllers[controller],
            commissioned=True,
            sink=lambda row: self.rows.append(row.copy()),
        )
        self.identifiers: set[int] = set()
        self.lockstep = Lockstep(
            [*ship.nodes, self.controller],
            trace=lambda now_ns, sender, frame: self.identifiers.add(frame.can_id),
        )
        self.run(6.0)
        assert self.controller.mode is Mode.ACTIVE

    def run(self, seconds: float) -> None:
        self.lockstep.run_until(self.lockstep.now_ns + round(seconds * SECOND_NS))

    def run_until_shut(self) -> None:
        """Go on until the valve has been shut for a little while."""
        for _ in range(3000):
            self.lockstep.run_until(self.lockstep.now_ns + TICK_NS)
            if self.valve.opening < 0.01:
                return
        raise AssertionError("never shut")

    def column(self, name: str) -> np.ndarray:
        return np.array(self.rows)[:, SIGNALS.index(name)]

    def press(self, *actions: Action) -> None:
        for action in actions:
            self.panel.press(action)
            self.run(1.0)


@pytest.mark.evidence("on_off")
@pytest.mark.parametrize("controller", ["on_off", "clipped"])
def test_valve_law_moves_the_valve_and_the_pump_rests(controller: str) -> None:
    bench = Bench(controller)
    bench.run(30.0)
    opening = bench.column("valve_opening")
    assert (opening.min(), opening.max()) == pytest.approx((0.0, 1.0), abs=0.02)
    assert not bench.column("pressure_command_pa").any()
    assert (bench.valve.refused, bench.controller.law.error) == (0, "")
    assert bench.controller.mode is Mode.ACTIVE


def test_pump_and_valve_work_together() -> None:
    bench = Bench("pump_with_valve")
    bench.run(30.0)
    assert np.ptp(bench.column("valve_opening")) > 0.5
    assert np.ptp(bench.column("pressure_command_pa")) > 10e3
    assert bench.controller.mode is Mode.ACTIVE
    bench.valve.powered = False
    bench.run(0.5)
    assert bench.controller.fault is Fault.VALVE_SILENT
    assert bench.column("pressure_command_pa")[-1] == 0


def test_the_level_s_rate_is_known_while_the_valve_works() -> None:
    bench = Bench("pump_with_valve")
    bench.run(30.0)
    errors, rates = [], []
    for _ in range(3000):
        bench.lockstep.run_until(bench.lockstep.now_ns + TICK_NS)
        rate = bench.plant.flow_m3_s / SCENARIO.vessel.tank.reservoir_area_m2
        errors.append(bench.controller.level.rate_m_s - rate)
        rates.append(rate)
    assert np.std(rates) > 0.3
    assert np.sqrt(np.mean(np.square(errors))) < 0.04 * np.std(rates)


def test_a_valve_stuck_shut_is_found_as_soon_as_it_is_to_open() -> None:
    bench = Bench("on_off")
    bench.run_until_shut()
    bench.valve.stuck = True
    bench.run(10.0)
    assert bench.controller.mode is Mode.FAULT
    assert bench.controller.fault in (Fault.VALVE_NOT_FOLLOWING, Fault.VALVE_FAULT)
    bench.press(Action.DISARM, Action.RESET)
    assert bench.controller.mode is Mode.FAULT  # the cause lasts
    bench.valve.stuck = False
    bench.run(1.0)
    assert bench.valve.opening == 1.0
    bench.press(Action.RESET)
    assert bench.controller.mode in (Mode.PASSIVE, Mode.STANDBY)
    bench.press(Action.ARM)
    assert bench.controller.mode is Mode.ACTIVE
    bench.run_until_shut()


def test_after_a_loss_of_power_the_valve_stays_at_its_fail_position_until_it_is_armed() -> None:
    bench = Bench("on_off")
    bench.run_until_shut()
    bench.valve.powered = False
    bench.run(0.2)
    bench.valve.powered = True
    bench.run(5.0)
    assert bench.controller.mode is Mode.FAULT
    assert bench.valve.opening == 1.0
    bench.press(Action.DISARM, Action.RESET, Action.ARM)
    assert bench.controller.mode is Mode.ACTIVE
    bench.run_until_shut()


def test_disarmed_or_stopped_the_valve_goes_to_its_fail_position() -> None:
    bench = Bench("on_off")
    for action in (Action.DISARM, Action.STOP):
        bench.run_until_shut()
        bench.press(action)
        assert bench.valve.opening == 1.0
        bench.press(Action.ARM)


def without_pump() -> Scenario:
    vessel = SCENARIO.vessel.model_copy(update={"pump": None})
    controllers = {
        name: config.model_copy(update={"vessel": vessel})
        for name, config in SCENARIO.controllers.items()
    }
    return SCENARIO.model_copy(update={"vessel": vessel, "controllers": controllers})


def test_a_ship_without_a_pump_has_no_drive_on_her_bus_and_her_valve_works() -> None:
    bench = Bench("on_off", without_pump())
    bench.run_until_shut()
    catalogue = load_catalogue()
    assert not bench.identifiers & catalogue.ids_sent_by(Address.DRIVE)
    assert catalogue.codec(PumpCommand).can_id not in bench.identifiers
    assert not bench.column("pressure_command_pa").any()
    assert [frame.can_id for frame in bench.controller.stop(0)] == [
        catalogue.codec(ValveCommand).can_id
    ]
    bench.valve.powered = False
    bench.run(0.2)
    assert bench.controller.fault is Fault.VALVE_SILENT


def test_a_law_that_drives_a_pump_is_refused_without_one_and_a_valve_s_law_is_not() -> None:
    vessel = {"vessel": without_pump().vessel, "name": "a law"}
    for law in ({"kind": "valve_on_off"}, {"kind": "valve_clipped", "pump": {"kind": "pd"}}):
        build_law(ControllerConfig.model_validate({**vessel, "law": law}))
    with pytest.raises(ValueError, match="drives a pump"):
        ControllerConfig.model_validate({**vessel, "law": {"kind": "pd"}})
