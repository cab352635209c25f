"""Parts of a bench in which faults are placed, and a control law that fails on demand."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

import numpy as np

from firmware_sim.fault_injection.faulty_bus import FaultyBus
from firmware_sim.fault_injection.faulty_node import FaultyNode
from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import DriveFault
from utank_hil.control.interface import Controller
from utank_hil.runners import Node

LEANING_PA: Final = 1e4  #: Answer of a law that leans to one side. Chosen; no study.


@dataclass(slots=True)
class LawFailures:
    """Failures of the laws on a bench: exception, NaN, negated output, one-sided output.

    They are separate from the law, because a restarted controller creates a new one.
    """

    raises: bool = False
    answers_nan: bool = False
    opposite: bool = False
    leans: bool = False


class BreakableLaw:
    """Controller that can be made to fail; `fails` is read at each step."""

    def __init__(self, law: Controller, fails: LawFailures) -> None:
        self._law = law
        self._fails = fails

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Return the law's answer, or the failure's."""
        answer, fails = self._law.step(y, reference), self._fails
        if fails.raises:
            raise ArithmeticError("injected")
        if fails.answers_nan:
            return np.full_like(answer, np.nan)
        if fails.leans:
            return np.full_like(answer, LEANING_PA)
        return -answer if fails.opposite else answer

    def __getattr__(self, name: str) -> Any:
        return getattr(self._law, name)


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
