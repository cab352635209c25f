"""What the adaptive fuzzy laws have in common: parameters, error signal, brake, rest from learning.

A law gives a roll acceleration u from the error e = (phi - y_d, phi') and the fuzzy inputs x, and
learns driven by s = B' P e (`ErrorDynamics`). A nominal g turns u into pressure; a brake on the
water may be added. Nothing is learnt from a command that was cut short: what followed it is not
what the law asked for.
"""

from abc import ABC, abstractmethod
from dataclasses import KW_ONLY, dataclass
from typing import NamedTuple

import numpy as np

from utank_hil.base.arrays import FloatArray
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

_OBEYED = 0.9  # part of a command that must have left for the law to learn from what followed
_REACH = 2.0  # the inputs are held within so many times their ranges
_LEVEL_RATE = STATES.index("level_rate_m_s")


@dataclass(frozen=True, slots=True)
class FuzzyLaw(ABC):
    """Parameters of every adaptive fuzzy law.

    Parameters
    ----------
    ranges : tuple of float
        Ranges of the fuzzy inputs, the first two to four of `STATES`.
    gain_rad_s2_pa : float
        Nominal g: roll acceleration per pressure.
    brake_pa_s_m : float
        Pump pressure per level rate against the flow (`level_brake`); 0 for the source's law.
    """

    error: ErrorDynamics
    ranges: tuple[Positive, ...]
    gain_rad_s2_pa: Positive
    _: KW_ONLY
    brake_pa_s_m: NotNegative = 0.0
    sample_time_s: SampleTime = TICK_S

    def __post_init__(self) -> None:
        refuse("fuzzy law", self._problems())

    def build(self, plant: DesignPlant) -> BuiltLaw:  # noqa: ARG002, its gain is a parameter
        """The law, for any plant; what it starts from has a slope at rest."""
        measured = STATES[: len(self.ranges)]
        slope = slope_at_rest(self.controller, len(measured))
        return BuiltLaw(self.controller, measured, slope, at_rest=True, adapts=True)

    @abstractmethod
    def controller(self) -> Controller:
        """A new steppable controller."""

    def _problems(self) -> list[Problem]:
        """What is wrong with the parameters; laws add to it what their proofs ask for."""
        problems = range_problems(self)
        inputs = len(self.ranges)
        if not 2 <= inputs <= len(STATES):
            reason = f"must be those of at least roll and roll rate of {', '.join(STATES)}"
            problems.append(("ranges", f"{reason}, got {inputs} numbers"))
        if self.brake_pa_s_m and inputs <= _LEVEL_RATE:
            problems.append(("brake_pa_s_m", "needs the level rate as fourth of the ranges"))
        return problems


class FuzzyInputs(NamedTuple):
    """What a law sees in one step.

    Attributes
    ----------
    x : ndarray, shape (n,)
        Fuzzy inputs, held within reach of the rules.
    beyond : bool
        Whether they had to be.
    e : tuple of float
        Errors of roll and of roll rate.
    s : float
        B' P e.
    learning : bool
        Whether the last command left as it was asked for.
    """

    x: FloatArray
    beyond: bool
    e: tuple[float, float]
    s: float
    learning: bool


class FuzzyController(ABC):
    """Steps a fuzzy law; what is learnt, and the acceleration, are its subclasses'.

    What was learnt before a fault, or before an operator disarmed, may be what led to it: an armed
    law starts anew (`StartsAnew`).

    Attributes
    ----------
    passed_limit : str
        Empty: the law has no limit that ends it.
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
        """Forget what was learnt."""
        self._command_pa = 0.0
        self._learning = True
        self._forget()

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Pressure, shape (1,), for the fuzzy inputs `y`; the target of roll is one number."""
        x = np.minimum(np.maximum(y, -self._reach), self._reach)
        beyond = bool((x != y).any())
        # the error from the inputs as they are held: a measurement that overflows is no reason to
        # learn what a float does not hold
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
        """Rest from learning if the last command was cut short."""
        left, asked = float(u[0]), self._command_pa
        self._learning = abs(left - asked) <= (1 - _OBEYED) * abs(asked)

    @abstractmethod
    def _answer(self, now: FuzzyInputs) -> float:
        """Give the roll acceleration, and learn."""

    @abstractmethod
    def _forget(self) -> None:
        """Go back to the parameters that the law starts with."""
