"""Control law that fails on demand."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control.interface import Controller

LEANING_PA: Final = 1e4  #: Answer of a law that leans to one side. Chosen; no study.


@dataclass(slots=True)
class LawFailures:
    """Failures of the laws on a bench: exception, NaN, negated output, one-sided output.

    They are separate from the law, because a restarted controller creates a new one.
    """

    raises: bool = False
    answers_nan: bool = False
    opposite: bool = False
    leans: bool = False


class BreakableLaw:
    """Controller that can be made to fail; `fails` is read at each step."""

    def __init__(self, law: Controller, fails: LawFailures) -> None:
        self._law = law
        self._fails = fails

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Return the law's answer, or the failure's."""
        answer, fails = self._law.step(y, reference), self._fails
        if fails.raises:
            raise ArithmeticError("injected")
        if fails.answers_nan:
            return np.full_like(answer, np.nan)
        if fails.leans:
            return np.full_like(answer, LEANING_PA)
        return -answer if fails.opposite else answer

    def __getattr__(self, name: str) -> Any:
        return getattr(self._law, name)
