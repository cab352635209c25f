"""Who sends: paces of messages, silent nodes, frames of nobody, and the load of the bus.

CAN finds what disturbs the cable and sends it again. So a frame whose own CRC or data ID is wrong
comes from a node that is broken, or is none of the sender's.

A message's counter and its cycle tell the same time. Frames that were heard, good or bad, and
frames that its counter says were lost add up to one a cycle. With a second sender of the same
identifier it is twice as many, with a counter that skips more. What is above 1.25 a cycle is
summed; eight frames are too many. A panel sends one more frame on each change of its levers. Up to
twenty a second of these are not counted. Of two senders with one identifier, frames are rejected:
so many of the changes are counted all the same.

CAN loses no frame: what disturbs it, it sends again. A gateway, or a slow receiver, may. Single
frames do no harm, but two pump commands in succession let the drive's timeout of 50 ms go: once in
five hours at random losses of 0.1 %, in three minutes at 1 %. Four motion frames, at which their
age may end the run, are lost once in eleven days at 1 %. What is lost above 0.1 % of a message's
frames is summed; with five too many people are to know. So they are of a node that sends fewer than
0.75 a cycle for two seconds, with a counter that misses none.
"""

import math
from collections import deque
from collections.abc import Sequence
from typing import Final, Protocol

from utank_hil.base.tick import TICK_NS, Schedule
from utank_hil.canbus.endpoints import Rejection
from utank_hil.safety.monitors.finding import Finding

MOST_PER_CYCLE: Final = 1.25
MOST_FRAMES: Final = 8.0
MOST_CHANGES_PER_S: Final = 20.0
"""A panel looks at its levers every 50 ms."""
LEAST_PER_CYCLE: Final = 0.75
SLOW_S: Final = 2.0
BURST_CYCLES: Final = 8.0
"""A message with as many cycles between two looks has so few in one look by a gap alone."""
LOST_SHARE: Final = 0.001
MOST_LOST: Final = 5.0
FOREIGN_SHARE: Final = 0.1
"""Of the bus: so much of it may be used by frames that are not in the catalogue."""
FOREIGN_FRAMES: Final = 40.0  #: Excess of such frames that is reported. Chosen; no study.
DAMAGED_FRAMES: Final = 3
"""With a wrong CRC or data ID within `DAMAGED_S`."""
DAMAGED_S: Final = 1.0

_CRC: Final = Rejection.CRC
_PROOF: Final = Rejection.PROOF


class Heard(Protocol):
    """What a receiver counts: frames accepted or not, missing by the counter, and rejected."""

    can_id: int
    cycle_ns: int
    may_speak: bool
    rejected: dict[Rejection, int]

    @property
    def heard(self) -> int:
        """Frames so far, accepted or not."""

    @property
    def lost(self) -> int:
        """Frames missing by the counter."""

    @property
    def changes(self) -> int:
        """Frames with a new content, of a message that is also sent on a change; else 0."""


class Stream:
    """Pace of one cyclic message.

    A silence of `silent_s` is found; it is infinite where others judge it. Who may not speak is not
    silent.
    """

    def __init__(self, receiver: Heard, silent_s: float = float("inf")) -> None:
        self.receiver: Final = receiver
        self.found = 0  #: What was found in the last update.
        self._cycles_per_s = 1e9 / receiver.cycle_ns
        self._silent_limit_s = silent_s
        self.begin()
        self.damaged = 0  #: Frames with a wrong CRC or data ID in the last update.
        self.excess = self._missing = 0.0
        self._silent_s = self._slow_s = self._gap = 0.0
        self._heard_before = False

    def begin(self) -> None:
        """Judge nothing of what was received until now."""
        receiver = self.receiver
        self._heard, self._lost = receiver.heard, receiver.lost
        self._damaged = receiver.rejected[_CRC]
        self._proofs = receiver.rejected[_PROOF]
        self._changes = receiver.changes
        self._rejected = sum(receiver.rejected.values())

    def update(self, elapsed_s: float) -> int:
        """Judge what came since the last call; return what was found."""
        receiver = self.receiver
        heard = receiver.heard - self._heard
        lost = receiver.lost - self._lost
        came = heard + lost
        self._heard += heard
        self._lost += lost
        damaged = receiver.rejected[_CRC]
        self.damaged = damaged - self._damaged
        self._damaged = damaged
        cycles = self._cycles_per_s * elapsed_s
        excess = self.excess + came - MOST_PER_CYCLE * cycles
        if receiver.changes:
            excess -= self._on_change(elapsed_s)
        # twice what is too many: it is forgotten soon after
        self.excess = excess = min(max(excess, 0.0), 2 * MOST_FRAMES)
        waits = heard or not receiver.may_speak
        self._silent_s = 0.0 if waits else self._silent_s + elapsed_s
        missing = self._missing + lost - LOST_SHARE * came
        if heard:  # a silence is judged elsewhere, its first and last look too
            slow = came < LEAST_PER_CYCLE * cycles
            self._slow_s = self._slow_s + elapsed_s if slow else 0.0
            missing += self._gap
            burst = slow and self._heard_before and cycles >= BURST_CYCLES
            self._gap = cycles - came if burst else 0.0  # longer than the counter bridges
        else:
            self._gap = 0.0
        self._heard_before = heard > 0
        self._missing = missing = min(max(missing, 0.0), MOST_LOST + 1.0)
        found = Finding.SECOND_SENDER if excess > MOST_FRAMES else 0
        if missing > MOST_LOST or self._slow_s > SLOW_S:
            found |= Finding.FRAMES_LOST
        if receiver.rejected[_PROOF] != self._proofs:
            self._proofs = receiver.rejected[_PROOF]
            found |= Finding.WRONG_PROOF
        if self._silent_s > self._silent_limit_s:
            found |= Finding.NODE_SILENT
        self.found = found
        return found

    def _on_change(self, elapsed_s: float) -> float:
        """Frames since the last call that may come on top of the cycle's."""
        receiver = self.receiver
        rejected = sum(receiver.rejected.values())
        extra = (receiver.changes - self._changes) - (rejected - self._rejected)
        self._changes, self._rejected = receiver.changes, rejected
        return min(max(extra, 0), MOST_CHANGES_PER_S * elapsed_s)


class Senders:
    """All messages heard, half of them a call, and other frames; `frames_per_s` fill the bus."""

    def __init__(self, streams: Sequence[Stream], frames_per_s: float) -> None:
        self._due, self._later = tuple(streams[::2]), tuple(streams[1::2])
        self._found_before = 0
        self._elapsed_before_s = 0.0
        self._foreign_per_s = FOREIGN_SHARE * frames_per_s
        self._foreign = 0
        self._excess = 0.0
        self._now_s = 0.0  # pragma: no mutate: differences of it count
        self._damaged_s = [-math.inf] * DAMAGED_FRAMES

    def of(self, finding: int) -> list[Heard]:
        """The messages of which this was found last."""
        streams = (*self._due, *self._later)
        return [each.receiver for each in streams if each.found & finding]

    def begin(self, foreign: int) -> None:
        """Judge nothing of what was received until now, nor of the foreign frames so far."""
        self._foreign = foreign
        for stream in (*self._due, *self._later):
            stream.begin()

    def update(self, foreign: int, elapsed_s: float) -> int:
        """Take the foreign frames so far; return what was found."""
        found = 0
        both_s = elapsed_s + self._elapsed_before_s
        self._now_s += elapsed_s
        for stream in self._due:
            found |= stream.update(both_s)
            if stream.damaged:
                times_s = self._damaged_s + [self._now_s] * min(stream.damaged, DAMAGED_FRAMES)
                self._damaged_s = times_s[-DAMAGED_FRAMES:]
        self._due, self._later = self._later, self._due
        self._elapsed_before_s = elapsed_s
        before, self._found_before = self._found_before, found
        if self._now_s - self._damaged_s[0] <= DAMAGED_S:
            found |= Finding.DAMAGED
        excess = self._excess + foreign - self._foreign - self._foreign_per_s * elapsed_s
        self._foreign = foreign
        self._excess = excess = min(max(excess, 0.0), 2 * FOREIGN_FRAMES)
        return found | before | Finding.FLOOD if excess > FOREIGN_FRAMES else found | before


LOAD_LOOK_NS: Final = 10 * TICK_NS
LOAD_LOOKS: Final = 10
"""The load is that of a second, known anew every tenth: a flood may begin between two seconds."""
MEAN_FRAME_BITS: Final = 143
"""An eight-byte frame with a 29-bit identifier has 131 bits with its pause; stuffing adds 10 to the
frames of this bus in the mean and 29 at most."""


class BusLoad:
    """The load over the last second."""

    def __init__(self, bit_rate: int) -> None:
        self._bit_rate = bit_rate
        self._schedule = Schedule(LOAD_LOOK_NS)
        # at the first tick only a backlog was received
        self._counted: deque[tuple[int, int]] = deque(maxlen=LOAD_LOOKS + 1)
        self.share = 0.0  #: Share of the bus in use; zero in the first second.

    def update(self, now_ns: int, frames: int) -> float:
        """Take the frames heard and sent so far, once a tick; return `share`."""
        if self._schedule.due(now_ns):
            counted = self._counted
            counted.append((now_ns, frames))
            if len(counted) > LOAD_LOOKS:
                since_ns, before = counted[0]
                bits = (frames - before) * MEAN_FRAME_BITS
                self.share = bits / (self._bit_rate * (now_ns - since_ns) * 1e-9)
        return self.share
