"""Folder of a campaign: study, provenance, cases and rows.

Rows are written in immutable parts, each atomically by renaming a temporary file. A case that
occurs in several parts counts once.
"""

import json
import os
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from firmware_sim.campaign.simulations import LOST, Row
from firmware_sim.campaign.study import METRICS as METRICS
from firmware_sim.campaign.study import LoadedStudy
from utank_hil.base.whole_file import errors_name, left_whole

LEAVES_OUT: Final = {
    "bus": (),
    "linear": (
        "bus, nodes, modes and monitors: the law is in charge from the start",
        "retuning",
        "large angles, limits of the level, quadratic losses, capsizing",
        "the pump's rotor: its pressure follows the command with the delay and lag that the law "
        "was designed for, and its power is that into the water",
        "errors of the sensors but white noise",
    ),
    "nonlinear": (
        "bus, nodes, modes and monitors: the law is in charge from the start",
        "retuning",
        "errors of the sensors but white noise",
        "the drive's own limits",
    ),
}  #: Effects that each kind of simulation leaves out.


STUDY, ABOUT, CASES, ROWS = "study.yaml", "study.json", "cases.parquet", "rows"
SUMMARY, PICTURE = "summary.json", "campaign.png"
FILES: Final = (STUDY, ABOUT, CASES, SUMMARY, PICTURE)
_TEXTS: Final = ("case", "run", "status", "reason", "mark")
_SCHEMA: Final = pa.schema(
    [(name, pa.string()) for name in _TEXTS]
    + [(name, pa.float64()) for name in (*METRICS, "wall_s")]
)


class StoreError(ValueError):
    """Error for a folder that cannot be used; the message contains the remedy."""


class Store:
    """Folder of a campaign."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._rows = folder / ROWS

    def begin(self, loaded: LoadedStudy, about: Mapping[str, Any], *, resume: bool) -> None:
        """Write the study and its cases; raise `StoreError` over results without `resume`."""
        if not resume and any(self._rows.glob("*.parquet")):
            raise StoreError(
                f"{self.folder}: holds results; add --resume to go on with them, or choose another "
                "folder with --out"
            )
        self._rows.mkdir(parents=True, exist_ok=True)
        for left in self._rows.glob("*.part"):
            left.unlink()
        with _replacing(self.folder / STUDY) as file:
            file.write_bytes(loaded.path.read_bytes())
        self.write_json(ABOUT, about)
        names = list(dict.fromkeys(key for case in loaded.cases for key in case.parameters))
        columns: dict[str, list[Any]] = {
            "case": [case.name for case in loaded.cases],
            "index": [case.index for case in loaded.cases],
            "waves": [case.waves for case in loaded.cases],
        }
        columns |= {name: [case.parameters.get(name) for case in loaded.cases] for name in names}
        with _replacing(self.folder / CASES) as file:
            pq.write_table(pa.table({name: _column(each) for name, each in columns.items()}), file)

    def write(self, rows: list[Row]) -> None:
        """Write rows as a new part."""
        if rows:
            table = pa.Table.from_pylist(rows, schema=_SCHEMA)
            with _replacing(self._rows / f"{time.time_ns()}-{os.getpid()}.parquet") as file:
                pq.write_table(table, file)

    def rows(self) -> pa.Table:
        """All rows, with one copy of each case: the first written, or one that was not lost."""
        files = sorted(self._rows.glob("*.parquet"))
        if not files:
            return _SCHEMA.empty_table()
        table = pa.concat_tables([_table(file) for file in files])
        lost = pc.equal(table["status"], LOST)
        table = pa.concat_tables([table.filter(pc.invert(lost)), table.filter(lost)])
        seen: dict[str, set[str]] = {}
        kept = []
        for case, run in zip(table["case"].to_pylist(), table["run"].to_pylist(), strict=True):
            runs = seen.setdefault(case, set())
            kept.append(run not in runs and (run != "" or not runs))
            runs.add(run)
        return table.filter(pa.array(kept, pa.bool_()))

    def done(self) -> set[str]:
        """Names of the cases that need not be computed again."""
        table = self.rows()
        return set(table.filter(pc.not_equal(table["status"], LOST))["case"].to_pylist())

    def gather(self) -> None:
        """Merge all parts into one."""
        parts = sorted(self._rows.glob("*.parquet"))
        if len(parts) > 1:
            with _replacing(self._rows / f"{time.time_ns()}-{os.getpid()}.parquet") as file:
                pq.write_table(self.rows(), file)
            for part in parts:
                part.unlink()

    def write_json(self, name: str, content: Any) -> None:
        """Write a JSON file of figures."""
        with _replacing(self.folder / name) as file:
            file.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


@dataclass(frozen=True, slots=True)
class Results:
    """Campaign as read from its folder."""

    about: dict[str, Any]  #: Provenance; ``configuration`` is the study.
    keys: tuple[str, ...]  #: Keys that define groups.
    cases: list[dict[str, Any]]  #: Index, name, waves and parameters of every case.
    #: Rows by the name of the case; a case without rows is absent.
    rows: dict[str, list[dict[str, Any]]]


def read_results(folder: Path) -> Results:
    """Read a campaign, complete or not; StoreError if what is there is none of this program."""
    rows: dict[str, list[dict[str, Any]]] = {}
    place = folder / ABOUT
    try:
        about = json.loads(place.read_text(encoding="utf-8"))
        keys, place = tuple(about["keys"]), folder / CASES
        cases = _table(place).to_pylist()
        own, place = {case["case"] for case in cases}, folder / ROWS
        for row in Store(folder).rows().to_pylist():
            if row["case"] in own:  # a study that was changed leaves rows of its former cases
                rows.setdefault(row["case"], []).append(row)
        return Results(about, keys, cases, rows)
    except StoreError:
        raise
    except (LookupError, TypeError, ValueError, pa.ArrowException) as error:
        reason = "is damaged, or of another version"
        raise StoreError(f"{place}: {reason} ({error!r:.200})") from error


def _table(file: Path) -> pa.Table:
    """Read a table; StoreError names it."""
    try:
        with file.open("rb") as content:  # The library leaves open what it can't read.
            return pq.read_table(content)
    except (OSError, pa.ArrowException) as error:
        raise StoreError(f"{file}: is no table that can be read: {error}") from error


def _column(values: Iterable[Any]) -> pa.Array:
    """Column of one key: numeric if all values are numbers, else text."""
    values = list(values)
    try:
        return pa.array(values)
    except (pa.ArrowInvalid, pa.ArrowTypeError, OverflowError):
        return pa.array([None if value is None else str(value) for value in values])


@contextmanager
def _replacing(file: Path) -> Iterator[Path]:
    """Yield a temporary path that atomically replaces the file at the end."""
    temporary = file.with_name(file.name + ".part")
    with errors_name(file), left_whole(temporary):
        yield temporary
        temporary.replace(file)
