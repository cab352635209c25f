"""The retuner's two processes: a worker that answers requests, and a watchdog that restarts it.

The mailboxes hold the only state: a request is open while its number differs from the answer's. So
a new worker finds an open request by itself. A request that killed its worker is refused by the
watchdog and not tried again.
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
from utank_hil.retuning.retuner import RetuneFunction

_POLL_S: Final = 0.1
_RESTART_DELAY_S: Final = 1.0  # after a worker has ended
_NICENESS: Final = 10
_SECOND_NS: Final = 1_000_000_000


def run_watchdog(
    retune: RetuneFunction,
    requests: Mailbox,
    answers: Mailbox,
    parent_pid: int,
    hangs_after_s: float,
) -> None:
    """Main function of the watchdog: run a worker until the parent is gone."""
    os.setpgid(0, 0)  # out of reach of Ctrl-C: the loop ends this group
    os.nice(_NICENESS)
    watchdog_pid = os.getpid()
    while os.getppid() == parent_pid:
        worker_pid = os.fork()  # safe: one thread, and no resources but the mailboxes
        if worker_pid == 0:
            try:
                run_worker(retune, requests, answers, watchdog_pid)
            except BaseException:
                traceback.print_exc(file=sys.stderr)
            finally:
                os._exit(1)
        end = _watch(worker_pid, answers, parent_pid, hangs_after_s)
        number = requests.number
        if end is not None and number != answers.number:
            answers.post(number, answer_bytes(Refusal((f"the retuner {end}, and was restarted",))))
        time.sleep(_RESTART_DELAY_S)


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
        time.sleep(_POLL_S)
    _kill(worker_pid)
    return None


def _kill(pid: int) -> None:
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)


def run_worker(
    retune: RetuneFunction, requests: Mailbox, answers: Mailbox, watchdog_pid: int
) -> None:
    """Main function of a worker: answer requests until the watchdog is gone."""
    while os.getppid() == watchdog_pid:
        answers.beat(time.monotonic_ns())
        number = requests.number
        data = requests.read(number) if number != answers.number else None
        if data is None:
            time.sleep(_POLL_S)
        else:
            _answer_request(retune, number, data, answers)


def _answer_request(retune: RetuneFunction, number: int, data: bytes, answers: Mailbox) -> None:
    """Answer a request; an exception becomes a refusal, with its traceback on standard error."""
    try:
        values = np.frombuffer(data)
        answers.post(number, answer_bytes(retune(values[1:].reshape(-1, int(values[0])))))
    except Exception as error:
        traceback.print_exc(file=sys.stderr)
        refusal = Refusal((f"the retuner failed: {type(error).__name__}: {error}",))
        answers.post(number, answer_bytes(refusal))
