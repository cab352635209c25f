"""The retuner: answers the controller's requests in processes of its own, or in simulated time.

Records go out and answers come back through mailboxes. The controller's loop writes one mailbox and
polls one number of the other. There is no other connection, so the loop never waits. If the retuner
hangs, dies or writes garbage, the number never arrives or the message is refused, and the
controller keeps its law. There are two processes:

    watchdog   started before the loop; forks the worker again whenever it has died or hangs
    worker     stores heartbeats while idle, and answers the requests of every desk

A request is made only while the worker's heartbeat is recent. The mailboxes hold the only state: a
request is open while its number differs from the answer's.
"""

import multiprocessing
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from ctypes import c_char
from typing import Any, Final, NamedTuple, Protocol
from zlib import crc32

from utank_hil.base.arrays import FloatArray
from utank_hil.base.background import give_way, one_thread_each
from utank_hil.base.closing import Closing
from utank_hil.retuning.answer import (
    LONGEST_BYTES,
    OVERHEAD_BYTES,
    Answer,
    Refusal,
    answer_bytes,
    decoder,
    encode,
    read_answer,
)
from utank_hil.retuning.estimate import EstimateRequest, MotionEstimate

LATENCY_S: Final = 5.0
"""Time that identification and design take in simulated time. Chosen; no study."""
_HEADER_WORDS: Final = 4  # The words are number, length, checksum and heartbeat.
_ALIVE_NS: Final = 5_000_000_000  # The worker has low priority and may wait long on a busy machine.
_POLL_S: Final = 0.1  # An answer takes seconds.
_RESTART_DELAY_S: Final = 1.0  # A worker that dies at once does not occupy the processor.
_NICENESS: Final = 10  # This is a tenth of the processor beside a busy process of normal priority.
_SECOND_NS: Final = 1_000_000_000
_START_S: Final = 30.0  # scipy has to be imported, on a busy machine
_HANGS_S: Final = 600.0  # This is the longest `answer_within_s`; later answers are not used.
_END_S: Final = 2.0  # This is the wait for a killed process.

Request = FloatArray | EstimateRequest | MotionEstimate
"""A record, shape (N, 1 + m), rows (command, outputs...); or the input of estimate or renewal."""

RetuneFunction = Callable[[Any], Answer]  #: Function from a request to an answer.


class Work(NamedTuple):
    """Work of the retuner: function, type of requests, `most_numbers` in arrays of the longest."""

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


class Mailbox:
    """Both ends of the mailbox; may be an argument of a spawned process.

    Layout, in 8-byte words: number of the message, its length in bytes, its CRC-32, the writer's
    heartbeat; then the payload. The writer stores the number last. A reader polls for the expected
    number and accepts the payload if its CRC-32, started from the number, is right. A message that
    is half written or damaged is therefore not read.

    The capacity is in bytes; a ValueError is raised if it is below one.
    """

    def __init__(self, capacity: int) -> None:
        if capacity < 1:
            raise ValueError(f"a mailbox needs a capacity of a byte or more, got {capacity}")
        size = 8 * _HEADER_WORDS + capacity + -capacity % 8
        # An anonymous mapping is freed with the last process that holds it, even a killed one.
        self._memory = multiprocessing.get_context("spawn").RawArray(c_char, size)
        self.__setstate__(self._memory)

    def __getstate__(self) -> object:
        return self._memory

    def __setstate__(self, memory: object) -> None:
        self._memory = memory  # type: ignore[assignment]  # a ctypes array has no usable type
        whole = memoryview(memory).cast("B")  # type: ignore[arg-type]  # it has a buffer
        self._words = whole[: 8 * _HEADER_WORDS].cast("q")
        self._bytes = whole[8 * _HEADER_WORDS :]

    @property
    def number(self) -> int:
        """Number of the present message, 0 before the first."""
        return self._words[0]

    @property
    def beat_ns(self) -> int:
        """Time of the writer's latest heartbeat in ns; 0 before the first."""
        return self._words[3]

    def beat(self, now_ns: int) -> None:
        """Store a heartbeat; both ends must read the same clock."""
        self._words[3] = now_ns

    def post(self, number: int, data: bytes) -> None:
        """Replace the message by one of a new number, not 0; ValueError if it is too long."""
        if len(data) > len(self._bytes):
            raise ValueError(f"{len(data)} bytes are too long for a mailbox of {len(self._bytes)}")
        self._bytes[: len(data)] = data
        self._words[1] = len(data)
        self._words[2] = crc32(data, number & 0xFFFFFFFF)
        self._words[0] = number

    def read(self, number: int) -> bytes | None:
        """Return the message of this number; None if it is absent, incomplete or damaged."""
        words = self._words
        if words[0] != number or not 0 <= words[1] <= len(self._bytes):
            return None
        data = bytes(self._bytes[: words[1]])
        return data if crc32(data, number & 0xFFFFFFFF) == words[2] else None


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
        """Answer an open request, if there is one; an exception is a refusal, told on stderr."""
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


def run_watchdog(desks: Sequence[Desk], parent_pid: int, hangs_after_s: float) -> None:
    """Run a worker until the parent is gone, as main function of the watchdog.

    A new worker finds an open request by itself (`Desk`). Requests that were open when a worker was
    killed are refused, not tried again.
    """
    os.setpgid(0, 0)  # Ctrl-C does not reach it; the loop ends this group.
    give_way(_NICENESS)
    watchdog_pid = os.getpid()
    while os.getppid() == parent_pid:
        worker_pid = os.fork()  # This is safe with one thread and no resources but the mailboxes.
        if worker_pid == 0:
            try:
                run_worker(desks, watchdog_pid)
            except BaseException:
                traceback.print_exc(file=sys.stderr)
            finally:
                os._exit(1)
        end = _watch(worker_pid, desks[0], parent_pid, hangs_after_s)
        if end is not None:
            for desk in desks:
                desk.refuse_open(f"the retuner {end}, and was restarted")
        time.sleep(_RESTART_DELAY_S)


def _watch(worker_pid: int, desk: Desk, parent_pid: int, hangs_after_s: float) -> str | None:
    """Return how a worker ended, in words; None if it was ended because the parent is gone."""
    begun_ns = time.monotonic_ns()
    while os.getppid() == parent_pid:
        pid, status = os.waitpid(worker_pid, os.WNOHANG)
        if pid:
            code = os.waitstatus_to_exitcode(status)
            return f"ended with code {code}" if code >= 0 else f"was killed by signal {-code}"
        silent_ns = time.monotonic_ns() - max(begun_ns, desk.beat_ns)
        if silent_ns > hangs_after_s * _SECOND_NS:
            _kill(worker_pid)
            return f"was busy for more than {hangs_after_s:g} s"
        time.sleep(_POLL_S)
    _kill(worker_pid)
    return None


def _kill(pid: int) -> None:
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)


def run_worker(desks: Sequence[Desk], watchdog_pid: int) -> None:
    """Answer requests until the watchdog is gone, as main function of a worker."""
    while os.getppid() == watchdog_pid:
        idle = True
        for desk in desks:
            now_ns = time.monotonic_ns()
            for each in desks:
                each.beat(now_ns)
            if desk.serve():
                idle = False
        if idle:
            time.sleep(_POLL_S)


class RetunerProcess(Closing):
    """One desk for each kind of work, served by a separate process; start it before the loop.

    The constructor returns when the process is ready, or after half a minute; then no desk is alive
    and nothing is requested. `works` can be imported in another process (functions, or
    `functools.partial` of them). A worker that is busy for `hangs_after_s` is killed and replaced.
    """

    def __init__(self, *works: Work, hangs_after_s: float = _HANGS_S) -> None:
        self.desks = tuple(Desk(work) for work in works)  #: Desks in the order of `works`.
        self._process = multiprocessing.get_context("spawn").Process(
            target=run_watchdog, args=(self.desks, os.getpid(), hangs_after_s), daemon=True
        )
        with one_thread_each():
            self._process.start()
        assert self._process.pid is not None
        #: Process id of the watchdog, and id of the process group of both.
        self.pid: int = self._process.pid
        self._closed = False
        deadline_s = time.monotonic() + _START_S
        while not self.alive and self._process.is_alive() and time.monotonic() < deadline_s:
            time.sleep(0.01)

    @property
    def alive(self) -> bool:
        """Whether the worker's heartbeat is recent."""
        return self.desks[0].alive

    def close(self) -> None:
        """End both processes; idempotent."""
        if self._closed:
            return
        self._closed = True
        with suppress(ProcessLookupError):  # There may be no group yet, or no process left.
            os.killpg(self.pid, signal.SIGKILL)
        self._process.kill()
        self._process.join(_END_S)
