"""A control law that fails on demand."""

from typing import Any, Final

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.control.interface import Controller

LEANING_PA: Final = 1e4


class BreakableLaw:
    """A controller that can be made to raise, or to answer what is no number.

    Attributes
    ----------
    raises, answers_nan, opposite, leans : bool
        What it does: an error, no number, the negative of what it should, the same to one side.
    """

    def __init__(self, law: Controller) -> None:
        self._law = law
        self.raises = self.answers_nan = self.opposite = self.leans = False

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """As `Controller.step`, unless it fails."""
        answer = self._law.step(y, reference)
        if self.raises:
            raise ArithmeticError("injected")
        if self.answers_nan:
            return np.full_like(answer, np.nan)
        if self.leans:
            return np.full_like(answer, LEANING_PA)
        return -answer if self.opposite else answer

    def __getattr__(self, name: str) -> Any:
        return getattr(self._law, name)
