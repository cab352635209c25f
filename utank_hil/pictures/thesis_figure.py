"""Figure of the source thesis, made anew."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from utank_hil.pictures.style import COLORS, HIGHLIGHT, picture
from utank_hil.thesis.figure import Curve, Figure, Panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STROKES: Final[tuple[dict[str, Any], ...]] = (
    {"color": COLORS[0], "linestyle": "-", "marker": "o"},
    {"color": COLORS[1], "linestyle": "-", "marker": "s"},
    {"color": COLORS[2], "linestyle": (0, (6, 2)), "marker": "^"},
    {"color": COLORS[3], "linestyle": (0, (4, 1.5, 1, 1.5)), "marker": "D"},
)
"""Told apart in grey too: by their strokes."""
_DENSE: Final = 6
"""Turns of a curve from which on its strokes are not broken."""


def draw_figure(figure: Figure, path: Path) -> Path:
    """Draw the panels of a figure; legends stand above their panels, never on the data.

    Parameters
    ----------
    figure : Figure
        With one panel or more.
    path : Path
        The `.png` file; overwritten.

    Returns
    -------
    Path
        `path`.
    """
    columns = min(figure.columns, len(figure.panels))
    rows = math.ceil(len(figure.panels) / columns)
    size_in = (5.8 * columns, 0.5 + 3.9 * rows) if columns > 1 else (8.0, 0.5 + 3.3 * rows)
    with picture(path, f"{figure.key}  {figure.title}", size_in) as canvas:
        axes = canvas.subplots(rows, columns, squeeze=False).ravel()
        for axis, panel in zip(axes, figure.panels, strict=False):
            _draw_panel(axis, panel)
        for axis in axes[len(figure.panels) :]:
            axis.set_visible(False)
    return path


def _draw_panel(axis: "Axes", panel: Panel) -> None:
    if panel.span is not None:
        axis.axvspan(*panel.span, color=HIGHLIGHT, alpha=0.35, linewidth=0, label=panel.span_label)
    for curve, stroke in zip(panel.curves, _STROKES, strict=False):
        _draw_curve(axis, curve, stroke)
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
    legend = axis.legend(
        loc="lower left",
        bbox_to_anchor=(-0.01, 1.0),
        borderaxespad=0.2,
        ncols=2,
        frameon=False,
        title=panel.title,
        alignment="left",
        fontsize=9,
        handlelength=2.6,
    )
    legend.get_title().set_fontweight("bold")


def _draw_curve(axis: "Axes", curve: Curve, stroke: dict[str, Any]) -> None:
    x, y = np.asarray(curve.x), np.asarray(curve.y)
    if curve.marks:
        axis.plot(x, y, color=stroke["color"], marker=stroke["marker"], linestyle="none",
                  markersize=5, label=curve.label)  # fmt: skip
        return
    dense = np.count_nonzero(np.diff(np.sign(y - y.mean()))) > 2 * _DENSE and np.ptp(y) > 0
    axis.plot(
        x,
        y,
        color=stroke["color"],
        linestyle="-" if dense else stroke["linestyle"],
        linewidth=0.9 if dense else 1.7,
        label=curve.label,
    )
