"""The base tick, the period of the controller's loop, and a schedule of what is done less often."""

from typing import Final


class Schedule:
    """Points of time a period apart, from the first look on.

    Told by the time and not by counting ticks: where the machine left ticks out, what was due is
    done late once and the next is due at its own point again.
    """

    __slots__ = ("_due_ns", "_period_ns")

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._due_ns: int | None = None

    def due(self, now_ns: int) -> bool:
        """Say whether a point has passed since the last that was, and look to the next if so."""
        due_ns = self._due_ns
        if due_ns is None:
            due_ns = now_ns
        elif now_ns < due_ns:
            return False
        self._due_ns = now_ns + self._period_ns - (now_ns - due_ns) % self._period_ns
        return True


TICK_NS: Final = 10_000_000
TICK_S: Final = TICK_NS / 1e9


def is_whole_ticks(time_s: float) -> bool:
    """Whether a time is a whole number of ticks, one or more."""
    ticks = time_s / TICK_S
    return round(ticks) >= 1 and abs(ticks - round(ticks)) <= 1e-6


LONG_AGO_NS: Final = -(1 << 61)
NEVER_NS: Final = (1 << 62) - 1
"""Times before and after every other. Compiled, they and their distance from a time are numbers
without an object; from the year 2043 on that distance is one, and slower."""
