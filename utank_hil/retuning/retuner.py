"""The retuner's interface to the controller, and an implementation for simulated time."""

from collections.abc import Callable
from typing import Protocol

from utank_hil.base.arrays import FloatArray
from utank_hil.retuning.answer import Answer, answer_bytes, read_answer

RetuneFunction = Callable[[FloatArray], Answer]
"""From a record, shape (N, 1 + m), rows (command, outputs...), to an answer."""

Work = tuple[RetuneFunction, tuple[int, int]]
"""What is done with a record, and rows and columns of the longest one."""


class Retuner(Protocol):
    """Takes records and gives answers, some time later or never; the loop is not kept waiting."""

    @property
    def alive(self) -> bool:
        """Whether a request would be answered."""

    def submit(self, number: int, record: FloatArray, now_ns: int) -> None:
        """Request an answer for a record, under a new number."""

    def answer(self, number: int, now_ns: int) -> Answer | None:
        """The answer to request `number`, None while there is none."""


class SimulatedRetuner:
    """Computes the answer at once and delivers it after a fixed latency: runs are reproducible.

    Parameters
    ----------
    latency_s : float
        Simulated time from request to answer.

    Attributes
    ----------
    alive : bool
        Always True.
    """

    alive = True

    def __init__(self, retune: RetuneFunction, latency_s: float) -> None:
        self._retune = retune
        self._latency_ns = round(latency_s * 1e9)
        self._number = 0
        self._ready_ns = 0
        self._answer = b""

    def submit(self, number: int, record: FloatArray, now_ns: int) -> None:
        """Compute the answer."""
        self._answer = answer_bytes(self._retune(record))
        self._number, self._ready_ns = number, now_ns + self._latency_ns

    def answer(self, number: int, now_ns: int) -> Answer | None:
        """The answer, once the latency is over."""
        if number != self._number or now_ns < self._ready_ns:
            return None
        return read_answer(self._answer)
