"""Common part of the adaptive fuzzy laws: parameters, error signal, brake, pause of adaptation.

A law computes a roll acceleration u from the error e = (phi - y_d, phi') and the fuzzy inputs x,
and adapts by s = B' P e (`ErrorDynamics`). A nominal g turns u into pressure; a brake on the water
may be added. Adaptation pauses after a limited command, because the response is not that to the
law's own command.
"""

from abc import ABC, abstractmethod
from dataclasses import KW_ONLY, dataclass
from typing import NamedTuple

import numpy as np

from utank_hil.base.arrays import FloatArray, plausible
from utank_hil.base.parameters import (
    NotNegative,
    Positive,
    Problem,
    SampleTime,
    range_problems,
    refuse,
)
from utank_hil.base.tick import TICK_S
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.fuzzy.basis import FuzzyBasis
from utank_hil.control.interface import BuiltLaw, Controller
from utank_hil.control.slope import slope_at_rest
from utank_hil.control.tracking_error import ErrorDynamics
from utank_hil.dynamics.linear import STATES

_OBEYED = 0.9  # share of a command that must be sent for adaptation to continue
_REACH = 2.0  # the inputs are limited to this multiple of their ranges
_LEVEL_RATE = STATES.index("level_rate_m_s")


@dataclass(frozen=True, slots=True)
class FuzzyLaw(ABC):
    """Parameters of every adaptive fuzzy law."""

    error: ErrorDynamics
    ranges: tuple[Positive, ...]  #: Ranges of the fuzzy inputs, the first two to four of `STATES`.
    gain_rad_s2_pa: Positive  #: Nominal g: roll acceleration per pressure.
    _: KW_ONLY
    #: Pump pressure per level rate against the flow (`level_brake`); 0 for the thesis's law.
    brake_pa_s_m: NotNegative = 0.0
    sample_time_s: SampleTime = TICK_S

    def __post_init__(self) -> None:
        refuse("fuzzy law", self._problems())

    def build(self, plant: DesignPlant) -> BuiltLaw:  # noqa: ARG002, its gain is a parameter
        """Return the law, the same for any plant; its initial form has a slope at rest."""
        measured = STATES[: len(self.ranges)]
        slope = slope_at_rest(self.controller, len(measured))
        return BuiltLaw(self.controller, measured, slope, at_rest=True, adapts=True)

    @abstractmethod
    def controller(self) -> Controller:
        """Return a new steppable controller."""

    def _problems(self) -> list[Problem]:
        """Find errors in the parameters; laws add the conditions of their proofs."""
        problems = range_problems(self)
        inputs = len(self.ranges)
        if not 2 <= inputs <= len(STATES):
            reason = f"must be those of at least roll and roll rate of {', '.join(STATES)}"
            problems.append(("ranges", f"{reason}, got {inputs} numbers"))
        if self.brake_pa_s_m and inputs <= _LEVEL_RATE:
            problems.append(("brake_pa_s_m", "needs the level rate as fourth of the ranges"))
        return problems


class FuzzyInputs(NamedTuple):
    """Inputs of a law in one step."""

    x: FloatArray  #: shape (n,): fuzzy inputs, limited to the reach of the rules.
    beyond: bool  #: Whether they were limited.
    e: tuple[float, float]  #: Errors of roll and of roll rate.
    s: float  #: B' P e.
    learning: bool  #: Whether the last command was sent unchanged.


class FuzzyController(ABC):
    """Stepping of a fuzzy law, with adaptation and acceleration in its subclasses.

    Parameters adapted before a fault or a disarming may have caused it, so an armed law restarts
    from its initial parameters (`StartsAnew`).

    `passed_limit` is empty, as the law has no limit that ends it.
    """

    passed_limit = ""

    def __init__(self, law: FuzzyLaw) -> None:
        self.sample_time_s = law.sample_time_s
        self._basis = FuzzyBasis(law.ranges)
        self._reach = _REACH * self._basis.ranges
        p = law.error.lyapunov
        self._p12, self._p22 = float(p[0, 1]), float(p[1, 1])
        self._gain_rad_s2_pa, self._brake_pa_s_m = law.gain_rad_s2_pa, law.brake_pa_s_m
        self.reset()

    def reset(self) -> None:
        """Discard the adaptation."""
        self._command_pa = 0.0
        self._learning = True
        self._forget()

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Pressure, shape (1,), for the fuzzy inputs `y`; the target of roll is one number."""
        y = plausible(y)
        x = np.minimum(np.maximum(y, -self._reach), self._reach)
        beyond = bool((x != y).any())
        # The error is that of the limited inputs, so that an extreme measurement cannot make
        # the parameters overflow.
        error, rate = float(x[0]), float(x[1])
        if reference is not None:
            error -= float(reference[0])
        s = self._p12 * error + self._p22 * rate
        acceleration = self._answer(FuzzyInputs(x, beyond, (error, rate), s, self._learning))
        self._command_pa = acceleration / self._gain_rad_s2_pa
        if self._brake_pa_s_m:
            self._command_pa -= self._brake_pa_s_m * float(y[_LEVEL_RATE])
        self._learning = True
        return np.array([self._command_pa])

    def applied(self, u: FloatArray) -> None:
        """Pause adaptation if the last command was limited."""
        left, asked = float(u[0]), self._command_pa
        self._learning = abs(left - asked) <= (1 - _OBEYED) * abs(asked)

    @abstractmethod
    def _answer(self, now: FuzzyInputs) -> float:
        """Return the roll acceleration, and adapt."""

    @abstractmethod
    def _forget(self) -> None:
        """Return to the initial parameters."""
