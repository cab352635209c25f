"""The retuner's interface to the controller, and an implementation for simulated time."""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from utank_hil.base.arrays import FloatArray
from utank_hil.retuning.answer import Answer, answer_bytes, read_answer
from utank_hil.retuning.estimate import EstimateRequest, MotionEstimate

Request = FloatArray | EstimateRequest | MotionEstimate
"""A record, shape (N, 1 + m), rows (command, outputs...); or the input of estimate or renewal."""

RetuneFunction = Callable[[Any], Answer]
"""From a request to an answer."""


class Work(NamedTuple):
    """One kind of work of the retuner's process.

    Attributes
    ----------
    compute : callable
        From a request to an answer.
    request : type
        Of the requests.
    most_numbers : int
        Numbers in the arrays of the longest request.
    """

    compute: RetuneFunction
    request: Any
    most_numbers: int


class Retuner(Protocol):
    """Takes requests and gives answers, some time later or never; the loop is not kept waiting."""

    @property
    def alive(self) -> bool:
        """Whether a request would be answered."""

    def submit(self, number: int, request: Request, now_ns: int) -> None:
        """Ask for an answer, under a new number."""

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

    def submit(self, number: int, request: Request, now_ns: int) -> None:
        """Compute the answer."""
        self._answer = answer_bytes(self._retune(request))
        self._number, self._ready_ns = number, now_ns + self._latency_ns

    def answer(self, number: int, now_ns: int) -> Answer | None:
        """The answer, once the latency is over."""
        if number != self._number or now_ns < self._ready_ns:
            return None
        return read_answer(self._answer)
