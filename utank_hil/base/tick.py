"""The base tick: the period of the controller's loop, and the unit of every other period."""

from typing import Final

TICK_NS: Final = 10_000_000
TICK_S: Final = TICK_NS / 1e9


def is_whole_ticks(time_s: float) -> bool:
    """Whether a time is a whole number of ticks, one or more."""
    ticks = time_s / TICK_S
    return round(ticks) >= 1 and abs(ticks - round(ticks)) <= 1e-6
