"""The ship's side of the bus, built from a scenario."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

from firmware_sim.drive import PumpDrive
from firmware_sim.external_drive import ExternalDrive
from firmware_sim.plant import Plant
from firmware_sim.scenario import Scenario
from firmware_sim.sensors import SensorNode
from utank_hil.canbus import load_catalogue
from utank_hil.dynamics.tank import negligible
from utank_hil.runtime import Node
from utank_hil.runtime.panel import Action, OperatorPanel, TimedAction

NODE_NAMES: Final = ("sensors", "drive", "panel")
"""The emulated nodes, in the order in which they tick; hardware may take the place of each."""

# enabled at zero pressure the pump leaves the tank alone; switched off, its rotor turns with the
# water and changes the tank
PASSIVE_SCRIPT = (TimedAction(1.0, Action.PASSIVE),)


@dataclass(frozen=True, slots=True)
class ShipSide:
    """Everything on the bus but the controller.

    Attributes
    ----------
    plant : Plant
    sensors : SensorNode
    drive : PumpDrive
    panel : OperatorPanel
    """

    plant: Plant
    sensors: SensorNode
    drive: PumpDrive
    panel: OperatorPanel

    @property
    def nodes(self) -> tuple[SensorNode, PumpDrive, OperatorPanel]:
        """The nodes, in the order in which they tick."""
        return self.sensors, self.drive, self.panel

    def without(self, names: Collection[str]) -> list[Node]:
        """The nodes that are left when hardware takes the place of some.

        Without the emulated drive an `ExternalDrive` moves the plant's pump.

        Parameters
        ----------
        names : collection of str
            Some of `NODE_NAMES`.

        Raises
        ------
        ValueError
            If a name is unknown.
        """
        for name in names:
            if name not in NODE_NAMES:
                raise ValueError(
                    f"no node {name!r} to leave out; there are {', '.join(NODE_NAMES)}"
                )
        nodes: list[Node] = [node for node in self.nodes if node.name not in names]
        if "drive" in names:
            nodes.append(ExternalDrive(self.plant, load_catalogue()))
        return nodes


def bare_plant(scenario: Scenario, seed: int) -> Plant:
    """The scenario's ship without its tank, in the same waves.

    Parameters
    ----------
    scenario : Scenario
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
    scenario : Scenario
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
    return ShipSide(
        plant,
        SensorNode(
            plant, scenario.sensors, catalogue, configuration_version=version, seed=seed + 1
        ),
        PumpDrive(plant, scenario.drive, catalogue, configuration_version=version),
        OperatorPanel(catalogue, configuration_version=version, script=script),
    )
