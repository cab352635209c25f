"""Tables on terminals of any width."""

from collections.abc import Iterable
from typing import Final

from rich.console import Console
from rich.markup import escape
from rich.measure import Measurement
from rich.table import Table

UNLIMITED: Final = 10_000


def new_table(
    title: str | None, *figures: str, names: Iterable[str] = ("",), caption: str | None = None
) -> Table:
    """A table without rows: columns of names to the left, of figures to the right.

    Title and caption are plain text; cells may have Rich's markup.
    """
    title, caption = (None if text is None else escape(text) for text in (title, caption))
    table = Table(title=title, caption=caption)
    for heading in names:
        table.add_column(heading, no_wrap=True)
    for heading in figures:
        table.add_column(heading, justify="right", no_wrap=True)
    return table


def print_table(console: Console, table: Table) -> None:
    """Print a table, or the same as a list where the terminal is too narrow for it.

    Nothing is cut: each row becomes its name with one line a figure.
    """
    unlimited = console.options.update(max_width=UNLIMITED)  # else the answer is what there is
    if Measurement.get(console, unlimited, table).maximum <= console.width:
        console.print(table)
        return
    if table.title:
        console.print(table.title, style="italic")
    headings = [" ".join(str(column.header).split()) for column in table.columns]
    wide = max(len(heading) for heading in headings)
    for cells in zip(*(column.cells for column in table.columns), strict=True):
        name, *figures = cells
        console.print(name, style="bold")
        for heading, figure in zip(headings[1:], figures, strict=True):
            if figure != "":
                console.print(f"  {heading:{wide}}  {figure}")
    if table.caption:
        console.print(table.caption, style="dim")
    console.print()
