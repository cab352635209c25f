"""Removal of the steady list from a law's measurements.

Wind, cargo and turning cause a list that the tank should not oppose: the pump would hold pressure
for hours and leave less level for the waves. The mean of each output, by a first-order low-pass
filter, is subtracted before the law::

    s(k) = s(k-1) + (1 - exp(-w0 Ts)) (y(k) - s(k-1)),    the law gets y(k) - s(k)
"""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from utank_hil.base.arrays import ComplexArray
from utank_hil.base.elementary import tanh
from utank_hil.control.interface import Controller, LinearLaw
from utank_hil.dynamics.sampling import LinearModel


class WashableLaw(LinearLaw, Protocol):
    """A linear law whose controller can subtract the mean of its outputs itself."""

    def controller(self, washout_share: float = 0.0) -> Controller:
        """Return a new controller at rest; `washout_share` as in `WashoutLaw.share`."""


@dataclass(frozen=True, slots=True)
class WashoutLaw:
    """A law on outputs without their mean."""

    law: WashableLaw
    corner_rad_s: float  #: w0, far below the ship's roll frequency.

    def __post_init__(self) -> None:
        if not (math.isfinite(self.corner_rad_s) and self.corner_rad_s > 0):
            raise ValueError(f"washout corner_rad_s must be positive, got {self.corner_rad_s}")

    @property
    def sample_time_s(self) -> float:
        """Time between two steps."""
        return self.law.sample_time_s

    @property
    def share(self) -> float:
        """Weight of the newest sample in the mean."""
        half = tanh(self.corner_rad_s * self.sample_time_s / 2)
        return 2 * half / (1 + half)

    def controller(self) -> Controller:
        """Return a new controller at rest; a reference is relative to the mean."""
        return self.law.controller(self.share)

    def response(self, z: ComplexArray) -> ComplexArray:
        """Transfer matrix at the points `z`, shape (N,); shape (N, r, m)."""
        mean = self.share / (1 - (1 - self.share) / np.asarray(z))
        return self.law.response(z) * (1 - mean)[:, None, None]

    def matrices(self) -> LinearModel:
        """State-space model from y to u: the law's own states, then the means."""
        law, share = self.law.matrices(), self.share
        states, outputs = law.B.shape
        keep = 1 - share
        a = np.block(
            [[law.A, -keep * law.B], [np.zeros((outputs, states)), keep * np.eye(outputs)]]
        )
        b = np.vstack([keep * law.B, share * np.eye(outputs)])
        c = np.hstack([law.C, -keep * law.D])
        return LinearModel(a, b, c, keep * law.D, law.dt)
