"""The order in which the conditions of the fault table are judged."""

from collections.abc import Callable
from functools import reduce
from operator import or_
from typing import Final, TypeAlias

from utank_hil.canbus.enumerations import Fault
from utank_hil.safety.faults import FAULTS, Condition, Reaction
from utank_hil.safety.observations import Observations
from utank_hil.safety.safety_limits import SafetyLimits

Coded: TypeAlias = tuple[Fault, Condition]
First: TypeAlias = Callable[[Observations, SafetyLimits], Coded | None]
"""Finds the first condition that holds."""
All: TypeAlias = Callable[[Observations, SafetyLimits], set[Fault]]
"""Finds the faults of all conditions that hold; slower, for now and then."""

_ALL: Final = tuple((row.code, condition) for row in FAULTS for condition in row.conditions)


def _with(reaction: Reaction) -> tuple[Coded, ...]:
    return tuple(coded for coded in _ALL if coded[1].reaction is reaction)


def _to_look_at(conditions: tuple[Coded, ...]) -> Callable[[Observations], tuple[Coded, ...]]:
    """Leave out what monitors may find while they find none of it: nearly always, half of all."""
    mask = int(reduce(or_, (condition.findings for _, condition in conditions)))
    states = tuple(coded for coded in conditions if not coded[1].findings)
    return lambda seen: conditions if seen.found & mask else states


def _first_of(conditions: tuple[Coded, ...]) -> First:
    to_look_at = _to_look_at(conditions)

    def first(seen: Observations, limits: SafetyLimits) -> Coded | None:
        for coded in to_look_at(seen):
            if coded[1].holds(seen, limits):
                return coded
        return None

    return first


def _all_of(conditions: tuple[Coded, ...]) -> All:
    to_look_at = _to_look_at(conditions)
    return lambda seen, limits: {
        code for code, condition in to_look_at(seen) if condition.holds(seen, limits)
    }


_STOPPING: Final = _with(Reaction.STOP)
_ENDING: Final = _STOPPING + _with(Reaction.RAMP)
_AWAITED: Final = sorted(
    (coded for coded in _ALL if coded[1].awaited is not None),
    key=lambda coded: coded[1].awaited or 0,
)

first_stopping: Final = _first_of(_STOPPING)
first_ending_passive: Final = _first_of(tuple(c for c in _STOPPING if c[1].ends_passive))
first_ending: Final = _first_of(_ENDING)
soonest_ramp: Final = _first_of(
    tuple(sorted(_with(Reaction.RAMP), key=lambda coded: coded[1].zero_within_ms))
)
first_refusing: Final = _first_of(_ENDING + _with(Reaction.REFUSE))
first_lasting: Final = _first_of(_ENDING + tuple(c for c in _AWAITED if c not in _ENDING))
"""What keeps a fault from being reset."""
first_giving_up: Final = _first_of(_with(Reaction.GIVE_UP))
first_halving: Final = _first_of(_with(Reaction.HALVE))
first_awaited: Final = _first_of(tuple(_AWAITED))
all_stopping: Final = _all_of(_STOPPING)
all_stopping_unawaited: Final = _all_of(tuple(c for c in _STOPPING if c[1].awaited is None))
all_halving: Final = _all_of(_with(Reaction.HALVE))
all_warning: Final = _all_of(_with(Reaction.WARN))
all_refusing: Final = _all_of(_ENDING + _with(Reaction.REFUSE))
all_ending: Final = _all_of(_ENDING)
