"""Run the parts of the evidence whose results are missing or not of the code as it is.

    python -m tools.evidence                        # what `make evidence` does; hours at first
    python -m tools.evidence --list
    python -m tools.evidence --part linear_law_tables --force

Each result is one file of docs/evidence, written when its part is done: after Ctrl-C the same
command goes on where it was. `make docs` then makes the documents' tables from the results.
"""

import argparse
import sys

from rich.console import Console
from rich.table import Table

from tools.evidence.parts import PARTS, Part
from tools.evidence.record import PartError, read, run, state

TABLE_WIDTH = 140


def listed() -> Table:
    """Every part with its state."""
    table = Table()
    for heading in ("part", "state", "date", "minutes", "shows"):
        table.add_column(heading, no_wrap=True)
    for part in PARTS:
        kept = read(part)
        minutes = part.minutes if kept is None else kept["seconds"] / 60
        date = "" if kept is None else kept["date"]
        about = f"about {minutes:g}" if kept is None else f"{minutes:.1f}"
        table.add_row(part.name, state(part), date, about, part.shows)
    return table


def run_all(parts: list[Part], console: Console) -> list[Part]:
    """Run parts one after the other; those that failed."""
    failed = []
    for number, part in enumerate(parts, 1):
        console.print(f"{number}/{len(parts)} {part.name}, about {part.minutes:g} min")
        console.print(f"  {part.command}", style="dim", markup=False, soft_wrap=True)
        try:
            made = run(part)
        except PartError as error:
            console.print(f"  no result: {error}", markup=False, soft_wrap=True)
            failed.append(part)
        else:
            console.print(f"  {made['seconds']:.0f} s")
    return failed


def main() -> int:
    """Run or list what was asked for."""
    parser = argparse.ArgumentParser(
        prog="python -m tools.evidence",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--list", action="store_true", help="run nothing; print every part's state")
    parser.add_argument(
        "--part", action="append", choices=[part.name for part in PARTS], metavar="NAME",
        help="only this part; may be given again",
    )  # fmt: skip
    parser.add_argument("--force", action="store_true", help="run those that are current, too")
    arguments = parser.parse_args()
    console = Console() if sys.stdout.isatty() else Console(width=TABLE_WIDTH)
    if arguments.list:
        console.print(listed())
        return 0
    wanted = [part for part in PARTS if not arguments.part or part.name in arguments.part]
    waiting = [part for part in wanted if arguments.force or state(part) != "current"]
    console.print(
        f"{len(waiting)} of {len(wanted)} parts to run, "
        f"about {sum(part.minutes for part in waiting):g} min"
    )
    try:
        failed = run_all(waiting, console)
    except KeyboardInterrupt:
        console.print("interrupted: the same command goes on from here")
        return 130
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
