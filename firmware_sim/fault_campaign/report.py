"""Results of a campaign as JSON, as a table and as recordings."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

from firmware_sim.fault_campaign.trial import COLUMNS, Outcome
from firmware_sim.fault_campaign.verdict import Result


def as_json(
    results: Sequence[Result], not_run: Mapping[str, str], about: Mapping[str, Any]
) -> dict[str, Any]:
    """Return all results, and the reasons of rows that were not run, for `json.dumps`."""
    return {
        "rows": [result.as_json() for result in results],
        "not_run": [{"id": name, "why": why} for name, why in not_run.items()],
        "passed": sum(result.passed for result in results),
        "failed": sum(not result.passed for result in results),
        "about": dict(about),
    }


def table(results: Sequence[Result]) -> Table:
    """Table with one line per row."""
    drawn = Table(title="Faults")
    for heading in ("row", "reaction"):
        drawn.add_column(heading, no_wrap=True)
    for heading in ("found\nms", "limit\nms", "zero\nms", "limit\nms", "roll\nvariance"):
        drawn.add_column(heading, justify="right", no_wrap=True)
    drawn.add_column("called")
    drawn.add_column("", no_wrap=True)
    drawn.caption = (
        "worst of the seeds; times after the fault; zero: of the drive's set-point, or the end of "
        "the valve's following; variance of the roll over that of the passive ship, at most 1.05"
    )
    for result in results:
        limit_ms = result.row.limit.found_ms
        times_ms = (result.found_ms, limit_ms, result.zero_ms, result.zero_limit_ms)
        drawn.add_row(
            result.row.id,
            result.row.expect.reaction,
            *("" if time_ms is None else f"{time_ms:.0f}" for time_ms in times_ms),
            "" if math.isnan(result.roll_ratio) else f"{result.roll_ratio:.2f}",
            " ".join(result.codes),
            Text("pass", "green") if result.passed else Text("fail", "red"),
        )
    return drawn


def write_recordings(
    folder: Path, outcomes: Mapping[str, Sequence[Outcome]], about: Mapping[str, Any]
) -> dict[str, Path]:
    """Write the recordings of the rows that have one; return the files by row."""
    from utank_hil.telemetry.recording import write_recording

    files = {}
    for name, each in outcomes.items():
        kept = {f"seed {one.seed}": one.rows for one in each if one.rows is not None}
        if kept:
            files[name] = folder / f"{name}.rrd"
            write_recording(files[name], COLUMNS, kept, about=about)
    return files
