"""The table of docs/how-to/outward.md, from utank_hil/commands/outward/registers.py."""

from tools.documents.marked import DOCS, written_anew
from utank_hil.commands.outward.registers import FIRST_ALARM, REGISTERS

PAGE = DOCS / "how-to" / "outward.md"

TABLE = "| register | holds |\n|---|---|\n"
ALARMS = (
    f"| {FIRST_ALARM} + code | alarm of the fault with this code ([safety.md](../safety.md)): "
    "0 not in the list, 1 active, 2 active and acknowledged, 3 cause gone, not acknowledged |\n"
)


def page() -> str:
    """The page as it stands, with the table written anew."""
    rows = (f"| {at} | {each.meaning} |\n" for at, each in enumerate(REGISTERS))
    return written_anew(PAGE, (TABLE, *rows, ALARMS))
