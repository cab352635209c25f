"""Signals from any file that holds some: recordings, frame logs, logs of the bus, tables.

Whatever the file, a run is a mapping of columns in SI units with the unit in their names, and
``time_s`` among them. Tables (CSV, Parquet) may be anybody's: a column may be in another unit,
which its name says (``roll_deg``, ``pressure_command_kpa``), and its times are checked before use.
"""

import csv
import math
from collections.abc import Callable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import Any, Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.whole_file import left_whole
from utank_hil.telemetry.bus_logs import BUS_SUFFIXES, read_bus_log
from utank_hil.telemetry.frame_log import SUFFIX, FrameLog
from utank_hil.telemetry.replay import entries_of
from utank_hil.telemetry.signal_table import signal_table
from utank_hil.telemetry.units import column_of

TABLE_SUFFIXES: Final = (".csv", ".parquet")
SUFFIXES: Final = (".rrd", SUFFIX, *BUS_SUFFIXES, *TABLE_SUFFIXES)
"""Files with signals."""

Columns = dict[str, FloatArray]

_OTHER_UNITS: Final = {
    "_mm": ("_m", 1e-3),
    "_cm": ("_m", 1e-2),
    "_bar": ("_pa", 1e5),
    "_mbar": ("_pa", 1e2),
    "_mpa": ("_pa", 1e6),
}
"""Units of tables beside those in which the project shows values: column and SI value per unit."""
_LEVEL_OF_GAUGES: Final = ("port_level_m", "starboard_level_m")
_JITTER: Final = 0.25
"""A row may be so much of a step away from where even steps put it."""
_GAP: Final = 1.5
_RATE: Final = 1e-3


class SignalFileError(ValueError):
    """The file lacks what is needed, or can't be read; the message names file, line and remedy."""


def read_signals(path: Path, note: Callable[[str], None] | None = None) -> dict[str, Columns]:
    """Read the runs of a file, by name; a file that knows no runs has one, named by its stem.

    Parameters
    ----------
    path : Path
        One of `SUFFIXES`.
    note : callable, optional
        Is told where a frame log is cut or damaged; what follows in that file is left out.

    Raises
    ------
    ValueError
        If it can't be read, with its name, the line where there is one, and the remedy.
    OSError
        If it can't be opened.
    """
    suffix = path.suffix.lower()
    path.open("rb").close()  # who reads it may say less of why it can't be
    if suffix == ".rrd":
        from utank_hil.telemetry.recording import read_recording  # here: Rerun

        return read_recording(path)
    if suffix == SUFFIX:
        return {path.stem: signal_table(entries_of(FrameLog(path).blocks(note)))}
    if suffix in BUS_SUFFIXES:
        return {path.stem: signal_table(read_bus_log(path))}
    if suffix == ".csv":
        return {path.stem: _read_csv(path)}
    if suffix == ".parquet":
        return {path.stem: _read_parquet(path)}
    raise SignalFileError(f"{path}: holds no signals that can be read: give {_listed(SUFFIXES)}")


def write_signals(path: Path, columns: Mapping[str, FloatArray]) -> None:
    """Write columns as a table, exactly; NaN is an empty field of a CSV and a null of Parquet.

    Parameters
    ----------
    path : Path
        Overwritten; ``.csv`` or ``.parquet``.
    """
    if path.suffix.lower() == ".parquet":
        import pyarrow
        from pyarrow import parquet

        arrays = {name: pyarrow.array(values, from_pandas=True) for name, values in columns.items()}
        with left_whole(path):
            parquet.write_table(pyarrow.table(arrays), path)
        return
    with left_whole(path), path.open("w", newline="", encoding="utf-8") as content:
        writer = csv.writer(content)
        writer.writerow(columns)
        for row in zip(*(values.tolist() for values in columns.values()), strict=True):
            writer.writerow("" if value != value else repr(value) for value in row)


def even_rows(
    path: Path,
    columns: Mapping[str, FloatArray],
    sample_time_s: float,
    from_s: float | None = None,
    to_s: float | None = None,
) -> Columns:
    """Part of a table with its rows on a grid that the sample time is a multiple of.

    Parameters
    ----------
    path : Path
        Where it comes from, for errors.
    sample_time_s : float
        Of the law that is to be identified for.
    from_s, to_s : float, optional
        Part to use.

    Returns
    -------
    dict
        ``time_s`` counts from the part's first row.

    Raises
    ------
    SignalFileError
        If the times do not rise, have a gap, or are not even; or if the sample time is no whole
        number of their steps. The line and the remedy are named.
    """
    if "time_s" not in columns:
        raise _lacks(path, "time_s", columns)
    time_s = columns["time_s"]
    low, high = -math.inf if from_s is None else from_s, math.inf if to_s is None else to_s
    (kept,) = np.nonzero((time_s >= low) & (time_s <= high) | np.isnan(time_s))
    if len(kept) < 3:
        raise SignalFileError(f"{path}: {len(kept)} rows between {low:g} and {high:g} s: too few")
    part_s = time_s[kept]
    if not np.isfinite(part_s).all():
        where = _line(path, kept, int(np.flatnonzero(~np.isfinite(part_s))[0]))
        raise SignalFileError(f"{path}: {where} has no time: fill in time_s, or remove the line")
    steps_s = np.diff(part_s)
    if (steps_s <= 0).any():
        at = int(np.flatnonzero(steps_s <= 0)[0]) + 1
        raise SignalFileError(
            f"{path}: {_line(path, kept, at)}: time_s goes from {part_s[at - 1]:g} to "
            f"{part_s[at]:g}: times must rise; sort the rows, and keep one of each time"
        )
    usual_s = float(np.median(steps_s))
    if (steps_s > _GAP * usual_s).any():
        at = int(np.flatnonzero(steps_s > _GAP * usual_s)[0]) + 1
        raise SignalFileError(
            f"{path}: {_line(path, kept, at)}: time_s goes from {part_s[at - 1]:g} to "
            f"{part_s[at]:g}, a gap where rows are {usual_s:g} s apart: fill it, or leave it out "
            f"by --from {part_s[at]:g} or --to {part_s[at - 1]:g}"
        )
    number = np.arange(len(part_s))
    per_sample = max(1, round(sample_time_s / usual_s))
    step_s = sample_time_s / per_sample
    kept_columns: Columns = {name: values[kept] for name, values in columns.items()}
    off_s = part_s - step_s * number
    if np.abs(off_s - off_s.mean()).max() > _JITTER * step_s:
        _refuse_steps(path, kept, part_s, sample_time_s)
    kept_columns["time_s"] = np.multiply(number, step_s, dtype=np.float64)
    return kept_columns


def _refuse_steps(path: Path, rows: Any, time_s: FloatArray, sample_time_s: float) -> None:
    """Refuse times that are not on the grid of the samples, unless only their clock is a bit off.

    Raises
    ------
    SignalFileError
        If they are uneven, or even with a step that the sample time is no multiple of.
    """
    number = np.arange(len(time_s))
    step_s, begin_s = np.polyfit(number, time_s, 1)
    off_s = np.abs(time_s - begin_s - step_s * number)
    if off_s.max() > _JITTER * step_s:
        raise SignalFileError(
            f"{path}: {_line(path, rows, int(off_s.argmax()))}: time_s is {off_s.max():.2g} s away "
            f"from even steps of {step_s:.4g} s: resample the table to even steps"
        )
    if abs(round(sample_time_s / step_s) * step_s / sample_time_s - 1) > _RATE:
        raise SignalFileError(
            f"{path}: {_line(path, rows, 0)} and on: rows are {step_s:.4g} s apart, and the law's "
            f"sample time, {sample_time_s:g} s, is no whole number of such steps: resample to a "
            "part of it, or give a configuration whose law has another sample time"
        )


def require(path: Path, columns: Mapping[str, FloatArray], *names: str) -> None:
    """Refuse a file that lacks columns; a level may be given as that of both gauges.

    Raises
    ------
    SignalFileError
        Naming what is missing and what there is.
    """
    for name in names:
        both = all(each in columns for each in _LEVEL_OF_GAUGES)
        if name not in columns and not (name == "level_m" and both):
            raise _lacks(path, name, columns)


def _lacks(path: Path, name: str, columns: Mapping[str, FloatArray]) -> SignalFileError:
    other = {"roll_rad": " or roll_deg", "roll_rate_rad_s": " or roll_rate_deg_s"}.get(name, "")
    if name == "level_m":
        other = f", or {_listed(_LEVEL_OF_GAUGES)}"
    if name.endswith("_pa"):
        other = f" or {name.removesuffix('_pa')}_kpa"
    return SignalFileError(
        f"{path}: has no column {name}{other}; it has {', '.join(columns)}. Name columns by what "
        "they hold and their unit (docs/how-to/logs.md)"
    )


def _line(path: Path, rows: Any, index: int) -> str:
    """Where a row stands: line of a CSV, counted from 1 with the header, or row of a table."""
    row = int(rows[index])
    return f"line {row + 2}" if path.suffix.lower() == ".csv" else f"row {row}"


def _read_csv(path: Path) -> Columns:
    """Columns of a CSV: a line of names, then numbers; empty fields are not available."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as content:
            first = content.readline()
            content.seek(0)
            lines = csv.reader(content, delimiter=max(",;\t", key=first.count))
            names = [name.strip() for name in next(lines, [])]
            _check_names(path, names)
            rows = list(_numbers(path, names, lines))
    except (csv.Error, UnicodeDecodeError) as error:
        raise SignalFileError(f"{path}: is no table of text in UTF-8") from error
    if not rows:
        raise SignalFileError(f"{path}: has a line of names and no rows")
    table = np.array(rows)
    return dict(chain.from_iterable(_in_si(n, table[:, i]) for i, n in enumerate(names)))


def _check_names(path: Path, names: list[str]) -> None:
    if not names or not any(names):
        raise SignalFileError(f"{path}: line 1 must name the columns, such as time_s,roll_deg")
    for name in names:
        if names.count(name) > 1:
            raise SignalFileError(f"{path}: line 1 names {name!r} twice: rename one")
        if name.replace(".", "", 1).lstrip("+-").isdigit():
            raise SignalFileError(
                f"{path}: line 1 holds the number {name}: it must name the columns, such as "
                "time_s,roll_deg"
            )


def _numbers(path: Path, names: list[str], lines: Any) -> Iterator[list[float]]:
    for row in lines:
        if not row:
            continue
        if len(row) != len(names):
            raise SignalFileError(
                f"{path}: line {lines.line_num} has {len(row)} fields, line 1 names {len(names)}"
            )
        try:
            yield [float(field) if field.strip() else math.nan for field in row]
        except ValueError:
            name, field = next(
                (n, f) for n, f in zip(names, row, strict=True) if f.strip() and not _is_number(f)
            )
            comma = "; write decimals with a point" if "," in field else ""
            raise SignalFileError(
                f"{path}: line {lines.line_num}, {name}: {field!r} is no number{comma}"
            ) from None


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _read_parquet(path: Path) -> Columns:
    import pyarrow
    from pyarrow import parquet

    try:
        table = parquet.read_table(path)
    except pyarrow.ArrowException as error:
        raise SignalFileError(f"{path}: is no Parquet file") from error
    columns: Columns = {}
    for name in table.column_names:
        column = table.column(name)
        kind = column.type
        if pyarrow.types.is_integer(kind) or pyarrow.types.is_floating(kind):
            values = column.cast(pyarrow.float64()).to_numpy(zero_copy_only=False)
            columns.update(_in_si(name, values))
    if not columns:
        raise SignalFileError(f"{path}: has no column of numbers")
    return columns


def _in_si(name: str, values: FloatArray) -> list[tuple[str, FloatArray]]:
    """A column in SI units, under the name that says so."""
    for suffix, (si, factor) in _OTHER_UNITS.items():
        if name.endswith(suffix):
            return [(name.removesuffix(suffix) + si, values * factor)]
    column, unit = column_of(name)
    return [(column, values if unit.scale == 1 or column == name else values / unit.scale)]


def _listed(names: tuple[str, ...]) -> str:
    return f"{', '.join(names[:-1])} or {names[-1]}" if len(names) > 2 else " and ".join(names)
