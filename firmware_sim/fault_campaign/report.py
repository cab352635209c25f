"""A campaign's results as JSON, as JUnit and as a table."""

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

from rich.table import Table
from rich.text import Text

from firmware_sim.fault_campaign.campaign import Campaign
from firmware_sim.fault_campaign.verdict import Result

_NOT_IN_XML: Final = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What a program printed may hold control characters, which XML 1.0 can't."""


def as_json(
    results: Sequence[Result],
    on_bus: Sequence[Mapping[str, Any]],
    not_run: Mapping[str, str],
    about: Mapping[str, Any],
) -> dict[str, Any]:
    """Everything, for `json.dumps`.

    Parameters
    ----------
    on_bus : sequence of mapping
        Live rows, as `run_live` gives them.
    not_run : mapping of str to str
        Rows that were not run, and why.
    about : mapping
        Where it comes from.
    """
    rows = [*(result.as_json() for result in results), *on_bus]
    return {
        "rows": rows,
        "not_run": [{"id": name, "why": why} for name, why in not_run.items()],
        "passed": sum(row["verdict"] == "pass" for row in rows),
        "failed": sum(row["verdict"] == "fail" for row in rows),
        "about": dict(about),
    }


def write_junit(
    path: Path,
    results: Sequence[Result],
    on_bus: Sequence[Mapping[str, Any]],
    not_run: Mapping[str, str],
    seconds: float,
) -> None:
    """Write one test case a row; those on a bus are as `run_live` tells of them.

    Raises
    ------
    OSError
        If the file can't be written.
    """
    suite = ElementTree.Element(
        "testsuite",
        name="faults",
        tests=str(len(results) + len(on_bus) + len(not_run)),
        failures=str(
            sum(not result.passed for result in results)
            + sum(told["verdict"] != "pass" for told in on_bus)
        ),
        skipped=str(len(not_run)),
        time=f"{seconds:.1f}",
    )
    told_of = [
        (each.row.id, each.passed, each.problems, f"{each.requirement}\n{each.wire}")
        for each in results
    ] + [
        (told["id"], told["verdict"] == "pass", told["problems"], told["requirement"])
        for told in on_bus
    ]
    for name, passed, problems, shows in told_of:
        case = ElementTree.SubElement(suite, "testcase", classname="faults", name=name)
        if not passed:
            said = [_NOT_IN_XML.sub("\N{REPLACEMENT CHARACTER}", each) for each in problems]
            failure = ElementTree.SubElement(case, "failure", message=next(iter(said), ""))
            failure.text = "\n".join(said)
        ElementTree.SubElement(case, "system-out").text = shows
    for name, why in not_run.items():
        case = ElementTree.SubElement(suite, "testcase", classname="faults", name=name)
        ElementTree.SubElement(case, "skipped", message=why)
    ElementTree.ElementTree(suite).write(path, encoding="utf-8", xml_declaration=True)


def milliseconds(value: float | None) -> str:
    """A time for a table; nothing where there is none."""
    return "" if value is None else f"{value:.0f}"


def table(results: Sequence[Result]) -> Table:
    """One line a row."""
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
        drawn.add_row(
            result.row.id,
            result.row.reaction,
            milliseconds(result.found_ms),
            milliseconds(result.row.within_ms),
            milliseconds(result.zero_ms),
            milliseconds(result.zero_limit_ms),
            "" if math.isnan(result.roll_ratio) else f"{result.roll_ratio:.2f}",
            " ".join(result.codes),
            Text("pass", "green") if result.passed else Text("fail", "red"),
        )
    return drawn


def requirement_text(campaign: Campaign, names: Sequence[str]) -> str:
    """What a row meets, in words."""
    texts = []
    for each in campaign.requirements:
        if each.id in names:
            parts = [each.fault, each.found_by, each.within, each.reaction]
            texts.append(f"{each.id}: " + "; ".join(part for part in parts if part))
    return " | ".join(texts)
