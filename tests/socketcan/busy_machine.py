"""A machine too busy for what is judged on it: found out, said, tried again.

The emulated kernel has one processor and shares it with all that the machine does besides. What
fails there while the machine held processes up says nothing about them.
"""

import time
from contextlib import contextmanager
from typing import TypeVar

import pytest

T = TypeVar("T")
ATTEMPTS = 3
NAP_S = 0.02
PUNCTUAL_S = 0.005  # by which a process may be woken late
HELD_UP_S = 0.03  # what the drive's shortest command timeout leaves
LOST_SHARE = 0.002  # of the time; each sample that is missing spoils 30 predictions
RETRIED: list[str] = []  # for the end of the run


class TooBusyError(Exception):
    """The machine did not keep time, so what was seen can't be judged."""


def lost(share, longest_s):
    """What the machine did that it must not; empty if it kept time.

    `share` is that of the time for which it held processes up, `longest_s` how long at a time.
    """
    if share <= LOST_SHARE and longest_s <= HELD_UP_S:
        return ""
    return (
        f"processes were held up for {share:.1%} of the time ({LOST_SHARE:.1%} allowed) "
        f"and for {1e3 * longest_s:.0f} ms at a time ({1e3 * HELD_UP_S:.0f} ms allowed)"
    )


class Timekeeping:
    """How late the machine wakes a process that sleeps and does nothing else."""

    def __init__(self):
        self.begin_anew()

    def begin_anew(self):
        """Forget what was: programs that start take the processor from one another."""
        self._slept_s = self._lost_s = self._longest_s = 0.0

    def nap(self):
        """Sleep for a moment, and note how much later it ends."""
        begin_s = time.monotonic()
        time.sleep(NAP_S)
        slept_s = time.monotonic() - begin_s
        self._slept_s += slept_s
        late_s = slept_s - NAP_S - PUNCTUAL_S
        if late_s > 0:
            self._lost_s += late_s
            self._longest_s = max(self._longest_s, late_s)

    def failure(self):
        """What the machine did that it must not since the beginning; empty if it kept time."""
        return lost(self._lost_s / max(self._slept_s, NAP_S), self._longest_s)


@contextmanager
def judged_by(failure):
    """Let what is asserted inside fail only where the machine kept time.

    `failure` says what the machine did that it must not, empty if it kept time; if it did not,
    `TooBusyError` is raised in place of AssertionError.
    """
    try:
        yield
    except AssertionError as error:
        late = failure()
        if not late:
            raise
        raise TooBusyError(f"{late}; then: {str(error).partition(chr(10))[0]}") from error


def first_that_can_be_judged(attempt, folder):
    """What the first attempt gives that the machine was not too busy for.

    `attempt` does what is judged, in a folder of its own inside `folder`; it raises `TooBusyError`.
    """
    for number in range(ATTEMPTS):
        own = folder / str(number)
        own.mkdir()
        try:
            return attempt(own)
        except TooBusyError as error:
            reason = str(error)
            RETRIED.append(f"attempt {number + 1} of {ATTEMPTS}: {reason}")
    pytest.fail(f"machine too busy to judge, {ATTEMPTS} times; at last: {reason}", pytrace=False)
