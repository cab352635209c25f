"""The ship's side of the bus, built from a scenario."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

from firmware_sim.drive import PumpDrive
from firmware_sim.external_nodes import ExternalDrive, ExternalValve
from firmware_sim.hardwired import HardwiredNode
from firmware_sim.plant import Plant
from firmware_sim.scenario import Scenario
from firmware_sim.sensors import SensorNode
from firmware_sim.valve import ValveNode
from utank_hil.canbus import load_catalogue
from utank_hil.configuration import Vessel
from utank_hil.dynamics.tank import negligible
from utank_hil.nodes.panel import Action, OperatorPanel, TimedAction
from utank_hil.runners import Node

NODE_NAMES: Final = ("sensors", "sensors_2", "hardwired", "drive", "valve", "panel")
"""The emulated nodes, in the order in which they tick; hardware may take the place of each.

Only a ship with a pump has a drive, and only one with a valve has that; the second motion sensor
and the hard-wired inputs are there if the vessel's section `redundancy` says so.
"""

# enabled at zero pressure the pump leaves the tank alone; switched off, its rotor turns with the
# water and changes the tank
PASSIVE_SCRIPT = (TimedAction(1.0, Action.PASSIVE),)


@dataclass(frozen=True, slots=True)
class ShipSide:
    """Everything on the bus but the controller.

    Attributes
    ----------
    drive : PumpDrive or None
        If the tank has a pump.
    valve : ValveNode or None
        If the tank has one.
    hardwired : HardwiredNode or None
        If the vessel's redundancy has them.
    """

    vessel: Vessel
    plant: Plant
    sensors: SensorNode
    drive: PumpDrive | None
    panel: OperatorPanel
    valve: ValveNode | None = None
    second_motion: SensorNode | None = None
    hardwired: HardwiredNode | None = None

    @property
    def nodes(self) -> tuple[Node, ...]:
        """The nodes, in the order in which they tick."""
        optional: tuple[Node | None, ...] = (
            self.second_motion, self.hardwired, self.drive, self.valve,
        )  # fmt: skip
        return self.sensors, *(node for node in optional if node is not None), self.panel

    @property
    def refused_commands(self) -> int:
        """Commands that drive and valve found wrong or outside their own limits."""
        return sum(node.refused for node in (self.drive, self.valve) if node is not None)

    def without(self, names: Collection[str]) -> list[Node]:
        """The nodes that are left when hardware takes the place of some.

        Without the emulated drive an `ExternalDrive` moves the plant's pump, without the emulated
        valve an `ExternalValve` its valve.

        Parameters
        ----------
        names : collection of str
            Some of `NODE_NAMES`.

        Raises
        ------
        ValueError
            If the ship has no such node.
        """
        known = [node.name for node in self.nodes]
        for name in names:
            if name not in known:
                raise ValueError(f"no node {name!r} to leave out; there are {', '.join(known)}")
        nodes: list[Node] = [node for node in self.nodes if node.name not in names]
        if "drive" in names:
            nodes.append(ExternalDrive(self.plant, load_catalogue()))
        if "valve" in names and self.vessel.valve is not None:
            valve = ExternalValve(self.plant, self.vessel.tank, self.vessel.valve, load_catalogue())
            nodes.append(valve)
        return nodes


def bare_plant(scenario: Scenario, seed: int) -> Plant:
    """The scenario's ship without its tank, in the same waves.

    Parameters
    ----------
    seed : int
        Of the sea.
    """
    tank = negligible(scenario.vessel.tank)
    return Plant(
        scenario.ship_at,
        tank,
        None,
        scenario.waves(seed),
        linear=scenario.plant == "linear",
    )


def build_ship_side(scenario: Scenario, seed: int, script: tuple[TimedAction, ...]) -> ShipSide:
    """Build the emulated ship and its nodes.

    Parameters
    ----------
    seed : int
        Of sea and sensor noise.
    script : tuple of TimedAction
        The operator's actions.
    """
    vessel, catalogue = scenario.vessel, load_catalogue()
    plant = Plant(
        scenario.ship_at,
        vessel.tank,
        vessel.pump,
        scenario.waves(seed),
        linear=scenario.plant == "linear",
    )
    version = vessel.version
    drive = valve = None
    if vessel.pump is not None:
        drive = PumpDrive(plant, scenario.drive, catalogue, configuration_version=version)
    if vessel.valve is not None:
        valve = ValveNode(
            plant, vessel.tank, vessel.valve, catalogue, configuration_version=version
        )
    second_motion = hardwired = None
    if vessel.redundancy.second_motion_sensor:
        second_motion = SensorNode(
            plant,
            scenario.sensors,
            catalogue,
            configuration_version=version,
            seed=seed + 2,
            second=True,
        )
    if vessel.redundancy.hardwired_inputs:
        hardwired = HardwiredNode(
            plant, scenario.sensors.high_level_m, catalogue, configuration_version=version
        )
    return ShipSide(
        vessel,
        plant,
        SensorNode(
            plant, scenario.sensors, catalogue, configuration_version=version, seed=seed + 1
        ),
        drive,
        OperatorPanel(catalogue, configuration_version=version, script=script),
        valve,
        second_motion,
        hardwired,
    )
