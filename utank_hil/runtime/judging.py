"""The order in which the conditions of the fault table are judged."""

from collections.abc import Callable
from typing import Any, Final, TypeAlias

from utank_hil.canbus.enumerations import Fault
from utank_hil.runtime.faults import FAULTS, Condition, Reaction
from utank_hil.runtime.observations import Observations
from utank_hil.runtime.safety_limits import SafetyLimits

Coded: TypeAlias = tuple[Fault, Condition]
First: TypeAlias = Callable[[Observations, SafetyLimits], Coded | None]
"""Finds the first condition that holds."""
All: TypeAlias = Callable[[Observations, SafetyLimits], set[Fault]]
"""Finds the faults of all conditions that hold; slower, for now and then."""

_ALL: Final = tuple((row.code, condition) for row in FAULTS for condition in row.conditions)


def _with(reaction: Reaction) -> tuple[Coded, ...]:
    return tuple(coded for coded in _ALL if coded[1].reaction is reaction)


def _first_of(conditions: tuple[Coded, ...]) -> First:
    """Write the function out: a loop over the conditions takes twice the time, every tick."""
    numbers = range(len(conditions))
    # a call for each of the monitors' findings would be most of the time
    holds = [
        f"seen.found & {int(condition.findings)}"
        if condition.findings
        else f"holds_{i}(seen, limits)"
        for i, (_, condition) in enumerate(conditions)
    ]
    tests = [f"    if {holds[i]}: return conditions[{i}]" for i in numbers]
    scope: dict[str, Any] = {f"holds_{i}": conditions[i][1].holds for i in numbers}
    scope["conditions"] = conditions
    exec("\n".join(["def first(seen, limits):", *tests, "    return None"]), scope)
    first: First = scope["first"]
    return first


def _all_of(conditions: tuple[Coded, ...]) -> All:
    return lambda seen, limits: {
        code for code, condition in conditions if condition.holds(seen, limits)
    }


_STOPPING: Final = _with(Reaction.STOP)
_ENDING: Final = _STOPPING + _with(Reaction.RAMP)
_AWAITED: Final = sorted(
    (coded for coded in _ALL if coded[1].awaited is not None),
    key=lambda coded: coded[1].awaited or 0,
)

first_stopping: Final = _first_of(_STOPPING)
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
all_warning: Final = _all_of(_with(Reaction.WARN))
all_harming: Final = _all_of(_ENDING + _with(Reaction.HALVE))
