"""What was heard on a live bus, by the kernel's time of each frame, and what follows from it.

Who listens may be held up by the machine; the times of the frames are not. The streams of the
others show whether one of them was held up: what came too late meanwhile can't be judged.
"""

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final, Literal

from utank_hil.canbus import DriveState, Mode

Stream = Literal["commands", "motions"]
"""Of the controller, and of the ship's side."""
CYCLES_S: Final[dict[Stream, float]] = {"commands": 0.02, "motions": 0.01}
HELD_UP_S: Final = 0.03
"""As long as a node may be late before what is judged by it can't be."""
SIGNALLED_S: Final = 0.005
"""After a signal was sent, what the process had sent may still be on its way."""


@dataclass(slots=True)
class LiveLog:
    """Times of frames, and what they said; in s of the system's clock."""

    commands: list[float] = field(default_factory=list)
    motions: list[float] = field(default_factory=list)
    modes: list[tuple[float, Mode | None]] = field(default_factory=list)
    states: list[tuple[float, DriveState | None]] = field(default_factory=list)

    @property
    def held_up_s(self) -> float:
        """For which the machine held up one of the two, at a time."""
        return max(
            _longest_gap_s(self.stream(name), -math.inf, math.inf) - cycle_s
            for name, cycle_s in CYCLES_S.items()
        )

    def stream(self, name: Stream) -> list[float]:
        """Times of one of the streams."""
        return self.commands if name == "commands" else self.motions


@dataclass(frozen=True, slots=True)
class LiveTimes:
    """What came of a fault.

    Attributes
    ----------
    found_ms, zero_ms : float or None
        From the fault to the controller's FAULT, and to a drive that is not enabled any more.
    held_up_ms : float
        For which the machine held up, at a time, who had to find it or to act.
    """

    found_ms: float | None
    zero_ms: float | None
    held_up_ms: float


def times_of(
    log: LiveLog,
    fault_s: float,
    end_s: float,
    *,
    silences: Stream | None,
    judged: Literal["found", "zero"],
) -> LiveTimes:
    """Times from a fault on.

    Parameters
    ----------
    fault_s, end_s : float
        When it was made, and to when the bus was listened to.
    silences : Stream, optional
        That it ends: times count from the last frame of it.
    judged : str
        Which of the times matters.
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
    """Between frames of a stream that touch a span of time."""
    return max((b - a for a, b in pairwise(times_s) if b > begin_s and a < end_s), default=0.0)
