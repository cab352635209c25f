"""The documents' tables that are made from docs/evidence.

Such a table stands between `<!-- table: NAME -->` and `<!-- end of table -->`, and below it the
command and date of its numbers.
"""

import re
from collections.abc import Iterator
from pathlib import Path

from tools.documents import law_tables, safety_tables, sea_tables, thesis_tables
from tools.evidence.parts import PARTS, Part
from tools.evidence.record import Record, read

DOCS = Path(__file__).resolve().parents[2] / "docs"
PLACE = re.compile(r"(<!-- table: (.*?) -->\n)(.*?)(<!-- end of table -->)", re.S)
TABLES = law_tables.TABLES | sea_tables.TABLES | safety_tables.TABLES | thesis_tables.TABLES


class TableError(Exception):
    """A table that can't be made."""


def source(part: Part, kept: Record) -> str:
    """Where the numbers are from."""
    data = f"evidence/{kept['part']}.json"
    command = kept["command"].removesuffix(" --json")
    before = "" if kept["command"] == part.command else f" as it was at {kept['commit']}"
    return f"`{command}`{before}, {kept['date']}; machine, versions and commit: [{data}]({data})."


def table(name: str) -> str:
    """A table and its source as Markdown.

    Raises
    ------
    TableError
        If there is no such table, or no result that it can be made from.
    """
    if name not in TABLES:
        raise TableError(f"no table {name!r}: there are {', '.join(TABLES)}")
    part_name, rows_of = TABLES[name]
    part = next(part for part in PARTS if part.name == part_name)
    kept = read(part)
    if kept is None:
        raise TableError(f"run `python -m tools.evidence --part {part_name}` first")
    heading, *rows = (
        "|".join(f" {cell} " if cell else " " for cell in row) for row in rows_of(kept["result"])
    )
    lines = [heading, "|".join(["---"] * (heading.count("|") + 1)), *rows]
    drawn = "\n".join(f"|{line}|" for line in lines)
    return f"{drawn}\n\n{source(part, kept)}\n"


def pages() -> Iterator[tuple[Path, str]]:
    """Each document that has such tables, with the tables made anew.

    Raises
    ------
    TableError
        With the document, as `table`.
    """
    for document in sorted(DOCS.rglob("*.md")):
        text = document.read_text(encoding="utf-8")
        if not PLACE.search(text):
            continue
        try:
            yield document, PLACE.sub(lambda found: found[1] + table(found[2]) + found[4], text)
        except TableError as error:
            raise TableError(f"{document}: {error}") from error
