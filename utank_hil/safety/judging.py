"""Which conditions of the fault table hold, as one number: bit n is the table's n-th condition.

Each condition is judged once a tick, in `standing`. Supervisor and alarms read its answer by groups
of conditions; among those with the same reaction the first of the table names the fault.
"""

from collections.abc import Iterable
from typing import Final, TypeAlias

from utank_hil.canbus.enumerations import Fault
from utank_hil.safety.faults import FAULTS, Condition, Reaction
from utank_hil.safety.safety_limits import SafetyLimits
from utank_hil.safety.situation import Situation

Coded: TypeAlias = tuple[Fault, Condition]

CONDITIONS: Final = tuple((row.code, condition) for row in FAULTS for condition in row.conditions)
"""All conditions in the order of their bits."""
_STATES: Final = tuple(
    (1 << place, condition.holds)
    for place, (_, condition) in enumerate(CONDITIONS)
    if not condition.findings
)
_FINDINGS: Final = tuple(
    (1 << place, condition.findings)
    for place, (_, condition) in enumerate(CONDITIONS)
    if condition.findings
)


def _bits(conditions: Iterable[Condition]) -> int:
    chosen = list(conditions)
    return sum(1 << place for place, (_, each) in enumerate(CONDITIONS) if each in chosen)


def _with(reaction: Reaction) -> int:
    return _bits(condition for _, condition in CONDITIONS if condition.reaction is reaction)


_AWAITED: Final = sorted(
    (condition.awaited, 1 << place)
    for place, (_, condition) in enumerate(CONDITIONS)
    if condition.awaited is not None
)
_RAMPS: Final = sorted(
    (condition.zero_within_ms, 1 << place)
    for place, (_, condition) in enumerate(CONDITIONS)
    if condition.reaction is Reaction.RAMP
)

STOPPING: Final = _with(Reaction.STOP)
RAMPING: Final = _with(Reaction.RAMP)
ENDING: Final = STOPPING | RAMPING
HALVING: Final = _with(Reaction.HALVE)
REFUSING: Final = _with(Reaction.REFUSE)
GIVING_UP: Final = _with(Reaction.GIVE_UP)
WARNING: Final = _with(Reaction.WARN)
AWAITED: Final = sum(bit for _, bit in _AWAITED)
ENDING_PASSIVE: Final = STOPPING & _bits(each for _, each in CONDITIONS if each.ends_passive)
DRIVE_OUT: Final = _bits(each for _, each in CONDITIONS if each.of_drive_that_should_be_on)
"""What is no fault of a drive that is to be off."""


def standing(situation: Situation, limits: SafetyLimits) -> int:
    """Judge every condition of the table once; return the bits of those that hold."""
    bits = 0
    for bit, holds in _STATES:
        if holds(situation, limits):
            bits |= bit
    found = situation.found
    if found:
        for bit, mask in _FINDINGS:
            if found & mask:
                bits |= bit
    return bits


def first(bits: int) -> Coded | None:
    """The first condition of the table among these bits."""
    return CONDITIONS[(bits ^ bits - 1).bit_length() - 1] if bits else None


def first_ending(bits: int) -> Coded | None:
    """What ends ACTIVE: what stops the pump goes before what lets the pressure fall."""
    return first(bits & STOPPING or bits & RAMPING)


def first_refusing(bits: int) -> Coded | None:
    """What refuses arming."""
    return first_ending(bits) or first(bits & REFUSING)


def first_lasting(bits: int) -> Coded | None:
    """What keeps a fault from being reset."""
    return first_ending(bits) or first(bits & AWAITED)


def first_awaited(bits: int) -> Coded | None:
    """What the controller waits for in INIT, in the order in which it waits."""
    if not bits & AWAITED:
        return None
    return next(first(bit) for _, bit in _AWAITED if bits & bit)


def soonest_ramp(bits: int) -> Coded | None:
    """What lets the pressure fall to zero in the shortest time."""
    if not bits & RAMPING:
        return None
    return next(first(bit) for _, bit in _RAMPS if bits & bit)


def faults(bits: int) -> set[Fault]:
    """Faults of all these conditions."""
    found = set()
    while bits:
        found.add(CONDITIONS[(bits ^ bits - 1).bit_length() - 1][0])
        bits &= bits - 1
    return found
