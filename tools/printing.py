"""What tools print: one JSON object, or the same figures as tables."""

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from rich.table import Table

from utank_hil.console.common import print_json
from utank_hil.console.terminal import Terminal

WIDTH: Final = 160  # of what goes to a file
LISTED: Final = 12  # a cell with more values than these says how many there are

Row = Mapping[str, Any]


def command_line(text: str | None) -> argparse.ArgumentParser:
    """A parser that has `--json`; `text` is its help."""
    parser = argparse.ArgumentParser(
        description=text, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true", help="one JSON object instead of tables")
    return parser


def show(figures: Any, arguments: argparse.Namespace) -> None:
    """Print figures, as JSON with ``arguments.json``; a number that is not finite becomes null."""
    if arguments.json:
        print_json(figures)
        return
    console = Terminal() if sys.stdout.isatty() else Terminal(width=WIDTH)
    _show("", figures, console)


def _show(title: str, figures: Any, console: Terminal) -> None:
    """Single figures as lines, rows as one table, then what has parts of its own."""
    if not isinstance(figures, Mapping):
        console.table(_table(title, list(figures)))
        return
    rows = [{"": name, **each} for name, each in figures.items() if _is_row(each)]
    parts = {name: each for name, each in figures.items() if _has_rows(each) and not _is_row(each)}
    single = [name for name, each in figures.items() if not _has_rows(each)]
    if title and single and not rows:
        console.print(title, style="italic")
    for name in single:
        console.say(f"{name}: {_cell(figures[name])}")
    if rows:
        console.table(_table(title, rows))
    for name, each in parts.items():
        _show(f"{title}, {name}" if title else str(name), each, console)


def _is_row(value: Any) -> bool:
    return (
        isinstance(value, Mapping)
        and bool(value)
        and not any(isinstance(each, Mapping) for each in value.values())
    )


def _has_rows(value: Any) -> bool:
    rows = isinstance(value, list) and all(isinstance(each, Mapping) for each in value)
    return bool(value) and (rows or isinstance(value, Mapping))


def _table(title: str, rows: Sequence[Row]) -> Table:
    flat = [dict(_flat(row)) for row in rows]
    columns = list(dict.fromkeys(name for row in flat for name in row))
    table = Table(title=title, title_justify="left")
    for name in columns:
        table.add_column(name, justify="right" if name else "left")
    for row in flat:
        table.add_row(*(_cell(row.get(name)) for name in columns))
    return table


def _flat(row: Row) -> Iterator[tuple[str, Any]]:
    for name, value in row.items():
        if isinstance(value, Mapping):
            yield from ((f"{name} {inner}", each) for inner, each in _flat(value))
        else:
            yield str(name), value


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, list | tuple):
        short = len(value) <= LISTED and not any(isinstance(each, Mapping) for each in value)
        return ", ".join(map(_cell, value)) if short else f"{len(value)} values"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
