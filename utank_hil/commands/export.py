"""``utank-hil export``: frames or signals of a recording for other programs."""

import os
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Annotated, TypeVar

import typer

from utank_hil.base.between import ALWAYS, Between
from utank_hil.console import common
from utank_hil.console.terminal import notes, say_note, shown
from utank_hil.telemetry import signal_files
from utank_hil.telemetry.bus_files.frame import BusFrame
from utank_hil.telemetry.bus_files.log import READ, BusLog
from utank_hil.telemetry.bus_files.writing import SUFFIXES as BUS_SUFFIXES
from utank_hil.telemetry.bus_files.writing import write_frames
from utank_hil.telemetry.bus_logs import frames_of
from utank_hil.telemetry.frame_log import SUFFIX, FrameLog
from utank_hil.telemetry.replay import entries_of

_FORMATS = ", ".join((*BUS_SUFFIXES, *signal_files.TABLE_SUFFIXES))

_T = TypeVar("_T")


def export(
    recording: Annotated[
        Path,
        common.argument(
            f"Frame log ({SUFFIX}), recording (.rrd), table (.csv, .parquet) or log of the "
            f"bus ({READ})."
        ),
    ],
    to: Annotated[
        Path,
        common.option(
            "Frames: .log (candump), .asc, .blf. Signals: .csv, .parquet. Overwritten.",
            metavar="FILE",
        ),
    ],
    run: common.Run = None,
    channel: common.Channel = None,
    from_s: Annotated[
        float | None,
        common.option("From the first record; of logs only.", "--from", metavar="SECONDS"),
    ] = None,
    until_s: Annotated[float | None, typer.Option("--until", metavar="SECONDS")] = None,
    json_: common.Json = False,
) -> None:
    """Write frames or signals of a recording in a format that other programs read.

    Frames keep their times, order, kinds and lengths, or the difference is said. Signals have one
    row a tick, SI units, and the unit in each column's name.

    **Example:** utank-hil export out/gpc.frames --to gpc.blf
    """
    kind = to.suffix.lower()
    if kind not in (*BUS_SUFFIXES, *signal_files.TABLE_SUFFIXES):
        common.fail(f"--to {to}: its suffix says the format, one of {_FORMATS}")
    if to.exists() and recording.exists() and os.path.samefile(recording, to):
        common.fail(f"--to {to} is what is read: name another file")
    if run is not None and recording.suffix.lower() != ".rrd":
        common.fail("--run is for recordings (.rrd), which hold several: leave it out")
    if channel is not None and recording.suffix.lower() == SUFFIX:
        common.fail(
            f"--channel is for logs of the bus, which may hold several; {SUFFIX} are of one"
        )
    part_s = common.chosen_part(from_s, until_s, "--until")
    said: list[str] = []
    with common.failing(OSError, ValueError):
        if kind in BUS_SUFFIXES:
            frames = _frames(recording, channel, part_s, said)
            if part_s != ALWAYS:
                frames = _some(to, frames)
            count, unit = write_frames(to, frames, said), "frames"
        elif recording.suffix.lower() == ".rrd" or signal_files.is_table(recording):
            if part_s != ALWAYS or channel is not None:
                common.fail("--channel, --from and --until are for logs: a table is exported whole")
            runs = signal_files.read_signals(recording, said.append)
            name = common.chosen_run(recording, runs, run)
            signal_files.require(recording, runs[name], "time_s")
            signal_files.write_signals(to, [runs[name]])
            count, unit = len(runs[name]["time_s"]), "rows"
        else:
            parts = signal_files.logged_parts(recording, said.append, channel, part_s)
            if part_s != ALWAYS:
                parts = _some(to, (part for part in parts if len(part["time_s"])))
            count, unit = signal_files.export_parts(to, parts), "rows"
    for text in said:
        say_note(text)
    if json_:
        common.print_json({"file": str(to), unit: count, "cut": "; ".join(said)})
    else:
        notes.say(f"{shown(to)}: {count} {unit}")


def _frames(
    recording: Path, channel: str | None, between_s: Between, said: list[str]
) -> Iterator[BusFrame]:
    suffix = recording.suffix.lower()
    if suffix == SUFFIX:
        entries = entries_of(FrameLog(recording).blocks(said.append))
        yield from frames_of(signal_files.part_of_entries(entries, between_s), said)
    elif suffix == ".rrd" or signal_files.is_table(recording):
        beside = [*recording.parent.glob(f"*{SUFFIX}")] if suffix == ".rrd" else []
        hint = " or ".join(sorted(map(str, beside))) or f"a {SUFFIX} file, as bench --frames writes"
        raise ValueError(f"{recording}: holds signals and no frames: give {hint}")
    else:
        yield from BusLog(recording, channel, between_s).frames(said)


def _some(to: Path, items: Iterator[_T]) -> Iterator[_T]:
    """Return the same items; ValueError without one."""
    first = next(items, None)
    if first is None:
        raise ValueError(f"{to} is not written: no record of the log is within these times")
    return chain([first], items)
