"""Direct adaptive fuzzy control of roll, thesis section 4.4.3, which adapts the law's own gains.

The plant is phi'' = f(x) + g(x) u + d with f, d unknown and only the sign and a least size of g
known. No parameter of the fuzzy model of f is identified; its basis xi (`FuzzyBasis`) only
determines the gain. With s = B' P e (`ErrorDynamics`) and psi = 1 + x'x + abs(xi), law
(4.23)-(4.24) has two parameters lambda and theta::

    u = -lambda xi xi' s / (2 gamma^2) - theta psi tanh(theta psi s / epsilon)
    lambda' = Gamma_1 (xi xi' s^2 / (2 gamma^2) - sigma_1 (lambda - lambda_0))
    theta' = Gamma_2 (psi abs(s) - sigma_2 (theta - theta_0))

A nominal g turns the acceleration u into pressure. The leakage (sigma) is integrated exactly over a
sample, so the parameters stay bounded and positive at any sample time. Adaptation pauses while the
command is limited or another law is active.

The derivation, and deviations from the print, are in docs/control.md.
"""

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np

from utank_hil.base.elementary import exp, tanh
from utank_hil.base.ordered_sums import product
from utank_hil.base.parameters import NotNegative, Positive, Problem, Range
from utank_hil.control.fuzzy.law import FuzzyController, FuzzyInputs, FuzzyLaw


class DirectFuzzyLaw(FuzzyLaw):
    """Law that adapts its own gains; its rates and first values are numbers, or one of each."""

    least_q: ClassVar[float]  #: Factor of Q above which the law's proof holds.
    if TYPE_CHECKING:
        adaptation: Any
        leakage: Any
        initial: Any

    @property
    def start(self) -> tuple[float, ...]:
        """Initial parameters, which the leakage returns to."""
        return tuple(np.atleast_1d(self.initial).tolist())

    @property
    def rates(self) -> tuple[tuple[float, float], ...]:
        """Gamma and sigma of each parameter."""
        each = (np.atleast_1d(of).tolist() for of in (self.adaptation, self.leakage))
        return tuple(zip(*each, strict=True))

    @abstractmethod
    def answer(
        self, parameters: tuple[float, ...], s: float, square: float, psi: float
    ) -> tuple[float, tuple[float, ...]]:
        """Acceleration u, and the driving term of each parameter, without leakage."""

    def controller(self) -> "DirectFuzzyController":
        """Return a new steppable controller."""
        return DirectFuzzyController(self)

    def _problems(self) -> list[Problem]:
        """Find errors in the parameters, and an eigenvalue that is too small for the proof."""
        problems, q = super()._problems(), self.error.q
        if not q > self.least_q:
            problems.append(("error.q", f"must be above {self.least_q:g} for this law, got {q}"))
        return problems


@dataclass(frozen=True, slots=True)
class RobustFuzzy(DirectFuzzyLaw):
    """Law (4.23)-(4.24); q above 1."""

    least_q: ClassVar[float] = 1.0
    gamma: Annotated[float, Range(above=0, below=1)]
    epsilon: Positive  #: Softness of the switching term.
    adaptation: tuple[Positive, Positive]  #: Gamma_1, Gamma_2.
    leakage: tuple[Positive, Positive]  #: sigma_1, sigma_2.
    initial: tuple[NotNegative, NotNegative] = (0.0, 0.0)  #: lambda_0, theta_0, zero or more.
    kind: Literal["fuzzy_robust"] = "fuzzy_robust"

    def answer(
        self, parameters: tuple[float, ...], s: float, square: float, psi: float
    ) -> tuple[float, tuple[float, ...]]:
        """Acceleration u, and the driving term of each parameter, without leakage."""
        gain, bound = parameters
        share = square / (2 * self.gamma * self.gamma)
        u = -gain * share * s - bound * psi * tanh(bound * psi * s / self.epsilon)
        return u, (share * s * s, psi * abs(s))


class DirectFuzzyController(FuzzyController):
    """Stepping of a direct adaptive fuzzy law."""

    def __init__(self, law: DirectFuzzyLaw) -> None:
        self.law = law
        self._leak = [
            (sigma, exp(-adaptation * sigma * law.sample_time_s)) for adaptation, sigma in law.rates
        ]
        super().__init__(law)

    def _forget(self) -> None:
        self.parameters = self.law.start

    def _answer(self, now: FuzzyInputs) -> float:
        square = self._basis.square(now.x)
        psi = 1.0 + float(product(now.x, now.x)) + math.sqrt(square)
        u, drives = self.law.answer(self.parameters, now.s, square, psi)
        self.parameters = tuple(
            self._adapted(value, start, drive if now.learning else 0.0, leak)
            for value, start, drive, leak in zip(
                self.parameters, self.law.start, drives, self._leak, strict=True
            )
        )
        return u

    @staticmethod
    def _adapted(value: float, start: float, drive: float, leak: tuple[float, float]) -> float:
        """Value after a sample of value' = Gamma (drive - sigma (value - start))."""
        sigma, kept = leak
        rest = start + drive / sigma
        return rest + (value - rest) * kept
