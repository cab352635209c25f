"""The source thesis made anew, figure by figure: ``python -m tools.thesis``."""

import json
import time
from pathlib import Path
from typing import Annotated, Final

import typer
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from tools.thesis.figure import Figure, Verdict, as_json, greatest
from tools.thesis.registry import ENTRIES, Entry, UnknownFigureError, chosen
from utank_hil.base.whole_file import write_whole
from utank_hil.console.common import OUT, Json, fail, new_app, prepare_out, print_json
from utank_hil.console.terminal import Terminal, new_table, notes

PAGE: Final = "gallery.html"
NUMBERS: Final = "figures.json"


def reproduce(
    figures: Annotated[
        list[str] | None,
        typer.Argument(help="Numbers of figures, or names of groups; all of them without any."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for pictures and page.")] = OUT / "thesis",
    list_: Annotated[bool, typer.Option("--list", help="Show what there is and end.")] = False,
    json_: Json = False,
) -> None:
    """Make figures and printed numbers of the source thesis anew, and judge what its text says.

    Printed numbers stand beside ours with the deviation and its reason. All of it is on one page,
    gallery.html, which needs nothing else. All figures take some minutes.

    **Example:** python -m tools.thesis 2.7 3.9 4.12 --out out/thesis
    """
    try:
        entries = chosen(figures or [])
    except UnknownFigureError as error:
        fail(error)
    if list_:
        _list(entries, json_)
        return
    made_here = [entry for entry in entries if entry.make is not None]
    prepare_out(out, (PAGE, NUMBERS, *(f"{entry.key}.png" for entry in made_here)))
    made, seconds = _make(made_here, out)
    from tools.thesis.gallery import write_gallery

    files = {"page": out / PAGE, "numbers": out / NUMBERS}
    write_gallery(entries, made, out, files["page"])
    result = {
        "figures": [
            entry.as_json() | (as_json(made[entry.key]) if entry.key in made else {})
            for entry in entries
        ]
    }
    write_whole(files["numbers"], json.dumps(result, indent=1) + "\n")
    if json_:
        print_json(result)
        return
    console = Terminal()
    console.table(_summary(entries, made, seconds))
    console.files(files)


def _make(entries: list[Entry], out: Path) -> tuple[dict[str, Figure], dict[str, float]]:
    """Make and draw each figure; how long each took."""
    from tools.thesis.gallery import draw_figure

    made: dict[str, Figure] = {}
    seconds: dict[str, float] = {}
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:g} of {task.total:g}"),
        TimeElapsedColumn(),
        console=notes,
        disable=not notes.is_terminal,
    ) as bar:
        task = bar.add_task("", total=len(entries))
        for entry in entries:
            assert entry.make is not None
            bar.update(task, description=f"{entry.key} {entry.title}")
            begin = time.monotonic()
            figure = entry.make()
            if figure.panels:
                draw_figure(figure, out / f"{entry.key}.png", entry.heading)
            made[entry.key] = figure
            seconds[entry.key] = time.monotonic() - begin
            bar.advance(task)
    return made, seconds


def _list(entries: tuple[Entry, ...], as_object: bool) -> None:
    """Print keys and titles."""
    if as_object:
        listed = [entry.as_json() for entry in entries]
        print_json({"figures": listed})
        return
    console = Terminal()
    for entry in entries:
        word = f" ({entry.word}: nothing to compute)" if entry.word else ""
        console.say(f"{entry.key:>12}  {entry.title}{word}")


def _summary(
    entries: tuple[Entry, ...], made: dict[str, Figure], seconds: dict[str, float]
) -> Table:
    """One line a figure."""
    table = new_table(
        f"{len(made)} of {len(ENTRIES)} figures and groups of numbers",
        *("greatest\ndeviation", "holds", "in part", "does\nnot", "s"),
        names=("", "figure"),
    )
    for entry in entries:
        figure = made.get(entry.key)
        if figure is None:
            table.add_row(entry.key, f"{entry.title} ({entry.word})", "", "", "", "", "")
            continue
        verdicts = [check.verdict for check in figure.checks]
        table.add_row(
            entry.key,
            entry.title,
            greatest(figure.rows),
            *(
                str(verdicts.count(verdict) or "")
                for verdict in (Verdict.HOLDS, Verdict.PARTLY, Verdict.FAILS)
            ),
            f"{seconds[entry.key]:.0f}",
        )
    return table


if __name__ == "__main__":
    app = new_app()
    app.command()(reproduce)
    app()
