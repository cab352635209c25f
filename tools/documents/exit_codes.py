"""The table of docs/deployment.md, made from utank_hil/console/exit_codes.py."""

from tools.documents.marked import DOCS, written_anew
from utank_hil.console.exit_codes import ExitCode

PAGE = DOCS / "deployment.md"

TABLE = "| code | name | commands | meaning |\n|---|---|---|---|\n"


def page() -> str:
    """The page as it stands, with the table written anew."""
    rows = (f"| {code:d} | {code.name} | {code.commands} | {code.meaning} |\n" for code in ExitCode)
    return written_anew(PAGE, (TABLE, *rows))
