"""A device of another maker: from its frames to a measurement of the catalogue's own type."""

import math
from collections import deque
from collections.abc import Callable
from typing import Any, Final, Generic

from utank_hil.base.tick import LONG_AGO_NS, TICK_NS
from utank_hil.canbus.endpoints import Acceptance, Rejection
from utank_hil.canbus.enumerations import Quality, Switch
from utank_hil.canbus.frame import Frame
from utank_hil.canbus.messages import SensorTank
from utank_hil.canbus.profiles.device_plan import FIELDS, SLOPE_S, Crc8, DevicePlan, MessagePlan, T
from utank_hil.canbus.profiles.field import ConditionPlan, Field, SignalPlan


class HeardMessage(Acceptance):
    """Length, checksum and counter of one message, and how its frames pass them."""

    def __init__(self, plan: MessagePlan) -> None:
        counts = 0 if plan.counter is None else 1 << plan.counter.bits
        super().__init__(plan.can_ids[0], plan.cycle_ns, counts)
        self.length: int = plan.length
        self._counter: Field | None = plan.counter
        self._crc: Crc8 | None = plan.crc

    def intact(self, data: bytes) -> bool:
        """Whether a frame is whole; nothing changes."""
        if len(data) != self.length:
            return False
        return self._crc is None or self._crc.of(data) == data[self._crc.byte]

    def counts_on(self, data: bytes) -> None:
        """Let the counter run on by a frame of another content, which it counts, too.

        What is missing before that frame is missed by its own message.
        """
        if self._counter is not None and self.intact(data):
            self._steps(self._counter.raw(data) % self._counts)

    def passes(self, data: bytes) -> bool:
        """Judge the next frame."""
        self.heard += 1
        if len(data) != self.length:
            return self._reject(Rejection.LENGTH)
        if self._crc is not None and not self.intact(data):
            return self._reject(Rejection.CRC)
        if self._counter is None:
            return self._drain() if self._bucket or not self.valid else True
        return self._follows(self._counter.raw(data) % self._counts)  # it may have a sign


SILENT_NS: Final = 1_000_000_000
"""A device that brings nothing for so long is woken: the time in which a node is back by itself."""
DRIFT: Final = 0.02
"""Two clocks may run apart by so much: one part in a hundred was measured, of an inertial sensor;
twice that."""


class Stamp:
    """The device's own time in a message: whether it moves on, and how late its frame came.

    The least delay so far counts as none. It is forgotten at the rate of two clocks that run apart.
    A count is `unit_us` microseconds; a frame that is later than others by more than `late_ms` is
    not accepted.
    """

    def __init__(self, field: Field, unit_us: float, late_ms: float) -> None:
        self._field = field
        self._unit_ns = unit_us * 1e3
        self._late_ns = late_ms * 1e6
        self._counts = 1 << field.bits
        half_ns = self._counts // 2 * self._unit_ns  # from here on it may have wrapped
        self._silent_ns = min(max(SILENT_NS, 3 * self._late_ns), half_ns)
        self._last = -1
        self._time_ns = self._least_ns = 0.0
        self._came_ns = 0
        self.late = 0

    def passes(self, data: bytes, now_ns: int) -> bool:
        """Take the next stamp; False where it stands, steps back, or comes late.

        A step back that is no wrap is a device that has restarted: its next stamp is taken. So it
        is after a silence: the device may have been off, or its stamp have wrapped unseen.
        """
        stamp = self._field.raw(data) % self._counts  # it may have a sign
        last, self._last = self._last, stamp
        steps = (stamp - last) % self._counts
        if last < 0 or steps > self._counts // 2 or now_ns - self._came_ns > self._silent_ns:
            self._time_ns, self._least_ns, self._came_ns = 0.0, float(now_ns), now_ns
            return False
        if steps == 0:
            return False
        self._time_ns += steps * self._unit_ns
        delay_ns = now_ns - self._time_ns
        forgiven_ns = self._least_ns + DRIFT * (now_ns - self._came_ns)
        self._least_ns, self._came_ns = min(delay_ns, forgiven_ns), now_ns
        if delay_ns - self._least_ns > self._late_ns:
            self.late += 1
            return False
        return True


STATUS_CYCLES: Final = 3  #: A status that is older by this many cycles says nothing.
_SLOPE_NS: Final = round(SLOPE_S * 1e9)
_new: Final = tuple.__new__
# read once: in Python 3.11 a member costs eight times as much from its class as from here
_GOOD: Final = Quality.GOOD
_BAD: Final = Quality.BAD


def nobody(message: Any, now_ns: int) -> None:
    """Take what nobody has asked for yet."""


class Taker:
    """Takes the frames of one identifier; a class, since compiled its method is called directly."""

    def take(self, frame: Frame, now_ns: int) -> None:
        """Take a frame at the time of its receipt."""
        raise NotImplementedError


class CalledTaker(Taker):
    """Calls a function with each frame."""

    def __init__(self, function: Callable[[Frame, int], None]) -> None:
        self._function = function

    def take(self, frame: Frame, now_ns: int) -> None:
        """Take a frame at the time of its receipt."""
        self._function(frame, now_ns)


class _Both(Taker):
    def __init__(self, first: Taker, second: Taker) -> None:
        self._first, self._second = first, second

    def take(self, frame: Frame, now_ns: int) -> None:
        self._first.take(frame, now_ns)
        self._second.take(frame, now_ns)


def hear(takers: dict[int, Taker], can_id: int, taker: Taker) -> None:
    """Add what takes the frames of an identifier; several may, one after the other."""
    first = takers.get(can_id)
    takers[can_id] = taker if first is None else _Both(first, taker)


class MessageHeard(HeardMessage):
    """One message of a device: its protection, what it says, and when it said it."""

    def __init__(self, plan: MessagePlan, late_ms: float, bit: int) -> None:
        super().__init__(plan)
        self.name, self.of_group = plan.name, len(plan.can_ids) > 1  # by PGN, of any priority
        self.signals: tuple[SignalPlan, ...] = plan.signals
        self.conditions: tuple[ConditionPlan, ...] = plan.conditions
        self.only: ConditionPlan | None = plan.only
        self.counts_all: bool = plan.counts_all
        self.stamp = None if plan.stamp is None else Stamp(plan.stamp, plan.stamp_us, late_ms)
        self.needed: bool = bool(plan.signals) or plan.stamp is not None
        #: Whether it says of the device that it is well, or at least that it lives.
        self.status: bool = bool(plan.conditions) or not (self.needed or plan.counter is None)
        self.bit = bit if self.needed else 0
        self.came_ns = self.good_ns = LONG_AGO_NS
        self.old_ns = STATUS_CYCLES * plan.cycle_ns  #: Age from which its status says nothing.
        self.unwell = ""  #: What its last status said instead of what is valid.

    def is_another(self, data: bytes) -> bool:
        """Whether a frame of its identifier, however long, has another content."""
        only = self.only
        return only is not None and not only.holds(data.ljust(self.length, b"\0"))


class ProfiledDevice(Generic[T]):
    """Hears one device, and hands on each measurement that is complete.

    `deliver` is called with each message and the time at which it was complete. `takers` has, by
    identifier, what takes its frames; `watched` counts its messages.
    """

    def __init__(self, plan: DevicePlan[T]) -> None:
        self.plan = plan
        self.deliver: Callable[[T, int], None] = nobody
        self.cycle_ns: int = plan.cycle_ns
        messages = [
            MessageHeard(each, plan.age_ms, 1 << place) for place, each in enumerate(plan.messages)
        ]
        self.watched: tuple[MessageHeard, ...] = tuple(messages)
        self._needed = [each for each in messages if each.needed]
        self._status = [each for each in messages if each.status]
        #: Whether a counter or a stamp tells a new measurement.
        self.counts = any(
            each.needed and (of.counter or of.stamp)
            for each, of in zip(messages, plan.messages, strict=True)
        )
        self._all = sum(each.bit for each in messages)
        self._here = 0  # bits of the messages that a measurement has so far
        self._kind: Any = plan.kind
        self._same_instant_ns: int = plan.same_instant_ns
        self._unchanged_ns: int = plan.unchanged_ns
        self._derived: bool = plan.derived
        self._values: list[float] = [math.nan] * len(FIELDS[plan.kind])
        self._tank = plan.kind is SensorTank
        self._moved = False
        self._changed_ns = self._delivered_ns = LONG_AGO_NS
        self._past: deque[tuple[int, float]] = deque()  # times and rolls, of `SLOPE_S` and before
        self.named = plan.name_id is None
        self.proved = True  #: Whether what it orders counts; all, but of a panel that has a key.
        self.takers: dict[int, Taker] = {}
        for message, each in zip(messages, plan.messages, strict=True):
            for can_id in each.can_ids:
                hear(self.takers, can_id, _MessageTaker(self, message))
        if plan.name_id is not None:
            hear(self.takers, plan.name_id[0], CalledTaker(self._take_claim))

    @property
    def valid(self) -> bool:
        """Whether the messages with a value arrive intact and in order."""
        for message in self._needed:  # noqa: SIM110  # all() is three times slower
            if not message.valid:
                return False
        return True

    def wake(self, now_ns: int) -> Frame | None:
        """What is to be sent to a device that says nothing, or not who it is."""
        return self.plan.wake if self.silent(now_ns) or not self.named else None

    def silent(self, now_ns: int) -> bool:
        """Whether it has brought nothing for `SILENT_NS`."""
        return now_ns - self._delivered_ns > SILENT_NS

    @property
    def words(self) -> str:
        """Why what it measures does not count, though its frames are right; else empty."""
        claim = self.plan.name_id
        if claim is not None and not self.named:
            return f"{self.plan.name}: address {claim[0] & 0xFF:#x} not claimed by {claim[1]:#x}"
        placed = {signal.place for each in self._needed for signal in each.signals}
        missing = [FIELDS[self._kind][place] for place in sorted(placed)
                   if math.isnan(self._values[place])]  # fmt: skip
        if missing and self._delivered_ns > LONG_AGO_NS:
            return f"{self.plan.name}: {', '.join(missing)} not available, or out of range"
        judged = self._changed_ns > LONG_AGO_NS
        stands = judged and 0 < self._unchanged_ns < self._delivered_ns - self._changed_ns
        return f"{self.plan.name}: says the same for too long (unchanged_ms)" if stands else ""

    @property
    def lost(self) -> int:
        """Measurements missing by a counter."""
        lost = 0
        for message in self._needed:
            lost = max(lost, message.lost)
        return lost

    def _take_claim(self, frame: Frame, now_ns: int) -> None:  # noqa: ARG002
        assert self.plan.name_id is not None
        self.named = int.from_bytes(frame.data, "little") == self.plan.name_id[1]

    def take(self, message: MessageHeard, frame: Frame, now_ns: int) -> None:
        """Take a frame of one of its messages."""
        data = frame[1]  # by its name it takes ten times as long
        if message.only is not None and message.is_another(data):
            if message.counts_all:
                message.counts_on(data)
            return
        if not message.passes(data):
            return
        if message.status:
            message.good_ns, message.unwell = now_ns, ""
            for condition in message.conditions:
                if not condition.holds(data):
                    message.good_ns = LONG_AGO_NS
                    said = condition.field.raw(data) & condition.mask
                    message.unwell = f"status {said:#x} (mask {condition.mask:#x}) is not valid"
                    break
        stamp = message.stamp
        if stamp is not None and not stamp.passes(data, now_ns):
            self._here &= ~message.bit
            return
        values = self._values
        for signal in message.signals:
            value, before = signal.value(data), values[signal.place]
            if value != before and not (math.isnan(value) and math.isnan(before)):
                self._moved = True
            values[signal.place] = value
        if not message.needed:  # a status belongs to no instant
            return
        message.came_ns = now_ns
        self._here |= message.bit
        if self._here == self._all:
            self._complete(now_ns)

    def _complete(self, now_ns: int) -> None:
        """Hand on a measurement, where all that it is made of belongs to one instant."""
        earliest_ns = now_ns - self._same_instant_ns
        for message in self._needed:
            if message.came_ns < earliest_ns:
                return
        self._here = 0
        self._delivered_ns = now_ns
        values = self._values
        if self._derived:
            values[1] = self._slope_rad_s(values[0], now_ns)
        usable = self.named and self._changes(now_ns)
        for message in self._status:
            if now_ns - message.good_ns > message.old_ns:
                usable, message.unwell = False, message.unwell or "too late for a status"
        content = self._content(usable)
        if content is not None:
            self.deliver(_new(self._kind, content), now_ns)

    def _slope_rad_s(self, roll_rad: float, now_ns: int) -> float:
        """The slope of the roll over `SLOPE_S`, or since the roll before if that is longer ago."""
        past, time_ns = self._past, now_ns - TICK_NS // 2  # it came in the tick that has ended
        if past:
            if time_ns - past[-1][0] > max(_SLOPE_NS, 2 * self.cycle_ns):
                past.clear()  # nothing is known of the time between
            else:  # a cycle after the one before, which the ticks correct by and by
                due_ns = past[-1][0] + self.cycle_ns
                if 2 * abs(time_ns - due_ns) <= 3 * TICK_NS:
                    time_ns = due_ns + (time_ns - due_ns) // 32
        past.append((time_ns, roll_rad))
        while len(past) > 2 and time_ns - past[1][0] >= _SLOPE_NS:
            past.popleft()
        then_ns, then_rad = past[0]
        return (roll_rad - then_rad) / (time_ns - then_ns) * 1e9 if then_ns < time_ns else math.nan

    def _content(self, usable: bool) -> tuple[Any, ...] | None:
        """The message's fields, of the present values; None if there is nothing to be said."""
        values, quality = self._values, _GOOD if usable else _BAD
        if not self._tank:
            return (values[0], values[1], quality)
        port_m, starboard_m, port, starboard = values
        switches = self._switch(port, port_m), self._switch(starboard, starboard_m)
        return (port_m, starboard_m, *switches, quality)

    def _changes(self, now_ns: int) -> bool:
        """Whether the content has changed within its time; without a limit it always has."""
        if not self._unchanged_ns:
            return True
        if self._moved:
            self._moved, self._changed_ns = False, now_ns
        return now_ns - self._changed_ns <= self._unchanged_ns

    def _switch(self, raw: float, level_m: float) -> Switch:
        """A switch's state; without switches the level decides, and one that is unknown is high."""
        if math.isfinite(self.plan.high_level_m):
            return Switch.OFF if level_m <= self.plan.high_level_m else Switch.ON
        return Switch.OFF if raw == 0.0 else Switch.ON


class _MessageTaker(Taker):
    def __init__(self, device: ProfiledDevice[Any], message: MessageHeard) -> None:
        self._device, self._message = device, message

    def take(self, frame: Frame, now_ns: int) -> None:
        self._device.take(self._message, frame, now_ns)
