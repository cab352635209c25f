"""A constant gain on the newest measurement, u = -K (y - reference)."""

from dataclasses import dataclass

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.ordered_sums import product
from utank_hil.base.parameters import SampleTime, range_problems, refuse
from utank_hil.dynamics.sampling import LinearModel


@dataclass(frozen=True, slots=True, eq=False)
class GainLaw:
    """Constant feedback of the measured outputs, u(k) = -K y(k-1), with K of shape (r, m)."""

    gain: FloatArray
    sample_time_s: SampleTime

    def __post_init__(self) -> None:
        problems = range_problems(self)
        if self.gain.ndim != 2 or not np.isfinite(self.gain).all():
            reason = f"must be a matrix of finite numbers, got {self.gain.tolist()}"
            problems.append(("gain", reason))
        refuse("gain law", problems)

    def controller(self) -> "GainController":
        """A new steppable controller."""
        return GainController(self)

    def response(self, z: ComplexArray) -> ComplexArray:
        """Transfer matrix from y to u at the points `z`, shape (N,); shape (N, r, m)."""
        response: ComplexArray = -self.gain / np.asarray(z)[:, None, None]
        return response

    def matrices(self) -> LinearModel:
        """State-space model from y to u; its states are the last measurement."""
        inputs, outputs = self.gain.shape
        return LinearModel(
            np.zeros((outputs, outputs)),
            np.eye(outputs),
            -self.gain,
            np.zeros((inputs, outputs)),
            self.sample_time_s,
        )


class GainController:
    """Stepping of a `GainLaw`, which has no memory."""

    def __init__(self, law: GainLaw) -> None:
        self.sample_time_s = law.sample_time_s
        self._gain = -law.gain

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Return -K (y - reference)."""
        error = y if reference is None else y - reference
        return product(self._gain, error)

    def applied(self, u: FloatArray) -> None:
        """Ignore the command; the law has no memory."""

    def reset(self) -> None:
        """Do nothing; the law has no memory."""
