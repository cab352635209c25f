"""Common part of the adaptive fuzzy laws: parameters, error signal, brake, pause of adaptation.

A law computes a roll acceleration u from the error e = (phi - y_d, phi') and the fuzzy inputs x,
and adapts by s = B' P e (`ErrorDynamics`). A nominal g turns u into pressure; a brake on the water
may be added. Adaptation pauses after a limited command, because the response is not that to the
law's own command.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import KW_ONLY, dataclass
from typing import NamedTuple

import numpy as np

from utank_hil.base.arrays import FloatArray, plausible
from utank_hil.base.elementary import exp, log
from utank_hil.base.parameters import Checked, NotNegative, Positive, Problem, SampleTime
from utank_hil.base.tick import TICK_S
from utank_hil.control.gain import slope_at_rest
from utank_hil.control.interface import BuiltLaw, Controller, DesignPlant
from utank_hil.dynamics.linear import STATES

SETS = 3  #: Negative, zero, positive.
# Neighbouring sets cross at a membership of one half; the thesis gives no width.
WIDTH = 1 / math.sqrt(8 * log(2))
_OBEYED = 0.9  # share of a command that must be sent for adaptation to continue
_REACH = 2.0  # the inputs are limited to this multiple of their ranges
_LEVEL_RATE = STATES.index("level_rate_m_s")


@dataclass(frozen=True, slots=True)
class ErrorDynamics(Checked, owner="error dynamics"):
    """Wanted error dynamics and their Lyapunov function e' P e / 2.

    With e = (phi - y_d, phi'), the wanted dynamics e'' + 2 zeta w e' + w^2 e = 0 and ::

        A = [0 1; -w^2 -2 zeta w],    B = (0, 1),    A' P + P A = -q I

    the laws are driven by the scalar s = B' P e = p12 e + p22 e'. Thesis (4.13), (4.14).
    """

    frequency_rad_s: Positive  #: w.
    damping_ratio: Positive  #: zeta.
    q: Positive  #: Factor of Q = q I.

    @property
    def gains(self) -> tuple[float, float]:
        """Gains k of the outer loop: w^2 and 2 zeta w."""
        w = self.frequency_rad_s
        return w * w, 2 * self.damping_ratio * w

    @property
    def lyapunov(self) -> FloatArray:
        """P, shape (2, 2)."""
        k1, k2 = self.gains
        p12 = self.q / (2 * k1)
        p22 = (self.q / 2 + p12) / k2
        return np.array([[k2 * p12 + k1 * p22, p12], [p12, p22]])


class FuzzyBasis:
    """Basis of 3^n rules.

    Each input x_i has three linguistic values, negative, zero and positive, with Gaussian
    memberships exp(-((x_i - c) / sigma)^2 / 2) about the centres -c_i, 0, c_i; the outer two stay 1
    beyond their centres. Thesis (4.15), (4.26); the latter misprints the square, and centres that
    are all at or below zero. A rule's weight is the product of its memberships over the sum of all
    rules' products. The sum factors::

        xi_{jk...}(x) = nu_1j(x_1) nu_2k(x_2) ...,    nu_ij = mu_ij / sum_j mu_ij

    so the basis takes three exponentials per input and sums to one by construction, and xi xi' =
    prod_i sum_j nu_ij^2 needs no rules.

    Each of `ranges` is c_i of an input, in its unit: the value from which "positive" holds fully.
    """

    def __init__(self, ranges: tuple[float, ...]) -> None:
        if not ranges or not all(math.isfinite(c) and c > 0 for c in ranges):
            raise ValueError(f"fuzzy ranges must be positive and finite, got {ranges}")
        self.ranges = np.array(ranges, dtype=np.float64)
        self.rules = SETS ** len(ranges)  #: 3^n; 81 for four inputs.
        self._scales = [1 / c for c in ranges]

    def memberships(self, x: FloatArray) -> list[tuple[float, float, float]]:
        """Normalised memberships nu of each input (negative, zero, positive), summing to one."""
        # Plain arithmetic on a dozen numbers is several times faster than arrays.
        return [
            _degrees(value * scale) for value, scale in zip(x.tolist(), self._scales, strict=True)
        ]

    def __call__(self, x: FloatArray) -> FloatArray:
        """Basis xi, shape (3^n,), of inputs of shape (n,); the last input's set changes fastest."""
        xi: FloatArray = np.ones(1)
        for row in self.memberships(x):
            xi = np.multiply.outer(xi, row).ravel()
        return xi

    def square(self, x: FloatArray) -> float:
        """Squared length xi xi' of the basis: near 1 at a lone rule, less between rules."""
        square = 1.0
        for negative, zero, positive in self.memberships(x):
            square *= negative * negative + zero * zero + positive * positive
        return square


def _degrees(x: float) -> tuple[float, float, float]:
    """Normalised memberships of an input that is given in units of its range."""
    negative = 1.0 if x <= -1 else _gauss(x + 1)
    zero = _gauss(x)
    positive = 1.0 if x >= 1 else _gauss(x - 1)
    total = negative + zero + positive
    return negative / total, zero / total, positive / total


def _gauss(distance: float) -> float:
    return exp(-(distance * distance) / (2 * WIDTH * WIDTH))


@dataclass(frozen=True, slots=True)
class FuzzyLaw(Checked, ABC, owner="fuzzy law"):
    """Parameters of every adaptive fuzzy law."""

    error: ErrorDynamics
    ranges: tuple[Positive, ...]  #: Ranges of the fuzzy inputs, the first two to four of `STATES`.
    gain_rad_s2_pa: Positive  #: Nominal g: roll acceleration per pressure.
    _: KW_ONLY
    #: Pump pressure per level rate against the flow (`level_brake`); 0 for the thesis's law.
    brake_pa_s_m: NotNegative = 0.0
    sample_time_s: SampleTime = TICK_S

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
        problems, inputs = [], len(self.ranges)
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
    """

    starts_anew = True

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
