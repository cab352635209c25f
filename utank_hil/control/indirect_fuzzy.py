"""Indirect adaptive fuzzy control of roll, thesis section 4.4.4: f and g are learnt, then inverted.

::

    u = (-fhat(x) - k' e) / ghat(x)                                            (4.25)
    fhat = xi(x) A (1, x),    ghat = xi(x) b

A holds the consequents of the Takagi-Sugeno rules, (3^n, n + 1). For ghat they are constants: a
weighted mean of numbers that are all at or above a least value stays there itself, so that keeping
each b_i above it is the projection that keeps ghat away from zero, everywhere. With s = B' P e ::

    A' = gamma_f s xi' (1, x) - leakage (A - A_0)
    b' = gamma_g s u xi'      - leakage (b - 1),       b_i >= least

make V = e' P e / 2 + tr(Ã' Ã) / (2 gamma_f) + b̃' b̃ / (2 gamma_g) fall wherever f and g are of this
form (without leakage; with it, outside a bound). u is counted in roll acceleration, by a nominal g,
so that g is near one.
"""

import math
from dataclasses import dataclass

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.control.direct_fuzzy import OBEYED
from utank_hil.control.fuzzy_basis import FuzzyBasis
from utank_hil.control.tracking_error import ErrorDynamics


@dataclass(frozen=True, slots=True)
class IndirectFuzzy:
    """Law (4.25).

    Parameters
    ----------
    error : ErrorDynamics
    ranges : tuple of float
        Ranges of the fuzzy inputs; the first two are roll and roll rate, then level, level rate.
    gain_rad_s2_pa : float
        Nominal g: roll acceleration per pressure.
    adaptation_f, adaptation_g : float
        gamma_f and gamma_g.
    leakage : float
        Per second.
    least_gain : float
        Least ghat, in nominal ones; above 0, below 1.
    prior : tuple of float, optional
        What every rule knows of f before learning: a constant, then a factor for each input.
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
    adaptation_f: float
    adaptation_g: float
    leakage: float
    least_gain: float = 0.3
    prior: tuple[float, ...] | None = None
    brake_pa_s_m: float = 0.0
    sample_time_s: float = 0.01

    def __post_init__(self) -> None:
        for name in (
            "gain_rad_s2_pa",
            "adaptation_f",
            "adaptation_g",
            "leakage",
            "sample_time_s",
        ):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"fuzzy law {name} must be positive, got {value}")
        if not 0 < self.least_gain < 1:
            raise ValueError(f"fuzzy law least_gain must be 0 to 1, got {self.least_gain}")
        if len(self.ranges) < 2:
            raise ValueError("a fuzzy law needs at least roll and roll rate as inputs")
        if self.prior is not None and len(self.prior) != len(self.ranges) + 1:
            raise ValueError(f"fuzzy law prior must have {len(self.ranges) + 1} numbers")
        FuzzyBasis(self.ranges)

    def controller(self) -> "IndirectFuzzyController":
        """A new steppable controller."""
        return IndirectFuzzyController(self)


class IndirectFuzzyController:
    """Steps an `IndirectFuzzy`.

    Parameters
    ----------
    law : IndirectFuzzy

    Attributes
    ----------
    drift : ndarray, shape (rules, inputs + 1)
        A, the consequents of fhat.
    gain : ndarray, shape (rules,)
        b, the consequents of ghat.
    """

    def __init__(self, law: IndirectFuzzy) -> None:
        self.sample_time_s = law.sample_time_s
        self._law = law
        self._basis = FuzzyBasis(law.ranges)
        inputs = len(law.ranges)
        prior = np.zeros(inputs + 1) if law.prior is None else np.array(law.prior)
        self._start = np.tile(prior, (self._basis.rules, 1))
        self._k1, self._k2 = law.error.gains
        p = law.error.lyapunov
        self._p12, self._p22 = float(p[0, 1]), float(p[1, 1])
        self._kept = math.exp(-law.leakage * law.sample_time_s)
        self._extended = np.ones(inputs + 1)
        self.reset()

    def reset(self) -> None:
        """Forget what was learnt."""
        self.drift = self._start.copy()
        self.gain = np.ones(self._basis.rules)
        self._command_pa = 0.0
        self._learning = True

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Pressure, shape (1,), for the fuzzy inputs `y`; the target of roll is one number."""
        law, basis = self._law, self._basis
        error = float(y[0] if reference is None else y[0] - reference[0])
        rate = float(y[1])
        x = np.minimum(np.maximum(y, -basis.ranges * 2), basis.ranges * 2)
        xi = basis(x)
        self._extended[1:] = x
        drift = float(xi.dot(self.drift).dot(self._extended))
        u = (-drift - self._k1 * error - self._k2 * rate) / float(xi.dot(self.gain))
        s = self._p12 * error + self._p22 * rate
        inside = bool((x == y).all())  # the rules know nothing of what lies beyond
        self.adapt(xi, s if self._learning and inside else 0.0, u)
        self._command_pa = u / law.gain_rad_s2_pa
        if law.brake_pa_s_m:
            self._command_pa -= law.brake_pa_s_m * float(y[3])
        self._learning = True
        return np.array([self._command_pa])

    def adapt(self, xi: FloatArray, s: float, u: float) -> None:
        """Let A and b learn over a sample from the error signal `s` under the acceleration `u`."""
        law, kept = self._law, self._kept
        per_rate = (1 - kept) / law.leakage  # the sample time, for a small leakage
        self.drift -= self._start
        self.drift *= kept
        self.drift += self._start
        self.drift += np.multiply.outer((law.adaptation_f * per_rate * s) * xi, self._extended)
        self.gain = 1 + kept * (self.gain - 1) + (law.adaptation_g * per_rate * s * u) * xi
        np.maximum(self.gain, law.least_gain, out=self.gain)

    def applied(self, u: FloatArray) -> None:
        """Rest from learning if the last command was cut short."""
        left, asked = float(u[0]), self._command_pa
        self._learning = abs(left - asked) <= (1 - OBEYED) * abs(asked)
