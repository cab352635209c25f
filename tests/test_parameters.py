"""Ranges hold in code and, through pydantic, in files: the same ones, with the same words."""

import math
import pickle
import re
from dataclasses import dataclass
from typing import Annotated

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from utank_hil.parameters import (
    NotNegative,
    ParameterError,
    Positive,
    Range,
    Share,
    range_problems,
    refuse,
)


@dataclass(frozen=True, slots=True)
class Thing:
    size: Positive
    loss: NotNegative = 0.0
    share: Share = 0.5
    count: Annotated[int, Range(least=1, most=9)] = 1
    roof: Annotated[float, Range(above=0, infinite=True)] = math.inf
    stds: tuple[Positive, ...] = ()
    hold: tuple[Positive, Positive] | None = None

    def __post_init__(self) -> None:
        refuse("thing", range_problems(self))


def test_every_parameter_out_of_its_range_is_named() -> None:
    with pytest.raises(ParameterError) as caught:
        Thing(-1.0, -2.0, 1.5, 10, 0.0, (1.0, math.nan), (1.0, 0.0))
    assert dict(caught.value.problems) == {
        "size": "must be positive and finite, got -1.0",
        "loss": "must be zero or more and finite, got -2.0",
        "share": "must be 0 to 1, got 1.5",
        "count": "must be 1 to 9, got 10",
        "roof": "must be positive, got 0.0",
        "stds": "must be positive and finite, got (1.0, nan)",
        "hold": "must be positive and finite, got (1.0, 0.0)",
    }
    assert str(caught.value).startswith("thing size must be positive and finite, got -1.0; ")


def test_error_survives_the_way_from_another_process() -> None:
    error = ParameterError("thing", [("size", "must be positive")])
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.problems) == (str(error), error.problems)


@given(
    st.floats(),
    st.sampled_from(
        [Range(), Range(above=0), Range(least=0, most=1), Range(above=0, infinite=True)]
    ),
)
def test_files_and_code_agree_on_what_a_range_holds(value: float, mark: Range) -> None:
    adapter = TypeAdapter(Annotated[float, mark])
    if mark.holds(value):
        assert adapter.validate_python(value) == value
    else:
        with pytest.raises(ValidationError, match=re.escape(mark.demand)):
            adapter.validate_python(value)


def test_number_of_hundreds_of_digits_is_in_no_range() -> None:
    assert not Range().holds(10**400)
