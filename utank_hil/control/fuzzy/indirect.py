"""The thesis's other two adaptive fuzzy laws, beside `RobustFuzzy`.

`SmallGainFuzzy`, section 4.4.3, (4.20)-(4.22), one parameter lambda::

    u = -lambda theta s,    theta = xi xi' / (4 gamma^2) + psi^2 / (4 rho^2)
    lambda' = Gamma (theta s^2 - sigma (lambda - lambda_0))

`IndirectFuzzy`, section 4.4.4: f and g are learnt, then inverted::

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

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.elementary import exp
from utank_hil.base.ordered_sums import product
from utank_hil.base.parameters import Finite, NotNegative, Positive, Problem, Range
from utank_hil.control.fuzzy.adaptive import DirectFuzzyLaw
from utank_hil.control.fuzzy.law import FuzzyController, FuzzyInputs, FuzzyLaw


@dataclass(frozen=True, slots=True)
class SmallGainFuzzy(DirectFuzzyLaw):
    """Law (4.20)-(4.22); q above 2."""

    least_q: ClassVar[float] = 2.0
    gamma: Annotated[float, Range(above=0, below=1)]
    rho: Positive
    adaptation: Positive  #: Gamma.
    leakage: Positive  #: sigma.
    initial: NotNegative = 0.0  #: lambda_0, zero or more.
    kind: Literal["fuzzy_small_gain"] = "fuzzy_small_gain"

    def answer(
        self, parameters: tuple[float, ...], s: float, square: float, psi: float
    ) -> tuple[float, tuple[float, ...]]:
        """Acceleration u, and the driving term of each parameter, without leakage."""
        theta = square / (4 * self.gamma * self.gamma) + psi * psi / (4 * self.rho * self.rho)
        return -parameters[0] * theta * s, (theta * s * s,)


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
