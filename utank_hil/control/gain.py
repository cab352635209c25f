"""A constant gain on the newest measurement, u = -K (y - reference)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.ordered_sums import product
from utank_hil.base.parameters import SampleTime, range_problems, refuse
from utank_hil.control.interface import Controller, Memoryless
from utank_hil.dynamics.sampling import LinearModel

STEP: Final = 1e-6
"""Step to either side, in the unit of each input; far below the noise of a sensor."""


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


class GainController(Memoryless):
    """Stepping of a `GainLaw`, which has no memory."""

    def __init__(self, law: GainLaw) -> None:
        self.sample_time_s = law.sample_time_s
        self._gain = -law.gain

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Return -K (y - reference)."""
        error = y if reference is None else y - reference
        return product(self._gain, error)


def slope_at_rest(controller: Callable[[], Controller], inputs: int) -> GainLaw:
    """Linearize a law at rest, as a law of constant gain.

    A law that is unstable for the smallest roll is unstable, so its slope about rest must have the
    margins of a linear law. A law that adapts is linearized with its initial parameters.

    The first command of the controller must depend on its first measurement alone. ValueError is
    raised if the slope is not finite.
    """
    columns = []
    for push in STEP * np.eye(inputs):
        up, down = (controller().step(sign * push) for sign in (1.0, -1.0))
        columns.append((up - down) / (2 * STEP))
    slope = np.column_stack(columns)
    if not np.isfinite(slope).all():
        raise ValueError("its answer at rest overflows")
    return GainLaw(-slope, controller().sample_time_s)
