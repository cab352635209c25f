"""The figures of the source: a picture each, and one self-contained HTML page."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tools.thesis.figure import Curve, Figure, Panel, Verdict, greatest, printed_text
from tools.thesis.registry import Entry
from utank_hil.pictures.report_page import (
    ReportPicture,
    ReportSection,
    ReportTable,
    write_report_page,
)
from utank_hil.pictures.style import COLORS, HIGHLIGHT, WIDEST_IN, picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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


_STROKES: Final[tuple[dict[str, Any], ...]] = (
    {"color": COLORS[0], "linestyle": "-", "marker": "o"},
    {"color": COLORS[1], "linestyle": "-", "marker": "s"},
    {"color": COLORS[2], "linestyle": (0, (6, 2)), "marker": "^"},
    {"color": COLORS[6], "linestyle": (0, (4, 1.5, 1, 1.5)), "marker": "D"},
)
"""Told apart in grey too: by their strokes, and where all are whole, by their lightness."""
_COLORS: Final = 48
_LETTERS: Final = 22
"""Of the longest names of which a legend has two beside one another, in a half of a picture."""
_DENSE: Final = 6  # Swings of a curve from which on its panel has whole strokes.


def draw_figure(figure: Figure, path: Path, title: str) -> None:
    """Draw the panels of a figure; legends stand above their panels, never on the data."""
    columns = min(figure.columns, len(figure.panels))
    rows = math.ceil(len(figure.panels) / columns)
    size_in = (
        (WIDEST_IN / 2 * columns, 0.5 + 3.9 * rows) if columns > 1 else (8.0, 0.5 + 3.3 * rows)
    )
    with picture(path, title, size_in) as canvas:
        axes = canvas.subplots(rows, columns, squeeze=False).ravel()
        for axis, panel in zip(axes, figure.panels, strict=False):
            _draw_panel(axis, panel, halved=columns > 1)
        for axis in axes[len(figure.panels) :]:
            axis.set_visible(False)
    _shrink(path)


def _shrink(path: Path) -> None:
    """Keep no more colours than curves and their edges have: a third of the size."""
    from PIL import Image

    with Image.open(path) as whole:
        few = whole.convert("RGB").quantize(_COLORS, dither=Image.Dither.NONE)
    few.save(path, optimize=True)


def _draw_panel(axis: "Axes", panel: Panel, *, halved: bool) -> None:
    if panel.span is not None:
        axis.axvspan(*panel.span, color=HIGHLIGHT, alpha=0.35, linewidth=0, label=panel.span_label)
    dense = any(_dense(curve) for curve in panel.curves)
    for curve, stroke in zip(panel.curves, _STROKES, strict=False):
        _draw_curve(axis, curve, stroke, dense=dense)
    for log, set_scale, ticks in (
        (panel.log_x, axis.set_xscale, axis.xaxis),
        (panel.log_y, axis.set_yscale, axis.yaxis),
    ):
        if log:
            set_scale("log")
            ticks.set_major_formatter("{x:g}")
    if panel.y_limits is not None:
        axis.set_ylim(*panel.y_limits)
    axis.margins(x=0.02)
    axis.set_xlabel(panel.x_label)
    axis.set_ylabel(panel.y_label)
    if len(panel.curves) == 1 and not panel.title and panel.span is None:
        return  # the axis says it
    legend = axis.legend(
        loc="lower left",
        bbox_to_anchor=(-0.01, 1.0),
        borderaxespad=0.2,
        ncols=1 if halved and max(len(curve.label) for curve in panel.curves) > _LETTERS else 2,
        frameon=False,
        title=panel.title,
        alignment="left",
        fontsize=9,
        handlelength=2.6,
    )
    legend.get_title().set_fontweight("bold")


def _dense(curve: Curve) -> bool:
    """Whether a curve swings so often that broken strokes would hide it."""
    y = np.asarray(curve.y)
    swings = np.count_nonzero(np.diff(np.sign(y - y.mean()))) > 2 * _DENSE
    return bool(not curve.marks and swings and np.ptp(y) > 1e-9 * np.abs(y).max())


def _draw_curve(axis: "Axes", curve: Curve, stroke: dict[str, Any], *, dense: bool) -> None:
    if curve.marks:
        style = {"marker": stroke["marker"], "linestyle": "none", "markersize": 5}
    elif dense:
        style = {"linestyle": "-", "linewidth": 1.0}
    else:
        style = {"linestyle": stroke["linestyle"], "linewidth": 1.7}
    axis.plot(curve.x, curve.y, color=stroke["color"], label=curve.label, **style)
