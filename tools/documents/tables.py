"""Tables that the code gives: of a page only what is between its two marks is generated."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Final

from utank_hil.commands.outward.registers import FIRST_ALARM, REGISTERS
from utank_hil.console.exit_codes import ExitCode
from utank_hil.safety.faults import FAULTS, FaultRow
from utank_hil.safety.safety_limits import SafetyLimits

DOCS: Final = Path(__file__).resolve().parents[2] / "docs"
PLACE: Final = re.compile(
    r"(?<=; do not edit down to the end mark\. -->\n).*?(?=<!-- End of the generated table)", re.S
)


def written_anew(page: Path, lines: Iterable[str]) -> str:
    """The page as it stands, with these lines between its marks.

    Raises `ValueError` if the page does not have the marks once.
    """
    text, places = PLACE.subn(lambda _: "".join(lines), page.read_text(encoding="utf-8"))
    if places != 1:
        raise ValueError(
            f"{page}: generated tables must stand between their marks: {PLACE.pattern}"
        )
    return text


def exit_codes() -> Iterator[str]:
    """The table of docs/deployment.md."""
    yield "| code | name | commands | meaning |\n|---|---|---|---|\n"
    for code in ExitCode:
        yield f"| {code:d} | {code.name} | {code.commands} | {code.meaning} |\n"


def registers() -> Iterator[str]:
    """The table of docs/how-to/outward.md."""
    yield "| register | holds |\n|---|---|\n"
    for at, meaning in enumerate(REGISTERS):
        yield f"| {at} | {meaning} |\n"
    yield (
        f"| {FIRST_ALARM} + code | alarm of the fault with this code ([safety.md](../safety.md)): "
        "0 not in the list, 1 active, 2 active and acknowledged, 3 cause gone, not acknowledged |\n"
    )


def faults() -> Iterator[str]:
    """The tables of docs/safety.md."""
    yield "| fault | found by | reaction | keeps the controller in INIT |\n|---|---|---|---|\n"
    for row in FAULTS:
        yield from _conditions(row)
    yield "\n| fault | what happened | what to do |\n|---|---|---|\n"
    for row in FAULTS:
        yield f"| {row.code.name} | {row.happened} | {row.remedy} |\n"


def _conditions(row: FaultRow) -> Iterator[str]:
    """The lines of one row in the table of conditions, with the default limits."""
    name = f"{row.code.name} ({row.code})"
    for each in row.conditions:
        limit = each.limit.format(**asdict(SafetyLimits()))
        reaction = each.reaction.value.format(zero_within_ms=each.zero_within_ms)
        init = "" if each.awaited is None else "yes"
        yield f"| {name} | {limit} | {reaction} | {init} |\n"
        name = ""
