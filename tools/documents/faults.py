"""The fault tables of docs/safety.md, made from the rows of utank_hil/safety/faults.py."""

from collections.abc import Iterator
from dataclasses import asdict

from tools.documents.marked import DOCS, written_anew
from utank_hil.safety.faults import FAULTS, FaultRow
from utank_hil.safety.safety_limits import SafetyLimits

PAGE = DOCS / "safety.md"

CONDITIONS = "| fault | found by | reaction | keeps the controller in INIT |\n|---|---|---|---|\n"
WORDS = "\n| fault | what happened | what to do |\n|---|---|---|\n"


def conditions(row: FaultRow) -> Iterator[str]:
    """The lines of one row in the table of conditions, with the default limits."""
    name = f"{row.code.name} ({row.code})"
    for each in row.conditions:
        limit = each.limit.format(**asdict(SafetyLimits()))
        reaction = each.reaction.value.format(zero_within_ms=each.zero_within_ms)
        init = "" if each.awaited is None else "yes"
        yield f"| {name} | {limit} | {reaction} | {init} |\n"
        name = ""
    if row.law_limit:
        found = f"the law ended at its own limit of `{row.law_limit}`"
        yield f"| {name} | {found} | the law answers zero, alarm | |\n"


def page() -> str:
    """The page as it stands, with the tables written anew."""
    found = (line for row in FAULTS for line in conditions(row))
    words = (f"| {row.code.name} | {row.happened} | {row.remedy} |\n" for row in FAULTS)
    return written_anew(PAGE, (CONDITIONS, *found, WORDS, *words))
