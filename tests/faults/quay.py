"""A ship at the quay in lockstep, with a commissioning in the place of her controller."""

from collections.abc import Mapping
from pathlib import Path

from fault_bench import SECOND, Failing, Fault

from firmware_sim.drive import PumpDrive
from firmware_sim.plant import Plant
from firmware_sim.scenario import Scenario
from firmware_sim.sensors import SensorNode
from firmware_sim.ship_side import HardwiredNode, build_ship_side
from utank_hil.assembly import build_commissioning_node
from utank_hil.canbus import load_catalogue
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
from utank_hil.nodes.commissioning.node import REST_S, CommissioningNode, Stage
from utank_hil.nodes.panel import Action, OperatorPanel, TimedAction
from utank_hil.runners import Lockstep, Node

ARM_S = REST_S + 2.0


def controller(name: str) -> ControllerConfig:
    return load_config(Path(f"configs/controllers/{name}.yaml"), ControllerConfig)


def still_water(config: ControllerConfig, *more: TimedAction) -> Scenario:
    """Her ship on still water, with an operator who arms when the zeros are known."""
    return Scenario.model_validate(
        {
            "name": "quay",
            "vessel": config.vessel,
            "sea": {"kind": "regular", "amplitude_m": 0.0, "period_s": 10.0},
            "controllers": {"any": config},
            "operator": (TimedAction(ARM_S, Action.ARM), *more),
            "duration_s": 300.0,
            "settle_s": 0.0,
        }
    )


def commissioned(
    config: ControllerConfig,
    *more: TimedAction,
    spoil: Mapping[str, Fault] | None = None,
    begin_ns: int = 0,
    seed: int = 1,
    nodes: tuple[Node, ...] | None = None,
    end_s: int = 300,
) -> CommissioningNode:
    """Commission a ship, with what becomes of the frames of some nodes."""
    node = build_commissioning_node(config)
    scenario = still_water(config, *more)
    ship = build_ship_side(scenario, seed, scenario.operator).nodes if nodes is None else nodes
    spoil = spoil or {}
    lockstep = Lockstep(
        [
            Failing(each, begin_ns=begin_ns, spoil=spoil[each.name]) if each.name in spoil else each
            for each in (*ship, node)
        ]
    )
    while node.stage is not Stage.DONE and lockstep.now_ns < end_s * SECOND:
        lockstep.run_until(lockstep.now_ns + SECOND)
    return node


def another_ship(config: ControllerConfig, ship: RollShip, tank: Tank) -> tuple[Node, ...]:
    """Nodes of a ship that is not as her file says."""
    scenario, catalogue = still_water(config), load_catalogue()
    plant = Plant(ship, tank, config.vessel.pump, scenario.waves(1), linear=False)
    version = config.vessel.version
    return (
        SensorNode(plant, scenario.sensors, catalogue, configuration_version=version, seed=2),
        HardwiredNode(
            plant, scenario.sensors.high_level_m, catalogue, configuration_version=version
        ),
        PumpDrive(plant, scenario.drive, catalogue, configuration_version=version),
        OperatorPanel(catalogue, configuration_version=version, script=scenario.operator),
    )
