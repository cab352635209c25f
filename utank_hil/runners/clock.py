"""The clock that the real-time loop is handed: the system's, or a test's."""

import time
from typing import Protocol


class Clock(Protocol):
    """A clock that never goes back, and a way to wait for it."""

    def now_ns(self) -> int:
        """Return the time in nanoseconds since an arbitrary instant."""

    def sleep_until(self, time_ns: int) -> None:
        """Return at `time_ns` or later, never earlier; at once if it has passed."""


class MonotonicClock:
    """CLOCK_MONOTONIC: not touched by changes of the wall clock."""

    def now_ns(self) -> int:
        """Return `time.monotonic_ns()`."""
        return time.monotonic_ns()

    def sleep_until(self, time_ns: int) -> None:
        """Sleep until an absolute time; `time.sleep` is clock_nanosleep on the monotonic clock."""
        while (left_ns := time_ns - time.monotonic_ns()) > 0:
            time.sleep(left_ns * 1e-9)
