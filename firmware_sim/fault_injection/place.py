"""Interface of the bench to faults."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from firmware_sim.fault_injection.breakable_law import LawFailures
from firmware_sim.fault_injection.faulty_bus import FaultyBus
from firmware_sim.fault_injection.faulty_node import FaultyNode
from utank_hil.canbus import DriveFault
from utank_hil.runners import Node


class Pumped(Protocol):
    """Plant whose pump can be made to fail."""

    broken_pump: Callable[[float], float] | None
    presses_off: bool


class Trips(Protocol):
    """Drive that can be made to fail."""

    def fail(self, fault: DriveFault) -> None:
        """Enter the fault state; without a fault, switch off."""


class Sticks(Protocol):
    """Valve that can be made to fail."""

    stuck: bool
    powered: bool


@dataclass(slots=True)
class Bench:
    """Parts of a bench in which faults are placed."""

    nodes: dict[str, FaultyNode]
    plant: Pumped
    drive: Trips | None
    valve: Sticks | None
    version: int
    bus: FaultyBus | None = None  #: Simulated bus; None on a real one.
    #: Failures of the running controller's law; None if the controller is another process.
    law: LawFailures | None = None
    #: Function that replaces the controller by a new one.
    restart: Callable[[], None] | None = None
    joining: list[Node] = field(default_factory=list)
