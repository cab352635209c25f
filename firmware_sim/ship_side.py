"""The ship's side put together from a scenario."""

from dataclasses import dataclass

from firmware_sim.drive import PumpDrive
from firmware_sim.plant import Plant
from firmware_sim.scenario import Scenario
from firmware_sim.sensors import SensorNode
from utank_hil.canbus import load_catalogue
from utank_hil.runtime.panel import Action, OperatorPanel, TimedAction

SECOND_NS = 1_000_000_000

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


def build_ship_side(scenario: Scenario, seed: int, script: tuple[TimedAction, ...]) -> ShipSide:
    """Ship emulator with its nodes.

    Parameters
    ----------
    scenario : Scenario
    seed : int
        Of sea and sensor noise: the same seed, the same waves.
    script : tuple of TimedAction
        What the operator does.
    """
    vessel, catalogue = scenario.vessel, load_catalogue()
    plant = Plant(vessel.ship, vessel.tank, vessel.pump, scenario.wave_moment(seed))
    plant.change_ship(scenario.sailing_ship, round(scenario.actual_from_s * SECOND_NS))
    version = vessel.version
    return ShipSide(
        plant,
        SensorNode(
            plant, scenario.sensors, catalogue, configuration_version=version, seed=seed + 1
        ),
        PumpDrive(plant, scenario.drive, catalogue, configuration_version=version),
        OperatorPanel(catalogue, configuration_version=version, script=script),
    )
