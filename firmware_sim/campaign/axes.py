"""Values of a key in a study: lists, ranges, hours of a measured file, random draws."""

import csv
import zlib
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from utank_hil.base.parameters import Finite, Positive, Range, refuse
from utank_hil.base.text_files import lines_of, open_text
from utank_hil.configuration import Section
from utank_hil.configuration.files import readable
from utank_hil.configuration.spectra import read_spectra, utc

Value = Any  #: Number, text, time, truth value, or content of a file that the study names.
MOST_CASES: Final = 1_000_000
"""Most cases of a study: their list is kept in memory. Chosen; no study."""
WEIGHT: Final = "weight"  #: Column of a table of draws: relative probability of a row.

_Count = Annotated[int, Range(least=1, most=MOST_CASES)]


class Spaced(Section):
    """Equidistant numbers, both ends included."""

    low: Finite
    high: Finite
    count: _Count

    def values(self) -> list[float]:
        """The numbers."""
        return [float(each) for each in np.linspace(self.low, self.high, self.count)]


class Counted(Section):
    """Consecutive whole numbers, such as seeds."""

    first: Annotated[int, Range(least=0)]
    count: _Count

    def values(self) -> list[int]:
        """The numbers."""
        return list(range(self.first, self.first + self.count))


class Hours(Section):
    """Times of the records in a measured file."""

    hours_of: Annotated[Path, readable(read_spectra)]
    since: datetime = datetime.min
    until: datetime = datetime.max

    def values(self) -> list[str]:
        """The times in the notation of a scenario."""
        found = read_spectra(self.hours_of).times(utc(self.since), utc(self.until))
        return [each.isoformat() for each in found]


_KINDS: Final[dict[str, type[Spaced | Counted | Hours]]] = {
    "low": Spaced,
    "first": Counted,
    "hours_of": Hours,
}


def _listed(written: Any) -> Any:
    if not isinstance(written, dict):
        return written
    for key, kind in _KINDS.items():
        if key in written:
            return kind.model_validate(written).values()
    raise ValueError(
        "must be a list of values, {low, high, count}, {first, count} of whole numbers, or "
        "{hours_of, since, until}"
    )


Axis = Annotated[list[Value], BeforeValidator(_listed), Field(min_length=1)]  #: Values of one key.


class Uniform(Section):
    """Uniformly distributed numbers."""

    low: Finite  #: Lower bound.
    high: Finite  #: Upper bound.

    def drawn(self, rng: np.random.Generator, count: int) -> list[Value]:
        """Draw `count` values."""
        return [float(each) for each in self.low + (self.high - self.low) * rng.random(count)]


class Normal(Section):
    """Normally distributed numbers."""

    mean: Finite  #: Mean of the distribution.
    std: Positive  #: Standard deviation.

    def drawn(self, rng: np.random.Generator, count: int) -> list[Value]:
        """Draw `count` values."""
        return [float(each) for each in self.mean + self.std * rng.standard_normal(count)]


class Choice(Section):
    """Equally likely choice among given values."""

    one_of: Annotated[list[Value], Field(min_length=1)]  #: The values.

    def drawn(self, rng: np.random.Generator, count: int) -> list[Value]:
        """Draw `count` values."""
        return [self.one_of[int(each)] for each in rng.integers(len(self.one_of), size=count)]


class Consecutive(Section):
    """Consecutive whole numbers, one for each sample, such as seeds."""

    first: Annotated[int, Range(least=0)]  #: The first number.

    def drawn(self, rng: np.random.Generator, count: int) -> list[Value]:  # noqa: ARG002
        """Draw `count` values."""
        return list(range(self.first, self.first + count))


class Draws(Section):
    """Samples of keys drawn independently of one another and of the rows of a table."""

    samples: _Count  #: Number of samples.
    seed: Annotated[int, Range(least=0)] = 1
    """Seed of the draws, independent of the seed of the waves."""
    keys: dict[str, Uniform | Normal | Consecutive | Choice] = Field(default_factory=dict)
    """Distribution of each dotted key."""
    table: Path | None = None
    """CSV file whose header names keys and `weight`; a sample takes the values of one row."""

    @model_validator(mode="after")
    def _something_to_draw(self) -> "Draws":
        if not self.keys and self.table is None:
            refuse("random", [("keys", "is required but missing, and there is no table either")])
        if self.table is not None:
            try:
                _rows(self.table)
            except (OSError, ValueError) as error:
                refuse("random", [("table", f"can't be drawn from: {error}")])
        return self

    def samples_drawn(self) -> list[dict[str, Value]]:
        """Values of each sample by key; the draws of one key do not depend on the other keys."""
        columns = {key: each.drawn(self._rng(key), self.samples) for key, each in self.keys.items()}
        samples = [
            {key: values[index] for key, values in columns.items()} for index in range(self.samples)
        ]
        if self.table is None:
            return samples
        rows, weights = _rows(self.table)
        below = np.cumsum(weights) / np.sum(weights)
        places = np.searchsorted(below, self._rng(WEIGHT).random(self.samples), side="right")
        taken = [rows[min(int(place), len(rows) - 1)] for place in places]
        return [{**sample, **row} for sample, row in zip(samples, taken, strict=True)]

    def _rng(self, key: str) -> np.random.Generator:
        return np.random.Generator(np.random.PCG64([self.seed, zlib.crc32(key.encode())]))


def _rows(table: Path) -> tuple[list[dict[str, Value]], list[float]]:
    """Rows of a table without their weights, and the weights."""
    with open_text(table) as text:
        lines = (line for _, line in lines_of(table, text) if not line.startswith("#"))
        try:
            names, *cells = filter(None, csv.reader(lines))
        except (csv.Error, ValueError) as error:
            raise ValueError(f"{table}: is no table: {error}") from error
    if not cells or any(len(row) != len(names) for row in cells):
        raise ValueError(f"{table}: needs a heading, and rows of as many cells")
    if len(set(names)) < len(names):
        raise ValueError(f"{table}: names a column twice: rename one")
    written = [dict(zip(names, row, strict=True)) for row in cells]
    rows = [{key: _number(cell) for key, cell in row.items() if key != WEIGHT} for row in written]
    weights = [float(row.get(WEIGHT, 1)) for row in written]
    if not (min(weights) >= 0 and 0 < sum(weights) < np.inf):
        raise ValueError(f"{table}: {WEIGHT} must be zero or more, and not zero in every row")
    return rows, weights


def _number(cell: str) -> Value:
    for kind in (int, float):
        try:
            return kind(cell)
        except ValueError:
            continue
    return cell
