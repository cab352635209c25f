"""What the guard (docs/safety.md) hears of devices of other makers: rows of its table."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import reduce
from operator import or_
from typing import Any, Final

from utank_hil.base.tick import TICK_NS
from utank_hil.canbus.frame import BUS_SHIFT, STANDARD
from utank_hil.canbus.line_names import LINES
from utank_hil.canbus.profiles import drive_plan as cia
from utank_hil.canbus.profiles.device import STATUS_CYCLES
from utank_hil.canbus.profiles.device_plan import Crc8, DevicePlan, ForeignDevices, MessagePlan
from utank_hil.canbus.profiles.field import Field, SignalPlan


class Stream(IntEnum):
    """What the guard hears, in the order of guard.h."""

    COMMAND = 0
    DRIVE = 1
    MOTION = 2
    MOTION_2 = 3
    TANK = 4
    PUMP = 5
    ORDER = 6
    ORDER_2 = 7
    HARDWIRED = 8


PRESSURE_PA: Final = 8.0
ROLL_RAD: Final = 1e-4
RATE_RAD_S: Final = 3.125e-5
LEVEL_M: Final = 1e-3  #: Units of the guard's numbers, which are those of native frames.
_SWITCH: Final = 2.0**-10
PLACES: Final = 4
CONDITION: Final = 4
MOVES: Final = 5
MOST_PARTS: Final = 32
_MOST_BITS: Final = 32
_NO_CRC: Final = Crc8(byte=255)
_NO_BOUND: Final = 1 << 33
_MOST_TIMES: Final = 1 << 29
_MOST_PLUS: Final = 1 << 60  #: So that no sum has more than 63 bits.
_UNUSED: Final = (0, 1.0, 0)
_VALUES: Final[dict[Stream, dict[int, tuple[int, float, int]]]] = {
    Stream.MOTION: {0: (0, ROLL_RAD, 0), 1: (1, RATE_RAD_S, 0)},
    Stream.MOTION_2: {0: (0, ROLL_RAD, 0), 1: (1, RATE_RAD_S, 0)},
    Stream.TANK: {
        0: (0, LEVEL_M, 0), 1: (1, LEVEL_M, 0), 2: (2, _SWITCH, 1), 3: (3, _SWITCH, 1),
    },
    Stream.PUMP: {0: (0, PRESSURE_PA, 0)},
    Stream.ORDER: {0: (0, _SWITCH, 0), 1: (1, _SWITCH, 1), 3: (2, _SWITCH, 0)},
}  # fmt: skip
"""Places of values in a plan: place in the guard, unit, and what counts where there is no value."""


@dataclass(frozen=True, slots=True)
class GuardPart:
    """A row: `struct guard_part` of guard.h."""

    can_id: int
    id_bits: int
    length: int
    crc: Crc8
    stream: Stream
    place: int
    old: int
    most_first: bool
    shift: int
    mask: int
    sign_bit: int
    least: int
    most: int
    times: int = 1
    plus: int = 0
    by: int = 1
    otherwise: int = 0

    @property
    def can_ids(self) -> Iterator[int]:
        """Identifiers that it hears."""
        spare = submask = ~self.id_bits & 0xFFFFFFFF
        yield self.can_id
        while submask:
            yield self.can_id | submask
            submask = (submask - 1) & spare


def guard_parts(foreign: ForeignDevices) -> tuple[GuardPart, ...]:
    """Return the rows of all devices; ValueError names each that can't be judged, and why."""
    plans = _plans(foreign)
    problems = [
        f"devices.{plan.name} {reason}"
        for plan, of in plans
        for reason in _unguarded(plan, of, foreign.buses[plan.bus])
    ]
    parts = [] if problems else [row for plan, of in plans for row in _rows(plan, of)]
    if foreign.pump is not None:
        parts += _drive_rows(foreign.pump)
    if len(parts) > MOST_PARTS:
        problems.append(f"the devices say {len(parts)} things, and its table has {MOST_PARTS} rows")
    if problems:
        remedy = "cut the drive's power by a hard-wired stop (redundancy: {hardwired_inputs: true})"
        raise ValueError(f"the guard can't judge this ship: {'; '.join(problems)}. Else {remedy}")
    return tuple(parts)


def unchanged_ticks(foreign: ForeignDevices) -> dict[Stream, int]:
    """Return the ticks after which values that stand are none; 0 where they may."""
    return {of: _ticks(plan.unchanged_ns) for plan, of in _plans(foreign)}


def _plans(foreign: ForeignDevices) -> list[tuple[DevicePlan[Any], Stream]]:
    roles = (*foreign.motions, foreign.levels, foreign.pump_sensor, foreign.panel)
    streams = (Stream.MOTION, Stream.MOTION_2, Stream.TANK, Stream.PUMP, Stream.ORDER)
    return [(plan, of) for plan, of in zip(roles, streams, strict=True) if plan is not None]


def _unguarded(plan: DevicePlan[Any], stream: Stream, bus: str) -> Iterator[str]:
    if bus.startswith(LINES):
        yield f"comes on the line {bus}, not on CAN"
        return
    if plan.derived:
        yield "has a rate that is derived of the roll, not measured"
    if plan.authentication is not None:
        yield "proves by a key that it may arm, and the guard has no key"
    for message in plan.messages:
        if message.only is not None:
            yield f"has several contents under the identifier of {message.name}"
        used = [each.field for each in message.signals]
        used += [each.field for each in message.conditions]
        used += [each for each in (message.counter, message.stamp) if each is not None]
        for field in used:
            if field.real or field.bits > _MOST_BITS:
                yield f"says in {message.name} real numbers, or more than {_MOST_BITS} bits"
        for each in message.conditions:
            if max(each.allowed) - min(each.allowed) >= len(each.allowed):
                yield f"has in {message.name} good states with bad ones between"
        for signal in message.signals:
            times, plus, _ = _line(signal, _VALUES[stream].get(signal.place, _UNUSED)[1])
            if abs(times) > _MOST_TIMES or abs(plus) > _MOST_PLUS:
                yield f"has in {message.name} a scale or an offset beyond its numbers"


def _rows(plan: DevicePlan[Any], stream: Stream) -> Iterator[GuardPart]:
    now = _ticks(2 * plan.cycle_ns + plan.same_instant_ns) + 1
    for message in plan.messages:
        status = _ticks(STATUS_CYCLES * message.cycle_ns) + 1
        for signal in message.signals:
            if signal.place in _VALUES[stream]:
                yield _value(message, stream, signal, now)
        for condition in message.conditions:
            least, most = min(condition.allowed), max(condition.allowed)
            yield _row(
                message, stream, CONDITION, condition.field, status, least, most, condition.mask
            )
        for field in (message.counter, message.stamp):
            if field is not None:
                old = now if message.signals or message.stamp is not None else status
                yield _row(message, stream, MOVES, field, old)


def _drive_rows(plan: cia.DrivePlan) -> Iterator[GuardPart]:
    own = plan.bus << BUS_SHIFT | STANDARD | plan.node
    for stream, cob, entries in (
        (Stream.COMMAND, cia.RECEIVED_1, plan.received),
        (Stream.DRIVE, cia.SENT_1, plan.sent),
    ):
        length = sum(bits for _, bits in entries) // 8
        message = MessagePlan("", (own + cob,), length, cia.COMMAND_MS * 1_000_000)
        yield _row(message, stream, 0, Field(0, 8, length), 1)  # all that counts of the word


def _value(message: MessagePlan, stream: Stream, signal: SignalPlan, old: int) -> GuardPart:
    field = signal.field
    place, unit, otherwise = _VALUES[stream][signal.place]
    bounds = sorted((end - field.offset) / field.scale for end in (signal.least, signal.most))
    low, high = (min(max(end, -_NO_BOUND), _NO_BOUND) for end in bounds)
    least = max(field.least_raw, math.ceil(low - 1e-6))
    most = min(field.most_raw, math.floor(high + 1e-6))
    row = _row(message, stream, place, field, old, least, most)
    times, plus, by = _line(signal, unit)
    return replace(row, times=times, plus=plus, by=by, otherwise=otherwise)


def _line(signal: SignalPlan, unit: float) -> tuple[int, int, int]:
    """Whole numbers by which a value in the guard's unit follows from the counts."""
    field = signal.field
    slope = signal.sign * field.scale * signal.factor / unit
    at_zero = signal.sign * (field.offset * signal.factor + signal.offset) / unit
    by = 1 << 30
    while by > 1 and (abs(slope) * by > _MOST_TIMES or abs(at_zero) * by > _MOST_PLUS):
        by >>= 1
    return round(slope * by), round(at_zero * by), by


def _row(
    message: MessagePlan,
    stream: Stream,
    place: int,
    field: Field,
    old: int,
    least: int = -_NO_BOUND,
    most: int = _NO_BOUND,
    mask: int = -1,
) -> GuardPart:
    spare = reduce(or_, (each ^ message.can_ids[0] for each in message.can_ids))
    signed = place < PLACES and field.signed
    return GuardPart(
        message.can_ids[0] & ~spare, ~spare & 0xFFFFFFFF, message.length, message.crc or _NO_CRC,
        stream, place, old, field.big_endian, field.shift, mask & (1 << field.bits) - 1,
        1 << field.bits - 1 if signed else 0, least, most,
    )  # fmt: skip


def _ticks(time_ns: int) -> int:
    return -(-time_ns // TICK_NS)
