"""Direct adaptive fuzzy control of roll, thesis section 4.4.3: the law's own gains are adapted.

For phi'' = f(x) + g(x) u + d with f, d unknown and only the sign and a least size of g known. No
parameter of the fuzzy model of f is identified; its basis xi (`FuzzyBasis`) only says how strongly
to act. With s = B' P e (`ErrorDynamics`) and psi = 1 + x'x + abs(xi):

`SmallGainFuzzy`, (4.20)-(4.22), one parameter lambda::

    u = -lambda theta s,    theta = xi xi' / (4 gamma^2) + psi^2 / (4 rho^2)
    lambda' = Gamma (theta s^2 - sigma (lambda - lambda_0))

`RobustFuzzy`, (4.23)-(4.24), two parameters lambda and theta::

    u = -lambda xi xi' s / (2 gamma^2) - theta psi tanh(theta psi s / epsilon)
    lambda' = Gamma_1 (xi xi' s^2 / (2 gamma^2) - sigma_1 (lambda - lambda_0))
    theta' = Gamma_2 (psi abs(s) - sigma_2 (theta - theta_0))

The acceleration u is turned into pressure by a nominal g. The leakage (sigma) is integrated exactly
over a sample, so that the parameters stay bounded and positive at any sample time; what drives them
rests while the command is cut short or another law is in charge.

Derivation, and where the print differs: docs/controllers.md.
"""

import math
from dataclasses import dataclass

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.control.fuzzy_basis import FuzzyBasis
from utank_hil.control.tracking_error import ErrorDynamics

# part of the command that must have left for the parameters to learn from what followed
OBEYED = 0.9


@dataclass(frozen=True, slots=True)
class SmallGainFuzzy:
    """Law (4.20)-(4.22).

    Parameters
    ----------
    error : ErrorDynamics
        With q above 2.
    ranges : tuple of float
        Ranges of the fuzzy inputs; the first two are roll and roll rate, then level, level rate.
    gain_rad_s2_pa : float
        Nominal g: roll acceleration per pressure.
    gamma : float
        Below 1.
    rho : float
    adaptation, leakage : float
        Gamma and sigma.
    initial : float
        lambda_0, zero or more.
    brake_pa_s_m : float
        Pump pressure per level rate against the flow (`level_brake`); 0 for the source's law.
    sample_time_s : float

    Raises
    ------
    ValueError
        If a parameter is out of its range.
    """

    error: ErrorDynamics
    ranges: tuple[float, ...]
    gain_rad_s2_pa: float
    gamma: float
    rho: float
    adaptation: float
    leakage: float
    initial: float = 0.0
    brake_pa_s_m: float = 0.0
    sample_time_s: float = 0.01

    def __post_init__(self) -> None:
        _check(self, ("gain_rad_s2_pa", "gamma", "rho", "adaptation", "leakage", "sample_time_s"))
        if not (self.error.q > 2 and self.gamma < 1):
            raise ValueError("the law needs q above 2 and gamma below 1")
        if not (math.isfinite(self.initial) and self.initial >= 0):
            raise ValueError(f"fuzzy law initial must be zero or more, got {self.initial}")

    @property
    def start(self) -> tuple[float, ...]:
        """Parameters (lambda,) to start from and leak to."""
        return (self.initial,)

    def answer(
        self, parameters: tuple[float, ...], s: float, square: float, psi: float
    ) -> tuple[float, tuple[float, ...]]:
        """Acceleration u, and what drives each parameter, before leakage."""
        theta = square / (4 * self.gamma**2) + psi**2 / (4 * self.rho**2)
        return -parameters[0] * theta * s, (theta * s * s,)

    @property
    def rates(self) -> tuple[tuple[float, float], ...]:
        """Gamma and sigma of each parameter."""
        return ((self.adaptation, self.leakage),)

    def controller(self) -> "DirectFuzzyController":
        """A new steppable controller."""
        return DirectFuzzyController(self)


@dataclass(frozen=True, slots=True)
class RobustFuzzy:
    """Law (4.23)-(4.24).

    Parameters
    ----------
    error : ErrorDynamics
        With q above 1.
    ranges : tuple of float
        As in `SmallGainFuzzy`.
    gain_rad_s2_pa : float
    gamma : float
        Below 1.
    epsilon : float
        Softness of the switching term.
    adaptation, leakage : tuple of float
        Gamma_1, Gamma_2 and sigma_1, sigma_2.
    initial : tuple of float
        lambda_0, theta_0, zero or more.
    brake_pa_s_m : float
        Pump pressure per level rate against the flow (`level_brake`); 0 for the source's law.
    sample_time_s : float

    Raises
    ------
    ValueError
        If a parameter is out of its range.
    """

    error: ErrorDynamics
    ranges: tuple[float, ...]
    gain_rad_s2_pa: float
    gamma: float
    epsilon: float
    adaptation: tuple[float, float]
    leakage: tuple[float, float]
    initial: tuple[float, float] = (0.0, 0.0)
    brake_pa_s_m: float = 0.0
    sample_time_s: float = 0.01

    def __post_init__(self) -> None:
        _check(self, ("gain_rad_s2_pa", "gamma", "epsilon", "sample_time_s"))
        if not (self.error.q > 1 and self.gamma < 1):
            raise ValueError("the law needs q above 1 and gamma below 1")
        for name in ("adaptation", "leakage"):
            if not all(math.isfinite(value) and value > 0 for value in getattr(self, name)):
                raise ValueError(f"fuzzy law {name} must be positive, got {getattr(self, name)}")
        if not all(math.isfinite(value) and value >= 0 for value in self.initial):
            raise ValueError(f"fuzzy law initial must be zero or more, got {self.initial}")

    @property
    def start(self) -> tuple[float, ...]:
        """Parameters (lambda, theta) to start from and leak to."""
        return self.initial

    def answer(
        self, parameters: tuple[float, ...], s: float, square: float, psi: float
    ) -> tuple[float, tuple[float, ...]]:
        """Acceleration u, and what drives each parameter, before leakage."""
        gain, bound = parameters
        share = square / (2 * self.gamma**2)
        u = -gain * share * s - bound * psi * math.tanh(bound * psi * s / self.epsilon)
        return u, (share * s * s, psi * abs(s))

    @property
    def rates(self) -> tuple[tuple[float, float], ...]:
        """Gamma and sigma of each parameter."""
        return tuple(zip(self.adaptation, self.leakage, strict=True))

    def controller(self) -> "DirectFuzzyController":
        """A new steppable controller."""
        return DirectFuzzyController(self)


class DirectFuzzyController:
    """Steps a direct adaptive fuzzy law.

    Parameters
    ----------
    law : SmallGainFuzzy or RobustFuzzy

    Attributes
    ----------
    parameters : tuple of float
        What is adapted: (lambda,) or (lambda, theta).
    """

    def __init__(self, law: SmallGainFuzzy | RobustFuzzy) -> None:
        self.sample_time_s = law.sample_time_s
        self._law = law
        self._basis = FuzzyBasis(law.ranges)
        p = law.error.lyapunov
        self._p12, self._p22 = float(p[0, 1]), float(p[1, 1])
        self._leak = [
            (sigma, math.exp(-adaptation * sigma * law.sample_time_s))
            for adaptation, sigma in law.rates
        ]
        self.reset()

    def reset(self) -> None:
        """Forget what was learnt."""
        self.parameters = self._law.start
        self._command_pa = 0.0
        self._learning = True

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Pressure, shape (1,), for the fuzzy inputs `y`; the target of roll is one number."""
        roll = y[0] if reference is None else y[0] - reference[0]
        s = float(self._p12 * roll + self._p22 * y[1])
        x = np.minimum(np.maximum(y, -self._basis.ranges * 2), self._basis.ranges * 2)
        square = self._basis.square(x)
        psi = 1.0 + float(x.dot(x)) + math.sqrt(square)
        u, drives = self._law.answer(self.parameters, s, square, psi)
        self.parameters = tuple(
            self._adapted(value, start, drive if self._learning else 0.0, leak)
            for value, start, drive, leak in zip(
                self.parameters, self._law.start, drives, self._leak, strict=True
            )
        )
        self._command_pa = u / self._law.gain_rad_s2_pa
        if self._law.brake_pa_s_m:
            self._command_pa -= self._law.brake_pa_s_m * float(y[3])
        self._learning = True
        return np.array([self._command_pa])

    def applied(self, u: FloatArray) -> None:
        """Rest from learning if the last command was cut short."""
        left, asked = float(u[0]), self._command_pa
        self._learning = abs(left - asked) <= (1 - OBEYED) * abs(asked)

    @staticmethod
    def _adapted(value: float, start: float, drive: float, leak: tuple[float, float]) -> float:
        """Value after a sample of value' = Gamma (drive - sigma (value - start))."""
        sigma, kept = leak
        rest = start + drive / sigma
        return rest + (value - rest) * kept


def _check(law: SmallGainFuzzy | RobustFuzzy, names: tuple[str, ...]) -> None:
    for name in names:
        value = getattr(law, name)
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"fuzzy law {name} must be positive, got {value}")
    if len(law.ranges) < 2:
        raise ValueError("a fuzzy law needs at least roll and roll rate as inputs")
    FuzzyBasis(law.ranges)
