"""Tables of numbers in text: a line of names, then rows, with a comma, semicolon or tab between."""

import csv
import math
import re
from array import array
from collections.abc import Iterator
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from typing import Any, Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.text_files import TextFileError, open_text

NUMBER: Final = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
"""A decimal number as any program writes it; no infinity, no underscores, no other digits."""
_NO_DATE_S: Final = 1e7
"""Seconds below which a number beside dates is none: no measurement is of the year 1970."""
_MISSING: Final = ("", "nan")  # Fields, in small letters, that stand for no value.
_TIME: Final = "time"  # Beginning, in small letters, of the names of columns that may hold dates.


def read_number_table(path: Path) -> dict[str, FloatArray]:
    """Return the columns of a table by their names; a field without a value is NaN.

    A column of times may hold dates by ISO 8601, in UTC unless they name another zone; it becomes
    ``time_s``, in seconds from its first row. TextFileError has the line, the cause and the remedy.
    """
    with open_text(path) as text:
        first = text.readline()
        lines = csv.reader(chain([first], text), delimiter=max(",;\t", key=first.count))
        try:
            names = [name.strip() for name in next(lines, [])]
            _check_names(path, names)
            values = array("d")
            dates: set[int] = set()
            for row in filter(None, lines):
                dates |= _append_row(path, names, row, lines.line_num, values)
        except csv.Error as error:
            raise TextFileError(f"{path}: line {lines.line_num} is no row: {error}") from error
    if not values:
        raise TextFileError(f"{path}: has a line of names and no rows")
    table = np.frombuffer(values).reshape(-1, len(names))
    return dict(_named(path, names, table, dates))


def since_first(path: Path, name: str, seconds: FloatArray) -> tuple[str, FloatArray]:
    """Return a column of dates as ``time_s``, from its first row on, which needs one."""
    if math.isnan(seconds[0]):
        raise TextFileError(f"{path}: {name} has no date in its first row: fill it in")
    return "time_s", seconds - seconds[0]


def is_time(name: str) -> bool:
    """Return whether a column of this name may hold dates."""
    return name.lower().startswith(_TIME)


def _named(
    path: Path, names: list[str], table: FloatArray, dates: set[int]
) -> Iterator[tuple[str, FloatArray]]:
    for index, name in enumerate(names):
        column = table[:, index]
        if index in dates:
            if (np.abs(column) < _NO_DATE_S).any():
                raise TextFileError(f"{path}: {name} holds dates and numbers: use one of them")
            yield since_first(path, name, column)
        elif name:
            yield name, column


def _check_names(path: Path, names: list[str]) -> None:
    if not any(names):
        raise TextFileError(f"{path}: line 1 must name the columns, such as time_s,roll_deg")
    for name in filter(None, names):
        if names.count(name) > 1:
            raise TextFileError(f"{path}: line 1 names {name!r} twice: rename one")
        if NUMBER.fullmatch(name):
            raise TextFileError(
                f"{path}: line 1 holds the number {name}: it must name the columns, such as "
                "time_s,roll_deg"
            )


def _append_row(path: Path, names: list[str], row: list[str], line: int, values: Any) -> set[int]:
    if len(row) != len(names):
        raise TextFileError(f"{path}: line {line} has {len(row)} fields, line 1 names {len(names)}")
    dated = set()
    for index, (name, field) in enumerate(zip(names, row, strict=True)):
        word = field.strip()
        number = math.nan
        if NUMBER.fullmatch(word):
            number = float(word)
            if math.isinf(number):
                raise TextFileError(f"{path}: line {line}, {name}: {word} is too large")
        elif word.lower() not in _MISSING:
            date = _date_s(word) if is_time(name) else None
            if date is None:
                comma = "; write decimals with a point" if "," in word else ""
                raise TextFileError(f"{path}: line {line}, {name}: {field!r} is no number{comma}")
            number = date
            dated.add(index)
        if not name and word:
            raise TextFileError(f"{path}: line 1 has no name for column {index + 1}: name it")
        values.append(number)
    return dated


def _date_s(word: str) -> float | None:
    """Return the seconds from 1970 to a date and time; None for another word."""
    try:
        date = datetime.fromisoformat(word)
    except ValueError:
        return None
    return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()
