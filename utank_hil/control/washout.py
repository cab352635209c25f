"""Taking the steady list out of what a law sees.

Wind, cargo and turning give a list that the tank cannot and should not fight: the pump would hold
pressure for hours and the level would have less room for the waves. The mean of each output, as a
first-order low-pass sees it, is taken off before the law::

    s(k) = s(k-1) + (1 - exp(-w0 Ts)) (y(k) - s(k-1)),    the law sees y(k) - s(k)
"""

import math
from dataclasses import dataclass

import numpy as np

from utank_hil.arrays import ComplexArray, FloatArray
from utank_hil.control.interface import Controller, LinearLaw
from utank_hil.dynamics.sampling import LinearModel


@dataclass(frozen=True, slots=True)
class WashoutLaw:
    """A law that sees its outputs without their mean.

    Parameters
    ----------
    law : LinearLaw
    corner_rad_s : float
        w0, far below the ship's roll frequency.

    Raises
    ------
    ValueError
        If the corner is not positive.
    """

    law: LinearLaw
    corner_rad_s: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.corner_rad_s) and self.corner_rad_s > 0):
            raise ValueError(f"washout corner_rad_s must be positive, got {self.corner_rad_s}")

    @property
    def sample_time_s(self) -> float:
        """Time between two steps."""
        return self.law.sample_time_s

    @property
    def share(self) -> float:
        """Share of the newest sample in the mean."""
        return -math.expm1(-self.corner_rad_s * self.sample_time_s)

    def controller(self) -> "WashoutController":
        """A new steppable controller, at rest."""
        return WashoutController(self.law.controller(), self.share)

    def response(self, z: ComplexArray) -> ComplexArray:
        """Transfer matrix at the points `z`, shape (N,); shape (N, r, m)."""
        mean = self.share / (1 - (1 - self.share) / np.asarray(z))
        return self.law.response(z) * (1 - mean)[:, None, None]

    def matrices(self) -> LinearModel:
        """The law from y to u: its own states, then the means."""
        law, share = self.law.matrices(), self.share
        states, outputs = law.B.shape
        keep = 1 - share
        a = np.block(
            [[law.A, -keep * law.B], [np.zeros((outputs, states)), keep * np.eye(outputs)]]
        )
        b = np.vstack([keep * law.B, share * np.eye(outputs)])
        c = np.hstack([law.C, np.zeros((len(law.C), outputs))])
        return LinearModel(a, b, c, law.D, law.dt)


class WashoutController:
    """Steps another controller on its outputs without their mean.

    Parameters
    ----------
    controller : Controller
    share : float
        Share of the newest sample in the mean.
    """

    def __init__(self, controller: Controller, share: float) -> None:
        self.sample_time_s = controller.sample_time_s
        self._controller = controller
        self._share = share
        self._mean: FloatArray | float = 0.0

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Step with y less its mean; a `reference` is relative to the mean."""
        deviation = y - self._mean
        self._mean += self._share * deviation
        deviation *= 1 - self._share
        return self._controller.step(deviation, reference)

    def applied(self, u: FloatArray) -> None:
        """Pass on what was commanded."""
        self._controller.applied(u)

    def reset(self) -> None:
        """Forget the mean and the past."""
        self._mean = 0.0
        self._controller.reset()
