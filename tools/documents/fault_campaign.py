"""The tables of docs/faults.md, made from configs/faults/campaign.yaml."""

from firmware_sim.fault_campaign.campaign import REACTIONS, Campaign
from tools.documents.marked import DOCS, written_anew
from utank_hil.configuration import load_config

PAGE = DOCS / "faults.md"
CAMPAIGN = DOCS.parent / "configs" / "faults" / "campaign.yaml"

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
    campaign = load_config(CAMPAIGN, Campaign)
    rows = [
        f"| `{row.id}` | {REACTIONS[row.reaction]} | "
        f"{'' if row.within_ms is None else f'{row.within_ms:g} '}| "
        f"{', '.join(f'`{name}` {value:g}' for name, value in row.counts_from.items())} |\n"
        for row in campaign.rows
    ]
    return written_anew(PAGE, (REQUIREMENTS, *requirements(campaign), ROWS, *rows))
