"""The table of docs/exit-codes.md, made from utank_hil/commands/exit_codes.py."""

from pathlib import Path

from utank_hil.commands.exit_codes import ExitCode

PAGE = Path(__file__).resolve().parents[2] / "docs" / "exit-codes.md"

BEGIN = (
    "<!-- Written by tools/documents/exit_codes.py (make docs) from "
    "utank_hil/commands/exit_codes.py; do not edit down to the end mark. -->\n"
)
END = "<!-- End of the generated table. -->\n"
TABLE = "| code | name | commands | meaning |\n|---|---|---|---|\n"


def page() -> str:
    """The page as it stands, with the table written anew."""
    before, begin, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{PAGE}: the table must stand between the lines\n{BEGIN}{END}")
    rows = (f"| {code:d} | {code.name} | {code.commands} | {code.meaning} |\n" for code in ExitCode)
    return "".join([before + BEGIN + TABLE, *rows, END + after])
