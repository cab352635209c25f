"""Error dynamics of the fuzzy laws, thesis (4.13) and (4.14).

With e = (phi - y_d, phi'), the wanted dynamics e'' + 2 zeta w e' + w^2 e = 0 and ::

    A = [0 1; -w^2 -2 zeta w],    B = (0, 1),    A' P + P A = -q I

the laws are driven by the scalar s = B' P e = p12 e + p22 e'.
"""

from dataclasses import dataclass

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.parameters import Positive, range_problems, refuse


@dataclass(frozen=True, slots=True)
class ErrorDynamics:
    """Wanted error dynamics and their Lyapunov function e' P e / 2."""

    frequency_rad_s: Positive  #: w.
    damping_ratio: Positive  #: zeta.
    q: Positive  #: Factor of Q = q I.

    def __post_init__(self) -> None:
        refuse("error dynamics", range_problems(self))

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
