"""Direct adaptive fuzzy control of roll, thesis section 4.4.3, which adapts the law's own gains.

The plant is phi'' = f(x) + g(x) u + d with f, d unknown and only the sign and a least size of g
known. No parameter of the fuzzy model of f is identified; its basis xi (`FuzzyBasis`) only
determines the gain. With s = B' P e (`ErrorDynamics`) and psi = 1 + x'x + abs(xi):

`SmallGainFuzzy`, (4.20)-(4.22), one parameter lambda::

    u = -lambda theta s,    theta = xi xi' / (4 gamma^2) + psi^2 / (4 rho^2)
    lambda' = Gamma (theta s^2 - sigma (lambda - lambda_0))

`RobustFuzzy`, (4.23)-(4.24), two parameters lambda and theta::

    u = -lambda xi xi' s / (2 gamma^2) - theta psi tanh(theta psi s / epsilon)
    lambda' = Gamma_1 (xi xi' s^2 / (2 gamma^2) - sigma_1 (lambda - lambda_0))
    theta' = Gamma_2 (psi abs(s) - sigma_2 (theta - theta_0))

A nominal g turns the acceleration u into pressure. The leakage (sigma) is integrated exactly over a
sample, so the parameters stay bounded and positive at any sample time. Adaptation pauses while the
command is limited or another law is active.

The derivation, and deviations from the print, are in docs/control.md.

Indirect adaptive fuzzy control of roll, thesis section 4.4.4: f and g are learnt, then inverted.

::

    u = (-fhat(x) - k' e) / ghat(x)                                            (4.25)
    fhat = xi(x) A (1, x),    ghat = xi(x) b

A holds the consequents of the Takagi-Sugeno rules, (3^n, n + 1). For ghat they are constants: a
weighted mean of numbers at or above a least value is at or above it too, so limiting each b_i is
the projection that keeps ghat away from zero. With s = B' P e ::

    A' = gamma_f s xi' (1, x) - leakage (A - A_0)
    b' = gamma_g s u xi'      - leakage (b - 1),       b_i >= least

V = e' P e / 2 + tr(Ã' Ã) / (2 gamma_f) + b̃' b̃ / (2 gamma_g) decreases wherever f and g are of
this form (without leakage; with it, outside a bound). u is a roll acceleration, by a nominal g, so
g is near one.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.elementary import exp, tanh
from utank_hil.base.ordered_sums import product
from utank_hil.base.parameters import Finite, NotNegative, Positive, Problem, Range
from utank_hil.control.fuzzy.law import FuzzyController, FuzzyInputs, FuzzyLaw

_Gamma = Annotated[float, Range(above=0, below=1)]


@dataclass(frozen=True, slots=True)
class SmallGainFuzzy(FuzzyLaw):
    """Law (4.20)-(4.22); q above 2."""

    gamma: _Gamma  #: Below 1.
    rho: Positive
    adaptation: Positive  #: Gamma.
    leakage: Positive  #: sigma.
    initial: NotNegative = 0.0  #: lambda_0, zero or more.
    kind: Literal["fuzzy_small_gain"] = "fuzzy_small_gain"

    def _problems(self) -> list[Problem]:
        return [*FuzzyLaw._problems(self), *_q_problems(self, above=2)]

    @property
    def start(self) -> tuple[float, ...]:
        """Initial parameters (lambda,), which the leakage returns to."""
        return (self.initial,)

    def answer(
        self, parameters: tuple[float, ...], s: float, square: float, psi: float
    ) -> tuple[float, tuple[float, ...]]:
        """Acceleration u, and the driving term of each parameter, without leakage."""
        theta = square / (4 * self.gamma * self.gamma) + psi * psi / (4 * self.rho * self.rho)
        return -parameters[0] * theta * s, (theta * s * s,)

    @property
    def rates(self) -> tuple[tuple[float, float], ...]:
        """Gamma and sigma of each parameter."""
        return ((self.adaptation, self.leakage),)

    def controller(self) -> "DirectFuzzyController":
        """A new steppable controller."""
        return DirectFuzzyController(self)


@dataclass(frozen=True, slots=True)
class RobustFuzzy(FuzzyLaw):
    """Law (4.23)-(4.24); q above 1."""

    gamma: _Gamma  #: Below 1.
    epsilon: Positive  #: Softness of the switching term.
    adaptation: tuple[Positive, Positive]  #: Gamma_1, Gamma_2.
    leakage: tuple[Positive, Positive]  #: sigma_1, sigma_2.
    initial: tuple[NotNegative, NotNegative] = (0.0, 0.0)  #: lambda_0, theta_0, zero or more.
    kind: Literal["fuzzy_robust"] = "fuzzy_robust"

    def _problems(self) -> list[Problem]:
        return [*FuzzyLaw._problems(self), *_q_problems(self, above=1)]

    @property
    def start(self) -> tuple[float, ...]:
        """Initial parameters (lambda, theta), which the leakage returns to."""
        return self.initial

    def answer(
        self, parameters: tuple[float, ...], s: float, square: float, psi: float
    ) -> tuple[float, tuple[float, ...]]:
        """Acceleration u, and the driving term of each parameter, without leakage."""
        gain, bound = parameters
        share = square / (2 * self.gamma * self.gamma)
        u = -gain * share * s - bound * psi * tanh(bound * psi * s / self.epsilon)
        return u, (share * s * s, psi * abs(s))

    @property
    def rates(self) -> tuple[tuple[float, float], ...]:
        """Gamma and sigma of each parameter."""
        return tuple(zip(self.adaptation, self.leakage, strict=True))

    def controller(self) -> "DirectFuzzyController":
        """A new steppable controller."""
        return DirectFuzzyController(self)


def _q_problems(law: FuzzyLaw, above: float) -> list[Problem]:
    """Find an eigenvalue that is too small for the proof of a law."""
    q = law.error.q
    return [] if q > above else [("error.q", f"must be above {above:g} for this law, got {q}")]


class DirectFuzzyController(FuzzyController):
    """Stepping of a direct adaptive fuzzy law; adapts (lambda,) or (lambda, theta)."""

    def __init__(self, law: SmallGainFuzzy | RobustFuzzy) -> None:
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


@dataclass(frozen=True, slots=True)
class IndirectFuzzy(FuzzyLaw):
    """Law (4.25)."""

    adaptation_f: Positive  #: gamma_f.
    adaptation_g: Positive  #: gamma_g.
    leakage: Positive  #: Per second.
    #: Least ghat over the nominal g; above 0, below 1.
    least_gain: Annotated[float, Range(above=0, below=1)] = 0.3
    #: Initial f of every rule: a constant, then a factor for each input.
    prior: tuple[Finite, ...] | None = None
    kind: Literal["fuzzy_indirect"] = "fuzzy_indirect"

    def _problems(self) -> list[Problem]:
        problems, needed = FuzzyLaw._problems(self), len(self.ranges) + 1
        if self.prior is not None and len(self.prior) != needed:
            problems.append(("prior", f"must have {needed} numbers, got {len(self.prior)}"))
        return problems

    def controller(self) -> "IndirectFuzzyController":
        """A new steppable controller."""
        return IndirectFuzzyController(self)


class IndirectFuzzyController(FuzzyController):
    """Stepping of an `IndirectFuzzy`.

    `drift`, shape (rules, inputs + 1), is A, the consequents of fhat; `gain`, shape (rules,), is b,
    those of ghat.
    """

    def __init__(self, law: IndirectFuzzy) -> None:
        self._law = law
        inputs = len(law.ranges)
        self._prior = np.zeros(inputs + 1) if law.prior is None else np.array(law.prior)
        self._k1, self._k2 = law.error.gains
        self._kept = exp(-law.leakage * law.sample_time_s)
        self._extended = np.ones(inputs + 1)
        super().__init__(law)

    def _forget(self) -> None:
        self._start = np.tile(self._prior, (self._basis.rules, 1))
        self.drift = self._start.copy()
        self.gain = np.ones(self._basis.rules)

    def _answer(self, now: FuzzyInputs) -> float:
        xi = self._basis(now.x)
        self._extended[1:] = now.x
        drift = float(product(product(xi, self.drift), self._extended))
        u = (-drift - self._k1 * now.e[0] - self._k2 * now.e[1]) / float(product(xi, self.gain))
        # The rules do not describe inputs beyond their range.
        self._adapt(xi, now.s if now.learning and not now.beyond else 0.0, u)
        return u

    def _adapt(self, xi: FloatArray, s: float, u: float) -> None:
        """Adapt A and b over a sample by the error signal `s` under the acceleration `u`."""
        law, kept = self._law, self._kept
        per_rate = (1 - kept) / law.leakage  # close to the sample time for a small leakage
        self.drift -= self._start
        self.drift *= kept
        self.drift += self._start
        self.drift += np.multiply.outer((law.adaptation_f * per_rate * s) * xi, self._extended)
        self.gain = 1 + kept * (self.gain - 1) + (law.adaptation_g * per_rate * s * u) * xi
        np.maximum(self.gain, law.least_gain, out=self.gain)
