"""The bench as faults see it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from firmware_sim.fault_injection.breakable_law import LawFailures
from firmware_sim.fault_injection.faulty_bus import FaultyBus
from firmware_sim.fault_injection.faulty_node import FaultyNode
from utank_hil.canbus import DriveFault
from utank_hil.runners import Node


class Pumped(Protocol):
    """A plant whose pump can be made to fail."""

    broken_pump: Callable[[float], float] | None
    presses_off: bool


class Trips(Protocol):
    """A drive that can be made to fail."""

    def fail(self, fault: DriveFault) -> None:
        """Go to fault; without one, switch off."""


class Sticks(Protocol):
    """A valve that can be made to fail."""

    stuck: bool
    powered: bool


@dataclass(slots=True)
class Bench:
    """Where faults are placed.

    Attributes
    ----------
    nodes : dict of str to FaultyNode
        By name.
    version : int
        Of the ship's configuration.
    bus : FaultyBus or None
        None on a real bus.
    law : LawFailures or None
        Of whatever controller runs; None where the controller is another process's.
    restart : callable or None
        Puts a controller in the place of the one there is.
    joining : list of Node
        Nodes that come with the faults.
    """

    nodes: dict[str, FaultyNode]
    plant: Pumped
    drive: Trips | None
    valve: Sticks | None
    version: int
    bus: FaultyBus | None = None
    law: LawFailures | None = None
    restart: Callable[[], None] | None = None
    joining: list[Node] = field(default_factory=list)
