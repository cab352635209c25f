"""A ship at the quay in lockstep, with a commissioning in the place of her controller."""

from pathlib import Path

from fault_bench import SECOND, Failing

from firmware_sim.drive import PumpDrive
from firmware_sim.plant import Plant
from firmware_sim.scenario import Scenario
from firmware_sim.sensors import SensorNode
from firmware_sim.ship_side import HardwiredNode, build_ship_side
from utank_hil.assembly import build_commissioning_node
from utank_hil.canbus import load_catalogue
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.nodes.commissioning.node import REST_S, Stage
from utank_hil.nodes.panel import Action, OperatorPanel, TimedAction
from utank_hil.runners import Lockstep

ARM_S = REST_S + 2.0


def controller(name):
    return load_config(Path(f"configs/controllers/{name}.yaml"), ControllerConfig)


def still_water(config, *more):
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


def commissioned(config, *more, spoil=None, begin_ns=0, seed=1, nodes=None, end_s=300):
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


def another_ship(config, ship, tank):
    """Nodes of a ship that is not as her file says."""
    scenario, catalogue = still_water(config), load_catalogue()
    plant = Plant(ship, tank, config.vessel.pump, scenario.waves(1))
    version = config.vessel.version
    return (
        SensorNode(plant, scenario.sensors, catalogue, configuration_version=version, seed=2),
        HardwiredNode(
            plant, scenario.sensors.high_level_m, catalogue, configuration_version=version
        ),
        PumpDrive(plant, scenario.drive, catalogue, configuration_version=version),
        OperatorPanel(catalogue, configuration_version=version, script=scenario.operator),
    )
