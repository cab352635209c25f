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
            counts = (str(loop.ticks), f"{loop.overruns} / {loop.skipped}")
            table.add_row(
                name if what == "wake-up late" else "",
                what,
                *(f"{summary[key] / 1e3:.0f}" for key in ("p50_ns", "p99_ns", "p99_9_ns")),
                f"{summary['max_ns'] / 1e3:.0f}",
                *(counts if what == "wake-up late" else ("", "")),
            )
    return table
