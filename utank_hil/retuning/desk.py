"""A desk: the requests of one kind to the retuner's process, and their answers.

The mailboxes hold the only state: a request is open while its number differs from the answer's.
"""

import sys
import time
import traceback
from typing import Final

from utank_hil.retuning.answer import LONGEST_BYTES, Answer, Refusal, answer_bytes, read_answer
from utank_hil.retuning.mailbox import Mailbox
from utank_hil.retuning.retuner import Request, Work
from utank_hil.retuning.wire import OVERHEAD_BYTES, decoder, encode

_ALIVE_NS: Final = 5_000_000_000  # The worker has low priority and may wait long on a busy machine.


class Desk:
    """Both ends of the requests for one kind of work; may be an argument of a spawned process."""

    def __init__(self, work: Work) -> None:
        self._compute, self._request, most_numbers = work
        self._requests = Mailbox(OVERHEAD_BYTES + 8 * most_numbers)
        self._answers = Mailbox(LONGEST_BYTES)

    @property
    def alive(self) -> bool:
        """Whether the worker's heartbeat is recent."""
        return abs(time.monotonic_ns() - self._answers.beat_ns) < _ALIVE_NS

    @property
    def beat_ns(self) -> int:
        """Time of the worker's latest heartbeat."""
        return self._answers.beat_ns

    def submit(self, number: int, request: Request, now_ns: int) -> None:  # noqa: ARG002
        """Post a request."""
        self._requests.post(number, encode(request))

    def answer(self, number: int, now_ns: int) -> Answer | None:  # noqa: ARG002
        """Return the answer, if any; a message that cannot be decoded counts as a refusal."""
        data = self._answers.read(number)
        if data is None:
            return None
        try:
            return read_answer(data)
        except ValueError as error:
            return Refusal((f"the retuner answered nonsense: {error}",))

    def beat(self, now_ns: int) -> None:
        """Store the worker's heartbeat."""
        self._answers.beat(now_ns)

    def serve(self) -> bool:
        """Answer the open request in the worker and return whether there was one.

        An exception becomes a refusal, with its traceback on standard error.
        """
        number = self._requests.number
        data = self._requests.read(number) if number != self._answers.number else None
        if data is None:
            return False
        try:
            request = decoder(self._request, finite=False).decode(data)
            self._answers.post(number, answer_bytes(self._compute(request)))
        except Exception as error:
            traceback.print_exc(file=sys.stderr)
            refusal = Refusal((f"the retuner failed: {type(error).__name__}: {error}",))
            self._answers.post(number, answer_bytes(refusal))
        return True

    def refuse_open(self, reason: str) -> None:
        """Refuse the open request, if any, on behalf of the worker."""
        number = self._requests.number
        if number != self._answers.number:
            self._answers.post(number, answer_bytes(Refusal((reason,))))
