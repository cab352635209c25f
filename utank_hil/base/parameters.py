"""Ranges of parameters: each stands once, at its field, and holds in code and in files alike.

A dataclass annotates its fields (``inertia_kg_m2: Positive``) and is `Checked`, or hands its
`range_problems`, and what else must hold, to `refuse`. Where a file is read, each field is checked
by the same annotation before the dataclass is made: so every wrong number of a file is found at
once.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import lru_cache
from itertools import repeat
from types import UnionType
from typing import Annotated, Any, ClassVar, Union, get_args, get_origin, get_type_hints

Problem = tuple[str, str]
"""Dotted name of a parameter, empty for all of them together, and what is wrong with it."""


class ParameterError(ValueError):
    """Parameters of an `owner` that can't be used: `problems` are their names and what is wrong."""

    def __init__(self, owner: str, problems: list[Problem]) -> None:
        super().__init__("; ".join(" ".join(filter(None, (owner, *each))) for each in problems))
        self.owner = owner
        self.problems = problems

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.owner, self.problems)


@dataclass(frozen=True, slots=True)
class Range:
    """Annotation of a number: where it must lie."""

    least: float = -math.inf  #: Bounds, themselves allowed: this and the next.
    most: float = math.inf
    #: above, below: bounds that are not themselves allowed, instead of `least` and `most`.
    above: float | None = None
    below: float | None = None
    infinite: bool = False  #: Whether infinity is a value, for limits that need not be there.

    def holds(self, value: float) -> bool:
        """Whether a value lies in the range; what is not a number never does."""
        try:
            finite = math.isfinite(
                value
            )  # of a whole number no digit is lost, as a float's would be
        except OverflowError:  # one of hundreds of digits
            return False
        if not (self.infinite or finite):
            return False
        low = value >= self.least if self.above is None else value > self.above
        high = value <= self.most if self.below is None else value < self.below
        return low and high

    @property
    def demand(self) -> str:
        """What a value must be, in words."""
        if self.below is not None or self.most < math.inf:
            return f"must be {self._between}"
        if self.above == 0:
            low = "positive"
        elif self.above is not None:
            low = f"above {self.above:g}"
        elif self.least == 0:
            low = "zero or more"
        elif self.least > -math.inf:
            low = f"{self.least:g} or more"
        else:
            return "must be finite"
        return f"must be {low}" if self.infinite else f"must be {low} and finite"

    @property
    def _between(self) -> str:
        high = f"at most {self.most:g}" if self.below is None else f"below {self.below:g}"
        if self.above is not None:
            return f"above {self.above:g} and {high}"
        if self.least == -math.inf:
            return high
        if self.below is None:
            return f"{self.least:g} to {self.most:g}"
        return f"{self.least:g} or more and {high}"

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Let configuration files check the field as they read it."""
        # here: nothing but files needs it
        from pydantic_core import PydanticCustomError, core_schema

        def a_number(value: Any) -> Any:
            if isinstance(value, bool | str):  # else ``yes`` were 1.0
                raise PydanticCustomError("number_type", "must be a number")
            return value

        def held(value: float) -> float:
            if not self.holds(value):
                raise ValueError(self.demand)
            return value

        number = core_schema.no_info_before_validator_function(a_number, handler(source))
        return core_schema.no_info_after_validator_function(held, number)


Finite = Annotated[float, Range()]
Positive = Annotated[float, Range(above=0)]
NotNegative = Annotated[float, Range(least=0)]
Share = Annotated[float, Range(least=0, most=1)]
SampleTime = Annotated[float, Range(least=1e-3, most=10)]
"""From a fast drive's to a large ship's; beyond, no ship rolls so fast or so slowly."""


def range_problems(instance: Any) -> list[Problem]:
    """Every number in a dataclass's parameters that lies outside the `Range` of its annotation."""
    return [
        problem
        for name, hint in _annotations(instance.__class__).items()
        for problem in _outside(name, hint, getattr(instance, name))
    ]


def _outside(name: str, hint: Any, value: Any) -> Iterator[Problem]:
    """The numbers in a value outside the `Range` of its annotation, by its name and their place."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        marks = [mark for mark in arguments[1:] if isinstance(mark, Range)]
        if missed := next((mark for mark in marks if not mark.holds(value)), None):
            yield name, f"{missed.demand}, got {value}"
        else:
            yield from _outside(name, arguments[0], value)
    elif origin is tuple:
        hints = repeat(arguments[0]) if arguments[1:] == (...,) else arguments
        for index, (inner, item) in enumerate(zip(hints, value, strict=False)):
            yield from _outside(f"{name}.{index}".lstrip("."), inner, item)
    elif origin in (Union, UnionType) and value is not None:
        for inner in arguments:
            yield from _outside(name, inner, value)


def refuse(owner: str, problems: list[Problem]) -> None:
    """Raise a `ParameterError` if there is any problem."""
    if problems:
        raise ParameterError(owner, problems)


class Checked:
    """A dataclass that is checked as it is made: its ranges, and what else `_problems` finds."""

    __slots__ = ()
    _owner: ClassVar[str]

    def __init_subclass__(cls, owner: str = "") -> None:
        if owner:  # a dataclass with slots is a second class, made without it
            cls._owner = owner

    def __post_init__(self) -> None:
        refuse(self._owner, [*range_problems(self), *self._problems()])

    def _problems(self) -> list[Problem]:
        return []


@lru_cache(maxsize=256)
def _annotations(owner: type) -> dict[str, Any]:
    """Of a dataclass's parameters; what it computes itself is left out."""
    hints = get_type_hints(owner, include_extras=True)
    return {field.name: hints[field.name] for field in fields(owner) if field.init}
