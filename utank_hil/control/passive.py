"""The controller that does nothing: the tank as a passive damper."""

import numpy as np

from utank_hil.arrays import FloatArray


class PassiveController:
    """Zero pressure, whatever is measured.

    Parameters
    ----------
    inputs : int
        Number of pumps r.
    sample_time_s : float
    """

    def __init__(self, inputs: int = 1, sample_time_s: float = 0.2) -> None:
        self.sample_time_s = sample_time_s
        self._inputs = inputs

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:  # noqa: ARG002
        """Return zero pressure, shape (r,)."""
        return np.zeros(self._inputs)

    def applied(self, u: FloatArray) -> None:
        """Nothing to remember."""

    def reset(self) -> None:
        """Nothing to forget."""
