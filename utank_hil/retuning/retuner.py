"""Who identifies and designs: what the controller sees of it, and the one for simulated time."""

from collections.abc import Callable
from typing import Protocol

from utank_hil.arrays import FloatArray
from utank_hil.retuning.answer import Answer, answer_bytes, read_answer

Work = Callable[[FloatArray], Answer]
"""From a record, rows of (command, outputs...) at the law's sample time, to an answer."""


class Retuner(Protocol):
    """Takes records and gives answers, some time later or never."""

    @property
    def alive(self) -> bool:
        """Whether a record would be worked off; known at once."""

    def submit(self, number: int, record: FloatArray, now_ns: int) -> None:
        """Hand over a record under a number of its own; returns at once."""

    def answer(self, number: int, now_ns: int) -> Answer | None:
        """The answer to that number, None as long as there is none; returns at once."""


class SimulatedRetuner:
    """Does the work at once and hands the answer out later: the same run, the same answer.

    Parameters
    ----------
    work : callable
    latency_s : float
        Simulated time that the work takes.

    Attributes
    ----------
    alive : bool
        Always.
    """

    alive = True

    def __init__(self, work: Work, latency_s: float) -> None:
        self._work = work
        self._latency_ns = round(latency_s * 1e9)
        self._number = 0
        self._ready_ns = 0
        self._answer = b""

    def submit(self, number: int, record: FloatArray, now_ns: int) -> None:
        """Do the work."""
        self._answer = answer_bytes(self._work(record))
        self._number, self._ready_ns = number, now_ns + self._latency_ns

    def answer(self, number: int, now_ns: int) -> Answer | None:
        """Hand the answer out when its time has come."""
        if number != self._number or now_ns < self._ready_ns:
            return None
        return read_answer(self._answer)
