"""The table of how real-time loops kept their time."""

from rich.table import Table

from utank_hil.console.terminal import new_table
from utank_hil.runners import LoopStatistics


def timing_table(loops: dict[str, LoopStatistics]) -> Table:
    """Table of how real-time loops kept their time, in microseconds."""
    figures = ("p50", "p99", "p99.9", "max", "ticks", "overruns\nskipped")
    table = new_table("Deadlines, µs", *figures, names=("", ""))
    for name, loop in loops.items():
        for what, histogram in (("wake-up late", loop.lateness), ("tick lasts", loop.duration)):
            summary = histogram.summary()
            times = [summary[key] / 1e3 for key in ("p50_ns", "p99_ns", "p99_9_ns", "max_ns")]
            counts = (str(loop.ticks), f"{loop.overruns} / {loop.skipped}")
            first = what == "wake-up late"
            cells = [f"{time_us:.0f}" for time_us in times]
            table.add_row(name if first else "", what, *cells, *(counts if first else ("", "")))
    return table
