"""The tables of docs/faults.md, made from configs/faults/campaign.yaml."""

from pathlib import Path

from firmware_sim.fault_campaign.campaign import REACTIONS, Campaign
from utank_hil.configuration import load_config

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "faults.md"
CAMPAIGN = ROOT / "configs" / "faults" / "campaign.yaml"

BEGIN = (
    "<!-- Written by tools/documents/fault_campaign.py (make docs) from "
    "configs/faults/campaign.yaml; do not edit down to the end mark. -->\n"
)
END = "<!-- End of the generated tables. -->\n"
REQUIREMENTS = (
    "| requirement | fault | found by | within | reaction | shown by |\n|---|---|---|---|---|---|\n"
)
ROWS = (
    "\n| row | reaction asked for | found within, ms | counted from a difference of |\n"
    "|---|---|---|---|\n"
)


def requirements(campaign: Campaign) -> list[str]:
    """A line a requirement."""
    lines = []
    for each in campaign.requirements:
        rows = [row.id for row in campaign.rows if each.id in row.meets]
        rows += [row.id for row in campaign.live if each.id in row.meets]
        shown = ", ".join([*(f"`{name}`" for name in rows), *filter(None, [each.elsewhere])])
        cells = (each.id, each.fault, each.found_by, each.within, each.reaction, shown)
        lines.append("|" + "|".join(f" {cell} " if cell else " " for cell in cells) + "|\n")
    return lines


def page() -> str:
    """The page as it stands, with the tables written anew."""
    before, begin, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{PAGE}: the tables must stand between the lines\n{BEGIN}{END}")
    campaign = load_config(CAMPAIGN, Campaign)
    rows = [
        f"| `{row.id}` | {REACTIONS[row.reaction]} | "
        f"{'' if row.within_ms is None else f'{row.within_ms:g} '}| "
        f"{', '.join(f'`{name}` {value:g}' for name, value in row.counts_from.items())} |\n"
        for row in campaign.rows
    ]
    return "".join(
        [before + BEGIN + REQUIREMENTS, *requirements(campaign), ROWS, *rows, END, after]
    )
