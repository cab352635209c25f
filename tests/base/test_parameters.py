"""Ranges hold in code and in files: the same ones, with the same words."""

import math
import pickle
import re
from dataclasses import dataclass, fields, is_dataclass
from typing import Annotated, get_args, get_origin, get_type_hints

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, TypeAdapter, ValidationError

from firmware_sim.scenario import Scenario
from utank_hil.base.parameters import (
    NotNegative,
    ParameterError,
    Positive,
    Range,
    Share,
    range_problems,
    refuse,
)
from utank_hil.configuration import ControllerConfig, Vessel


@dataclass(frozen=True, slots=True)
class Thing:
    size: Positive
    loss: NotNegative = 0.0
    share: Share = 0.5
    count: Annotated[int, Range(least=1, most=9)] = 1
    roof: Annotated[float, Range(above=0, infinite=True)] = math.inf
    stds: tuple[Positive, ...] = ()
    hold: tuple[Positive, Positive] | None = None
    every: Positive | None = None
    gain: Annotated[float, Range(above=0, below=1)] = 0.5

    def __post_init__(self):
        refuse("thing", range_problems(self))


def test_every_parameter_out_of_its_range_is_named():
    with pytest.raises(ParameterError) as caught:
        Thing(-1.0, -2.0, 1.5, 10, 0.0, (1.0, math.nan), (1.0, 0.0), 0.0, 1.0)
    assert dict(caught.value.problems) == {
        "size": "must be positive and finite, got -1.0",
        "loss": "must be zero or more and finite, got -2.0",
        "share": "must be 0 to 1, got 1.5",
        "count": "must be 1 to 9, got 10",
        "roof": "must be positive, got 0.0",
        "stds.1": "must be positive and finite, got nan",
        "hold.1": "must be positive and finite, got 0.0",
        "every": "must be positive and finite, got 0.0",
        "gain": "must be above 0 and below 1, got 1.0",
    }
    assert str(caught.value).startswith("thing size must be positive and finite, got -1.0; ")


def test_error_survives_the_way_from_another_process():
    error = ParameterError("thing", [("size", "must be positive")])
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.problems) == (str(error), error.problems)


@given(
    st.floats(),
    st.sampled_from(
        [
            Range(),
            Range(above=0),
            Range(least=0, most=1),
            Range(above=0, below=1),
            Range(least=0, below=1),
            Range(below=1),
            Range(above=0, infinite=True),
        ]
    ),
)
def test_files_and_code_agree_on_what_a_range_holds(value, mark):
    adapter = TypeAdapter(Annotated[float, mark])
    if mark.holds(value):
        assert adapter.validate_python(value) == value
    else:
        with pytest.raises(ValidationError, match=re.escape(mark.demand)):
            adapter.validate_python(value)


def test_number_of_hundreds_of_digits_is_in_no_range():
    assert not Range().holds(10**400)


def test_the_last_whole_number_of_a_range_is_in_it():
    most = (1 << 64) - 1
    assert Range(least=0, most=most).holds(most)
    assert not Range(least=0, most=most).holds(most + 1)


@pytest.mark.parametrize(
    ("mark", "demand"),
    [
        (Range(least=1, most=9), "must be 1 to 9"),
        (Range(above=0, most=9), "must be above 0 and at most 9"),
        (Range(least=1, below=9), "must be 1 or more and below 9"),
        (Range(most=9), "must be at most 9"),
        (Range(below=9), "must be below 9"),
        (Range(above=2), "must be above 2 and finite"),
    ],
)
def test_demand_says_which_ends_are_allowed(mark, demand):
    assert mark.demand == demand


def parts(hint):
    """An annotation and everything in it."""
    yield hint
    for inner in get_args(hint):
        yield from parts(inner)


def sections_in(model, found):
    """A section of a configuration file and all that it may hold."""
    found.add(model)
    hints = list(get_type_hints(model).values())
    for hint in hints:
        for part in parts(hint):
            known = isinstance(part, type) and part not in found
            if known and (is_dataclass(part) or issubclass(part, BaseModel)):
                sections_in(part, found)
    return found


def bare_numbers(hint):
    """Whether an annotation has a number in it without a range."""
    if get_origin(hint) is Annotated and any(
        isinstance(mark, Range) or getattr(mark, "metadata", ()) for mark in get_args(hint)
    ):
        return False
    return hint in (int, float) or any(map(bare_numbers, get_args(hint)))


def keys(owner):
    """What a file may write in a section."""
    if issubclass(owner, BaseModel):
        return list(owner.model_fields)
    return [field.name for field in fields(owner) if field.init]


def test_every_number_of_a_file_has_its_range():
    owners: set[type] = set()
    for model in (Vessel, ControllerConfig, Scenario):
        sections_in(model, owners)
    assert {"SafetyLimits", "RetuningSettings", "DriveLimits", "SensorErrors", "TimedAction",
            "SeaModel", "EffectiveSlope", "ErrorDynamics", "RobustFuzzy", "Pump",
            "Scenario", "RegularSea", "MeasuredSea", "ControllerConfig",
            } <= {owner.__name__ for owner in owners}  # fmt: skip
    bare = set()
    for owner in owners:
        hints = get_type_hints(owner, include_extras=True)
        bare |= {f"{owner.__name__}.{name}" for name in keys(owner) if bare_numbers(hints[name])}
    # the ranges of a message's values are the catalogue's
    assert bare == {"Impostor.values"}
