"""The base tick: the period of the controller's loop, and the unit of every other period."""

from typing import Final

TICK_NS: Final = 10_000_000
TICK_S: Final = TICK_NS / 1e9
