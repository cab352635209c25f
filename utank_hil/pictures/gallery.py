"""The figures of the source on one self-contained HTML page."""

import base64
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Final

from utank_hil.thesis.figure import Check, Figure, Row, Verdict, printed_text
from utank_hil.thesis.registry import Entry

_STYLE: Final = """
body{font:16px/1.5 system-ui,sans-serif;color:#222;max-width:1100px;margin:0 auto;padding:1rem}
h2{margin-top:3rem;border-top:1px solid #ccc;padding-top:1rem}
img{max-width:100%;height:auto}
.wide{overflow-x:auto}
table{border-collapse:collapse;margin:.7rem 0;font-size:.9rem}
td,th{border-bottom:1px solid #ddd;padding:.25rem .6rem;text-align:left;vertical-align:top}
td.n{text-align:right;white-space:nowrap}
.word{font-weight:600;white-space:nowrap}
.open{color:#555}
@media print{h2{break-before:page}body{max-width:none}}
"""
_SIGNS: Final = {
    Verdict.HOLDS: "✓",
    Verdict.PARTLY: "◐",
    Verdict.FAILS: "✗",
    Verdict.OPEN: "?",
}


def write_gallery(
    entries: Sequence[Entry], figures: Mapping[str, Figure], folder: Path, path: Path
) -> Path:
    """Write the page.

    Parameters
    ----------
    entries : sequence of Entry
        What the page holds, sketches included.
    figures : mapping of str to Figure
        Made figures by key.
    folder : Path
        Where their pictures are, as `KEY.png`.
    path : Path
        The `.html` file; overwritten.

    Returns
    -------
    Path
        `path`.
    """
    path.write_text("".join(_page(entries, figures, folder)), encoding="utf-8")
    return path


def _page(entries: Sequence[Entry], figures: Mapping[str, Figure], folder: Path) -> Iterator[str]:
    yield '<!doctype html><html lang="en"><head><meta charset="utf-8">'
    yield '<meta name="viewport" content="width=device-width,initial-scale=1">'
    yield f"<title>The thesis shown again</title><style>{_STYLE}</style></head><body>"
    yield "<h1>The thesis shown again</h1>"
    yield (
        "<p>Every figure and printed number of chapters 2 to 4 of <i>Passive and active nonlinear "
        "control of ship roll motions using U-tube tanks</i> (2006), made anew.</p>"
    )
    yield '<div class="wide"><table><tr><th>figure</th><th></th><th>greatest deviation</th>'
    yield "<th>statements</th></tr>"
    for entry in entries:
        yield _contents_row(entry, figures.get(entry.key))
    yield "</table></div>"
    for entry in entries:
        if entry.key in figures:
            yield from _section(figures[entry.key], folder)
    yield "</body></html>\n"


def _contents_row(entry: Entry, figure: Figure | None) -> str:
    if figure is None:
        cells = f"<td>{escape(entry.word)}: nothing to compute</td><td></td>"
        return f"<tr><td>{entry.key}</td><td>{escape(entry.title)}</td>{cells}</tr>"
    verdicts = [check.verdict for check in figure.checks]
    counted = ", ".join(
        f"{verdicts.count(verdict)} {verdict.value}" for verdict in Verdict if verdict in verdicts
    )
    return (
        f'<tr><td><a href="#f{entry.key}">{entry.key}</a></td><td>{escape(entry.title)}</td>'
        f'<td class="n">{_greatest(figure.rows)}</td><td>{escape(counted)}</td></tr>'
    )


def _greatest(rows: Sequence[Row]) -> str:
    known = [row.deviation for row in rows if row.deviation is not None]
    return f"{max(known, key=abs):+.2%}" if known else ""


def _section(figure: Figure, folder: Path) -> Iterator[str]:
    yield f'<h2 id="f{figure.key}">{figure.key} {escape(figure.title)}</h2>'
    if figure.panels:
        data = base64.b64encode((folder / f"{figure.key}.png").read_bytes()).decode()
        told = "; ".join(panel.title or figure.title for panel in figure.panels)
        yield f'<img alt="{escape(told)}" src="data:image/png;base64,{data}">'
    yield f"<p><b>How ours was made:</b> {escape(figure.method)}.</p>"
    yield f'<p class="open"><b>Left open by the source:</b> {escape(figure.open_points)}</p>'
    if figure.table is not None:
        yield '<div class="wide"><table>'
        yield _cells("th", figure.table.headings)
        yield from (_cells("td", row) for row in figure.table.rows)
        yield "</table></div>"
    if figure.rows:
        yield '<div class="wide"><table><tr><th>number</th><th>printed</th><th>ours</th><th></th>'
        yield "<th>deviation</th><th>reason</th></tr>"
        yield from map(_number_row, figure.rows)
        yield "</table></div>"
    if figure.checks:
        yield '<div class="wide"><table><tr><th>the text says</th><th></th><th>measured</th></tr>'
        yield from map(_check_row, figure.checks)
        yield "</table></div>"


def _cells(tag: str, cells: Sequence[str]) -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"


def _number_row(row: Row) -> str:
    ours = "" if row.ours is None else f"{row.ours:.5g}"
    deviation = "" if row.deviation is None else f"{row.deviation:+.2%}"
    return (
        f'<tr><td>{escape(row.quantity)}</td><td class="n">{printed_text(row)}</td>'
        f'<td class="n">{ours}</td><td>{escape(row.unit)}</td><td class="n">{deviation}</td>'
        f"<td>{escape(row.reason)}</td></tr>"
    )


def _check_row(check: Check) -> str:
    return (
        f'<tr><td>{escape(check.statement)}</td><td class="word">{_SIGNS[check.verdict]} '
        f"{escape(check.verdict.value)}</td><td>{escape(check.measured)}</td></tr>"
    )
