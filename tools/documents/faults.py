"""The fault tables of docs/safety.md, made from the rows of utank_hil/runtime/faults.py."""

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from utank_hil.runtime.faults import FAULTS, FaultRow
from utank_hil.runtime.safety_limits import SafetyLimits

PAGE = Path(__file__).resolve().parents[2] / "docs" / "safety.md"

BEGIN = (
    "<!-- Written by tools/documents/faults.py (make docs) from utank_hil/runtime/faults.py; "
    "do not edit down to the end mark. -->\n"
)
END = "<!-- End of the generated tables. -->\n"

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
    before, begin, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{PAGE}: the tables must stand between the lines\n{BEGIN}{END}")
    return "".join(
        [
            before + BEGIN + CONDITIONS,
            *(line for row in FAULTS for line in conditions(row)),
            WORDS,
            *(f"| {row.code.name} | {row.happened} | {row.remedy} |\n" for row in FAULTS),
            END + after,
        ]
    )
