"""``utank-hil export``: frames or signals of a recording for other programs."""

import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated

import typer

from utank_hil.console.common import Json, fail, print_json
from utank_hil.console.terminal import notes, say_cut, shown
from utank_hil.telemetry.bus_logs import BUS_SUFFIXES, read_bus_log, write_bus_log
from utank_hil.telemetry.frame_log import SUFFIX, FrameLog
from utank_hil.telemetry.replay import Entry, entries_of
from utank_hil.telemetry.signal_files import TABLE_SUFFIXES, read_signals, require, write_signals

_FORMATS = ", ".join((*BUS_SUFFIXES, *TABLE_SUFFIXES))


def export(
    recording: Annotated[
        Path,
        typer.Argument(
            help=f"Frame log ({SUFFIX}), recording (.rrd), log of the bus (.log, .asc, .blf) or "
            "table (.csv, .parquet)."
        ),
    ],
    to: Annotated[
        Path,
        typer.Option(
            metavar="FILE",
            help="Frames: .log (candump), .asc, .blf. Signals: .csv, .parquet. Overwritten.",
        ),
    ],
    run: Annotated[
        str | None, typer.Option(help="Run of a recording; without it the last one.")
    ] = None,
    json_: Json = False,
) -> None:
    """Write frames or signals of a recording in a format that other programs read.

    Signals have one row a tick, SI units, and the unit in each column's name.

    **Example:** utank-hil export out/gpc.frames --to gpc.blf
    """
    kind = to.suffix.lower()
    if kind not in (*BUS_SUFFIXES, *TABLE_SUFFIXES):
        fail(f"--to {to}: its suffix says the format, one of {_FORMATS}")
    if to.exists() and recording.exists() and os.path.samefile(recording, to):
        fail(f"--to {to} is what is read: name another file")
    if run is not None and recording.suffix.lower() != ".rrd":
        fail("--run is for recordings (.rrd), which hold several: leave it out")
    cuts: list[str] = []
    try:
        if kind in BUS_SUFFIXES:
            count, unit = write_bus_log(to, _entries(recording, cuts.append)), "frames"
        else:
            runs = read_signals(recording, cuts.append)
            name = list(runs)[-1] if run is None else run
            if name not in runs:
                fail(f"{recording} has no run {name!r}; it has {', '.join(runs)}")
            require(recording, runs[name], "time_s")
            write_signals(to, runs[name])
            count, unit = len(runs[name]["time_s"]), "rows"
    except (OSError, ValueError) as error:
        fail(error)
    for cut in cuts:
        say_cut(cut)
    if json_:
        print_json({"file": str(to), unit: count, "cut": "; ".join(cuts)})
    else:
        notes.say(f"{shown(to)}: {count} {unit}")


def _entries(recording: Path, note: Callable[[str], None]) -> Iterable[Entry]:
    """Return the frames of a recording; `note` is called with the place where a log is cut."""
    suffix = recording.suffix.lower()
    if suffix == SUFFIX:
        return entries_of(FrameLog(recording).blocks(note))
    if suffix in BUS_SUFFIXES:
        return read_bus_log(recording)
    beside = recording.with_suffix(SUFFIX)
    hint = f": give {beside}" if suffix == ".rrd" and beside.exists() else ""
    raise ValueError(f"{recording}: holds signals and no frames{hint}")
