"""Signals of any supported file: recordings, frame logs, logs of the bus, tables.

A run is a mapping of columns in SI units, with the unit in their names and ``time_s`` among them.
Tables (CSV, Parquet) may have other units, by their names (``roll_deg``, ``pressure_command_kpa``).
"""

import csv
import zlib
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, Final

import numpy as np

from utank_hil.base import text_files
from utank_hil.base.arrays import FloatArray
from utank_hil.base.between import ALWAYS, Between
from utank_hil.base.whole_file import errors_name, left_whole
from utank_hil.telemetry.bus_files.log import BusLog, source_of
from utank_hil.telemetry.bus_logs import LoggedController
from utank_hil.telemetry.frame_log import SUFFIX, FrameLog, FrameLogError
from utank_hil.telemetry.logged_signals import Columns, signal_parts, signal_table
from utank_hil.telemetry.recording_reader import read_recording
from utank_hil.telemetry.replay import Entry, entries_of
from utank_hil.telemetry.run_log import read_run_log
from utank_hil.telemetry.units import column_of

TABLE_SUFFIXES: Final = (".csv", ".parquet")
_Column = tuple[str, FloatArray]
_OTHER_UNITS: Final = {
    "_mm": ("_m", 1e-3), "_cm": ("_m", 1e-2), "_ms": ("_s", 1e-3),
    "_bar": ("_pa", 1e5), "_mbar": ("_pa", 1e2), "_mpa": ("_pa", 1e6),
}  # fmt: skip
"""Other units of tables: ending of the column, and SI ending and value of the unit."""
_LEVEL_OF_GAUGES: Final = ("port_level_m", "starboard_level_m")
_JITTER: Final = 0.25
"""Largest deviation, in steps, of a row from its place in even steps. Chosen; no study."""
_GAP: Final = 1.5  #: Number of steps between two rows from which rows are missing.
_RATE: Final = 1e-3  #: Largest relative error of a logger's clock: ten times a poor quartz's.


def read_signals(
    path: Path,
    note: Callable[[str], None] | None = None,
    *,
    channel: str | None = None,
    names: Container[str] | None = None,
    between_s: Between = ALWAYS,
) -> dict[str, Columns]:
    """Read the runs of a file by name; a file without names has one run, named by its stem.

    `note` is called with what was not read as it stands: a cut, a step of a clock, and the columns
    of a table that hold no numbers, which are an error without it. `channel` is the bus to read of
    a log with several. Of a frame log or a log of the bus, which may be of days, `names` and rows
    `between_s` are kept (`signal_table`); of other files all. ValueError has the file's name, the
    line if any, and the remedy.
    """
    suffix = text_files.kind_of(path)
    text_files.refuse_device(path)
    path.open("rb").close()  # Readers may give a less precise reason.
    if suffix == ".rrd":
        return read_recording(path)
    if not is_table(path):
        columns = signal_table(logged_parts(path, note, channel), names, between_s, path)
    elif suffix == ".csv":
        columns = _all_in_si(path, text_files.read_number_table(path).items())
    else:
        columns = _all_in_si(path, _read_parquet(path, note))
    packed = path.suffix.lower() == ".gz"
    return {Path(path.stem).stem if packed else path.stem: columns}


def logged_parts(
    path: Path,
    note: Callable[[str], None] | None,
    channel: str | None,
    between_s: Between = ALWAYS,
) -> Iterator[Columns]:
    """Yield a log's table by parts as `signal_parts`; `between_s` is since its first record."""
    if text_files.kind_of(path) == SUFFIX:
        log = FrameLog(path)
        entries = part_of_entries(entries_of(log.blocks(note)), between_s)
        if _has_bought_devices(log.head):
            yield from _with_rows(signal_parts(entries), path, between_s)
            return
    else:
        notes: list[str] = []
        entries = LoggedController(BusLog(path, channel, between_s), notes).entries()
        if note is not None and notes:
            note("; ".join(notes))
    yield from signal_parts(entries)


def _has_bought_devices(head: Mapping[str, Any]) -> bool:
    """Whether frames of other makers, which the catalogue does not decode, are in a log."""
    configuration = head.get("about", {}).get("configuration")
    vessel = configuration.get("vessel") if isinstance(configuration, dict) else None
    return isinstance(vessel, dict) and vessel.get("devices") is not None


def _with_rows(parts: Iterable[Columns], path: Path, between_s: Between) -> Iterator[Columns]:
    """What no frame of the catalogue says, by the telemetry of the run, held between its rows."""
    try:
        rows = read_run_log(path).signals
    except FrameLogError:  # of a bench, whose recording has it
        yield from parts
        return
    times_s = rows["time_s"] - max(between_s[0], 0.0)
    for part in parts:
        at = np.searchsorted(times_s, part["time_s"], "right") - 1
        for name in part.keys() & rows.keys() - {"time_s"}:
            if np.isnan(part[name]).all():
                part[name] = np.where(at >= 0, rows[name][at], np.nan)
        yield part


def is_table(path: Path) -> bool:
    """Whether a file is a table of signals by its name, and no table of frames."""
    return text_files.kind_of(path) in TABLE_SUFFIXES and not (path.exists() and source_of(path))


def part_of_entries(entries: Iterable[Entry], between_s: Between) -> Iterator[Entry]:
    """Yield the records between two times, in seconds from the first."""
    begin_ns = None
    for entry in entries:
        begin_ns = entry.time_ns if begin_ns is None else begin_ns
        if between_s[0] <= (entry.time_ns - begin_ns) * 1e-9 <= between_s[1]:
            yield entry


def export_parts(path: Path, parts: Iterable[Columns]) -> int:
    """Write the table of a log as it comes, in bounded memory; return its number of rows.

    Which signals are NaN throughout, and left out, shows at the end. Until then the parts are kept,
    compressed, in a file beside `path` that has no name.
    """
    seen: dict[str, bool] = {}
    blocks: list[tuple[int, int]] = []
    with errors_name(path):
        kept = TemporaryFile(dir=path.parent)  # noqa: SIM115 - errors below are of what is read
    with kept:
        for part in parts:
            for name, column in part.items():
                seen[name] = seen.get(name, name == "time_s") or not np.isnan(column).all()
            block = zlib.compress(np.array(list(part.values())).tobytes(), level=1)
            blocks.append((len(part["time_s"]), len(block)))
            with errors_name(path):
                kept.write(block)
        kept.seek(0)

        def again() -> Iterator[Columns]:
            for rows, size in blocks:
                table = np.frombuffer(zlib.decompress(kept.read(size))).reshape(len(seen), rows)
                pairs = zip(seen.items(), table, strict=True)
                yield {name: column for (name, is_seen), column in pairs if is_seen}

        write_signals(path, again())
    return sum(rows for rows, _ in blocks)


def write_signals(path: Path, parts: Iterable[Mapping[str, FloatArray]]) -> None:
    """Write parts of the same columns exactly, as CSV or Parquet; NaN is an empty field or null."""
    parts = iter(parts)
    first = next(parts)
    if path.suffix.lower() == ".parquet":
        import pyarrow
        from pyarrow import parquet

        schema = pyarrow.schema([(name, pyarrow.float64()) for name in first])
        with left_whole(path), parquet.ParquetWriter(path, schema) as writer:
            for part in chain([first], parts):
                arrays = [pyarrow.array(values, from_pandas=True) for values in part.values()]
                writer.write_table(pyarrow.table(arrays, schema=schema))
        return
    with left_whole(path), path.open("w", newline="", encoding="utf-8") as content:
        writer = csv.writer(content)
        # A spreadsheet runs what begins so; an apostrophe makes it text.
        writer.writerow(f"'{name}" if name[:1] in ("=", "+", "-", "@") else name for name in first)
        for part in chain([first], parts):
            for row in zip(*(values.tolist() for values in part.values()), strict=True):
                writer.writerow("" if value != value else repr(value) for value in row)


def even_rows(
    path: Path,
    columns: Mapping[str, FloatArray],
    sample_time_s: float,
    between_s: Between = ALWAYS,
) -> Columns:
    """Return a part of a table, with rows on an even grid that divides a law's sample time.

    `path` is for errors. The returned ``time_s`` counts from the first row of the part.
    TextFileError names line and remedy if the times do not rise, have a gap, or are not even, or if
    the sample time is no whole number of their steps.
    """
    require(path, columns, "time_s")
    time_s = columns["time_s"]
    low, high = between_s
    (kept,) = np.nonzero((time_s >= low) & (time_s <= high) | np.isnan(time_s))
    if len(kept) < 3:
        raise text_files.TextFileError(
            f"{path}: {len(kept)} rows between {low:g} and {high:g} s: too few"
        )
    part_s = time_s[kept]

    def refused(index: int, reason: str) -> text_files.TextFileError:
        row = int(kept[index])
        place = f"line {row + 2}" if text_files.kind_of(path) == ".csv" else f"row {row}"
        return text_files.TextFileError(f"{path}: {place}{reason}")

    if not np.isfinite(part_s).all():
        row = int(np.flatnonzero(~np.isfinite(part_s))[0])
        raise refused(row, " has no time: fill in time_s, or remove the line")
    steps_s = np.diff(part_s)
    usual_s = float(np.median(steps_s))
    for wrong, reason in (
        (steps_s <= 0, ": times must rise; sort the rows, and keep one of each time"),
        (
            steps_s > _GAP * usual_s,
            f", a gap where rows are {usual_s:g} s apart: fill it, or leave it out by --from "
            "{after:g} or --to {before:g}",
        ),
    ):
        if wrong.any():
            row = int(np.flatnonzero(wrong)[0]) + 1
            before, after = part_s[row - 1], part_s[row]
            reason = reason.format(before=before, after=after)
            raise refused(row, f": time_s goes from {before:g} to {after:g}{reason}")
    number = np.arange(len(part_s))
    step_s = sample_time_s / max(1, round(sample_time_s / usual_s))
    off_s = part_s - step_s * number
    if np.abs(off_s - off_s.mean()).max() > _JITTER * step_s:  # The clock is allowed a small error.
        own_step_s, begin_s = np.polyfit(number, part_s, 1)
        off_s = np.abs(part_s - begin_s - own_step_s * number)
        if off_s.max() > _JITTER * own_step_s:
            reason = f"even steps of {own_step_s:.4g} s: resample the table to even steps"
            raise refused(
                int(off_s.argmax()), f": time_s is {off_s.max():.2g} s away from {reason}"
            )
        if abs(round(sample_time_s / own_step_s) * own_step_s / sample_time_s - 1) > _RATE:
            raise refused(
                0,
                f" and on: rows are {own_step_s:.4g} s apart, and the law's sample time, "
                f"{sample_time_s:g} s, is no whole number of such steps: resample to a part of it, "
                "or give a configuration whose law has another sample time",
            )
    kept_columns: Columns = {name: values[kept] for name, values in columns.items()}
    kept_columns["time_s"] = np.multiply(number, step_s, dtype=np.float64)
    return kept_columns


def require(path: Path, columns: Mapping[str, FloatArray], *names: str) -> None:
    """Raise TextFileError for a file that lacks columns; a level may be that of both gauges."""
    for name in names:
        both = all(each in columns for each in _LEVEL_OF_GAUGES)
        if name in columns or (name == "level_m" and both):
            continue
        other = {"roll_rad": " or roll_deg", "roll_rate_rad_s": " or roll_rate_deg_s"}.get(name, "")
        if name == "level_m":
            other = f", or {' and '.join(_LEVEL_OF_GAUGES)}"
        if name.endswith("_pa"):
            other = f" or {name.removesuffix('_pa')}_kpa"
        unclear = [column for column in columns if name == "time_s" and text_files.is_time(column)]
        if unclear:
            other = f": name {unclear[0]!r} {name} if it is in seconds"
        raise text_files.TextFileError(
            f"{path}: has no column {name}{other}; in SI units it has {', '.join(columns)}. Name "
            "columns by what they hold and their unit (docs/how-to/logs.md)"
        )


def _read_parquet(path: Path, note: Callable[[str], None] | None) -> Iterator[_Column]:
    """Yield the columns of numbers; `note` is called with the columns of other types."""
    import pyarrow
    from pyarrow import parquet, types

    try:
        with path.open("rb") as content:  # The library leaves open what it can't read.
            file = parquet.ParquetFile(content)
            numbers, other = [], []
            for name, kind in zip(file.schema_arrow.names, file.schema_arrow.types, strict=True):
                number = types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind)
                dated = types.is_timestamp(kind) and text_files.is_time(name)
                fits = number or dated or types.is_boolean(kind)
                numbers.append(name) if fits else other.append(f"{name} ({kind})")
            if file.metadata.num_rows * len(numbers) > text_files.VALUES_LIMIT:
                raise text_files.more_values(path)
            table = file.read(columns=numbers)
    except (pyarrow.ArrowException, OSError, UnicodeError) as error:
        raise text_files.TextFileError(
            f"{path}: is no Parquet file that can be read: {error}"
        ) from error
    for field, column in zip(table.schema, table.columns, strict=True):
        if types.is_timestamp(field.type):
            seconds = column.cast(pyarrow.timestamp("ns", field.type.tz)).cast(pyarrow.int64())
            values = seconds.cast(pyarrow.float64(), safe=False).to_numpy(zero_copy_only=False)
            yield text_files.since_first(path, field.name, values * 1e-9)
            continue
        if types.is_boolean(field.type):
            column = column.cast(pyarrow.int8())
        yield field.name, column.cast(pyarrow.float64(), safe=False).to_numpy()
    if other:
        why = f"{path}: columns that are no numbers are left out: {', '.join(other)}"
        if note is None:
            raise text_files.TextFileError(why)
        note(why)


def _all_in_si(path: Path, columns: Iterable[_Column]) -> Columns:
    """Return columns in SI units; TextFileError names two that are one signal."""
    found: Columns = {}
    sources: dict[str, str] = {}
    for name, values in columns:
        column, in_si = _in_si(name, values)
        if column in found:
            other = sources[column]
            both = (
                f"names {name!r} twice" if name == other else f"{other} and {name} are one signal"
            )
            raise text_files.TextFileError(f"{path}: {both}: remove or rename one")
        sources[column], found[column] = name, in_si
    if not found:
        raise text_files.TextFileError(f"{path}: has no column of numbers")
    return found


def _in_si(name: str, values: FloatArray) -> _Column:
    for suffix, (si, factor) in _OTHER_UNITS.items():
        if name.endswith(suffix):
            return name.removesuffix(suffix) + si, values * factor
    column, unit = column_of(name)
    return column, values if unit.scale == 1 or column == name else values / unit.scale
