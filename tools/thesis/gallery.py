"""The figures of the source on one self-contained HTML page."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from tools.thesis.figure import Figure, Verdict, greatest, printed_text
from tools.thesis.registry import Entry
from utank_hil.pictures.report_page import (
    ReportPicture,
    ReportSection,
    ReportTable,
    write_report_page,
)

_ABOUT: Final = (
    "Every figure and printed number of chapters 2 to 4 of Passive and active nonlinear control of "
    "ship roll motions using U-tube tanks (2006), made anew."
)
_SIGNS: Final = {Verdict.HOLDS: "✓", Verdict.PARTLY: "◐", Verdict.FAILS: "✗", Verdict.OPEN: "?"}


def write_gallery(
    entries: Sequence[Entry], figures: Mapping[str, Figure], folder: Path, path: Path
) -> None:
    """Write the page of some entries, with the figures made and their pictures `KEY.png`."""
    contents = [_contents_row(entry, figures.get(entry.key)) for entry in entries]
    headings = ("figure", "", "greatest deviation", "statements")
    sections = [ReportSection("Figures", tables=[ReportTable(headings, contents, text=True)])]
    sections += [
        _section(entry, figures[entry.key], folder) for entry in entries if entry.key in figures
    ]
    write_report_page(path, "The thesis shown again", _ABOUT, (), sections)


def _contents_row(entry: Entry, figure: Figure | None) -> tuple[str, ...]:
    if figure is None:
        return (entry.key, entry.title, f"{entry.word}: nothing to compute", "")
    verdicts = [check.verdict for check in figure.checks]
    counted = (f"{verdicts.count(each)} {each}" for each in Verdict if each in verdicts)
    return (entry.key, entry.title, greatest(figure.rows), ", ".join(counted))


def _section(entry: Entry, figure: Figure, folder: Path) -> ReportSection:
    pictures = []
    if figure.panels:
        shown = "; ".join(panel.title or entry.title for panel in figure.panels)
        pictures.append(ReportPicture((folder / f"{entry.key}.png").read_bytes(), shown))
    texts = [
        f"How ours was made: {figure.method}.",
        f"Left open by the source: {figure.open_points}",
    ]
    return ReportSection(entry.heading, texts, pictures, list(_tables(figure)))


def _tables(figure: Figure) -> Iterator[ReportTable]:
    if figure.table is not None:
        yield ReportTable(figure.table.headings, figure.table.rows, text=True)
    if figure.rows:
        rows = [
            (
                row.quantity,
                printed_text(row),
                "" if row.ours is None else f"{row.ours:.5g}",
                row.unit,
                "" if row.deviation is None else f"{row.deviation:+.2%}",
                row.reason,
            )
            for row in figure.rows
        ]
        headings = ("number", "printed", "ours", "", "deviation", "reason")
        yield ReportTable(headings, rows, text=True)
    if figure.checks:
        judged = [
            (check.statement, f"{_SIGNS[check.verdict]} {check.verdict}", check.measured)
            for check in figure.checks
        ]
        yield ReportTable(("the text says", "", "measured"), judged, text=True)
