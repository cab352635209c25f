"""A retuner that gives the answers of a recording."""

from collections import deque

from utank_hil.retuning.answer import Answer, read_answer
from utank_hil.retuning.retuner import Request


class RecordedRetuner:
    """Gives the answers of a recording, in the ticks in which they were taken."""

    def __init__(self) -> None:
        #: Request of the controller that was not recorded; empty if there is none.
        self.astray = ""
        self._alive: deque[bool] = deque()
        self._answer = bytearray()

    @property
    def alive(self) -> bool:
        """Whether the retuner lived."""
        if not self._alive:
            self.astray = "asked whether the retuner lives"
            return False
        return self._alive.popleft()

    def submit(self, number: int, request: Request, now_ns: int) -> None:
        """Take a request, whose answer is known."""

    def answer(self, number: int, now_ns: int) -> Answer | None:  # noqa: ARG002
        """Return the answer if it was taken in this tick."""
        if not self._answer:
            return None
        answer = read_answer(bytes(self._answer))
        self._answer.clear()
        return answer

    def take(self, data: bytes, *, alive: bool) -> None:
        """Take a record for the next tick: the retuner's state, or a piece of its answer."""
        if alive:
            self._alive.append(bool(data[0]))
        else:
            self._answer += data

    def left_over(self) -> str:
        """Return, and clear, the recorded requests of this tick that were not repeated."""
        left = "took the retuner's answer" if self._answer else ""
        left = "asked whether the retuner lives" if self._alive else left
        self._alive.clear()
        self._answer.clear()
        return left
