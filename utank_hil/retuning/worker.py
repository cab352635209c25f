"""The two processes of the retuner: the one that works off orders, and the one that keeps it alive.

What was ordered and what is answered stands in the mailboxes alone: an order is open while its
number is not the answer's. So a new worker knows what there is to do, and an order that its worker
did not survive is answered by the keeper and not tried again.
"""

import os
import signal
import sys
import time
import traceback
from typing import Final

import numpy as np

from utank_hil.retuning.answer import Refusal, answer_bytes
from utank_hil.retuning.mailbox import Mailbox
from utank_hil.retuning.retuner import Work

_LOOK_S: Final = 0.1
_PAUSE_S: Final = 1.0  # before a worker that has ended is replaced
_NICENESS: Final = 10
_SECOND_NS: Final = 1_000_000_000


def keep(
    work: Work, orders: Mailbox, answers: Mailbox, parent_pid: int, hangs_after_s: float
) -> None:
    """Keep a worker alive until the parent is gone; the whole life of the keeper."""
    os.setpgid(0, 0)  # Ctrl-C is for the loop, which ends this group
    os.nice(_NICENESS)
    keeper_pid = os.getpid()
    while os.getppid() == parent_pid:
        worker_pid = os.fork()  # this process has one thread and holds nothing but the mailboxes
        if worker_pid == 0:
            try:
                serve(work, orders, answers, keeper_pid)
            except BaseException:
                traceback.print_exc(file=sys.stderr)
            finally:
                os._exit(1)
        end = _watch(worker_pid, answers, parent_pid, hangs_after_s)
        number = orders.number
        if end is not None and number != answers.number:
            answers.post(number, answer_bytes(Refusal((f"the retuner {end}, and was restarted",))))
        time.sleep(_PAUSE_S)


def _watch(worker_pid: int, answers: Mailbox, parent_pid: int, hangs_after_s: float) -> str | None:
    """How a worker ended, in words; None if it was ended because the parent is gone."""
    begun_ns = time.monotonic_ns()
    while os.getppid() == parent_pid:
        pid, status = os.waitpid(worker_pid, os.WNOHANG)
        if pid:
            code = os.waitstatus_to_exitcode(status)
            return f"ended with code {code}" if code >= 0 else f"was killed by signal {-code}"
        silent_ns = time.monotonic_ns() - max(begun_ns, answers.beat_ns)
        if silent_ns > hangs_after_s * _SECOND_NS:
            _kill(worker_pid)
            return f"was busy for more than {hangs_after_s:g} s"
        time.sleep(_LOOK_S)
    _kill(worker_pid)
    return None


def _kill(pid: int) -> None:
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)


def serve(work: Work, orders: Mailbox, answers: Mailbox, keeper_pid: int) -> None:
    """Work off orders until the keeper is gone; the whole life of a worker."""
    while os.getppid() == keeper_pid:
        answers.beat(time.monotonic_ns())
        number = orders.number
        data = orders.read(number) if number != answers.number else None
        if data is None:
            time.sleep(_LOOK_S)
        else:
            _work_off(work, number, data, answers)


def _work_off(work: Work, number: int, data: bytes, answers: Mailbox) -> None:
    """Answer an order; work that fails is a refusal, and tells where in the error output."""
    try:
        values = np.frombuffer(data)
        answers.post(number, answer_bytes(work(values[1:].reshape(-1, int(values[0])))))
    except Exception as error:
        traceback.print_exc(file=sys.stderr)
        refusal = Refusal((f"the retuner failed: {type(error).__name__}: {error}",))
        answers.post(number, answer_bytes(refusal))
