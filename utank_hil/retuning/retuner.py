"""The retuner's interface to the controller, and an implementation for simulated time."""

from collections.abc import Callable
from typing import Any, Final, NamedTuple, Protocol

from utank_hil.base.arrays import FloatArray
from utank_hil.retuning.answer import Answer, answer_bytes, read_answer
from utank_hil.retuning.estimate import EstimateRequest, MotionEstimate

Request = FloatArray | EstimateRequest | MotionEstimate
"""A record, shape (N, 1 + m), rows (command, outputs...); or the input of estimate or renewal."""

RetuneFunction = Callable[[Any], Answer]  #: Function from a request to an answer.


class Work(NamedTuple):
    """One kind of work of the retuner's process: a function and the type of its requests.

    `most_numbers` is the number of array elements of the longest request.
    """

    compute: RetuneFunction
    request: Any
    most_numbers: int


class Retuner(Protocol):
    """Takes requests and answers them some time later or never, without delaying the loop."""

    @property
    def alive(self) -> bool:
        """Whether a request would be answered."""

    def submit(self, number: int, request: Request, now_ns: int) -> None:
        """Request an answer under a new number."""

    def answer(self, number: int, now_ns: int) -> Answer | None:
        """Return the answer to request `number`, None while there is none."""


LATENCY_S: Final = 5.0
"""Time that identification and design take in simulated time. Chosen; no study."""


class SimulatedRetuner:
    """Computes answers at once and delivers them after a fixed latency: runs are reproducible."""

    alive = True

    def __init__(self, retune: RetuneFunction, latency_s: float = LATENCY_S) -> None:
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
        """Return the answer once the latency is over."""
        if number != self._number or now_ns < self._ready_ns:
            return None
        return read_answer(self._answer)
