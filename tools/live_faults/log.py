"""Log of a live bus by the kernel's time of each frame, and the times that follow from it.

The machine may delay the listener, but not the times of the frames. The streams of ship and
controller show whether one of them was delayed, so that late reactions cannot be judged.
"""

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final, Literal

from utank_hil.canbus import DriveState, Mode

Stream = Literal["commands", "motions"]
"""Stream of the controller's commands, or of the ship's motions."""
CYCLES_S: Final[dict[Stream, float]] = {"commands": 0.02, "motions": 0.01}
HELD_UP_S: Final = 0.03
"""Delay of a node in s above which reactions that depend on it cannot be judged. Chosen; no
study."""
SIGNALLED_S: Final = 0.005
"""Time in s after a signal in which frames sent before it may still arrive. Chosen; no study."""


@dataclass(slots=True)
class LiveLog:
    """Times of frames in s of the system's clock, and their content."""

    commands: list[float] = field(default_factory=list)
    motions: list[float] = field(default_factory=list)
    modes: list[tuple[float, Mode | None]] = field(default_factory=list)
    states: list[tuple[float, DriveState | None]] = field(default_factory=list)

    @property
    def held_up_s(self) -> float:
        """Longest gap in s of either stream beyond its cycle."""
        return max(
            _longest_gap_s(self.stream(name), -math.inf, math.inf) - cycle_s
            for name, cycle_s in CYCLES_S.items()
        )

    def stream(self, name: Stream) -> list[float]:
        """Times of one of the streams."""
        return self.commands if name == "commands" else self.motions


@dataclass(frozen=True, slots=True)
class LiveTimes:
    """Reaction times of a fault."""

    #: found_ms, zero_ms: times from the fault to the controller's FAULT, and to the drive's being
    #: disabled.
    found_ms: float | None
    zero_ms: float | None
    #: Longest delay by the machine of the side that had to detect the fault or to act.
    held_up_ms: float


def times_of(
    log: LiveLog,
    fault_s: float,
    end_s: float,
    *,
    silences: Stream | None,
    judged: Literal["found", "zero"],
) -> LiveTimes:
    """Return the times from a fault on.

    They count from `fault_s`, or from the last frame of the stream `silences` that the fault ends.
    Listening ended at `end_s`.
    """
    begin_s = fault_s
    if silences is not None:
        begin_s = max(each for each in log.stream(silences) if each <= fault_s + SIGNALLED_S)
    found_s = next((t for t, mode in log.modes if t > fault_s and mode is Mode.FAULT), None)
    zero_s = next(
        (t for t, state in log.states
         if t > fault_s and state is not DriveState.OPERATION_ENABLED), None,
    )  # fmt: skip
    judged_s = found_s if judged == "found" else zero_s
    until_s = end_s if judged_s is None else judged_s
    held_up_s = max(
        _longest_gap_s(log.stream(name), begin_s, until_s) - cycle_s
        for name, cycle_s in CYCLES_S.items()
        if name != silences
    )

    def after(time_s: float | None) -> float | None:
        return None if time_s is None else round(1e3 * (time_s - begin_s), 1)

    return LiveTimes(after(found_s), after(zero_s), round(1e3 * held_up_s, 1))


def _longest_gap_s(times_s: list[float], begin_s: float, end_s: float) -> float:
    """Longest gap in s between frames of a stream that overlaps a span of time."""
    return max((b - a for a, b in pairwise(times_s) if b > begin_s and a < end_s), default=0.0)
