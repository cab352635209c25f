"""Figure of a trade-off: roll reduction against margins, pressure and level."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from utank_hil.analysis.loop.margins import PEAK_SENSITIVITY
from utank_hil.analysis.loop.trade import Trade, TradePoint
from utank_hil.pictures.style import BELOW, COLORS, HIGHLIGHT, WIDEST_IN, picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

_ARMED, _REFUSED = COLORS[1], COLORS[2]


def draw_trade(
    trade: Trade,
    path: Path,
    title: str,
    pressure_limit_pa: float,
    level_limit_m: float,
    about: Mapping[str, Any] | None = None,
) -> Path:
    """Draw roll reduction over peak sensitivity, and the cost of each law that is stable.

    Filled dots meet every required margin, open ones miss one, and the star is the design itself.
    The limits are drawn as lines; RMS values are those of linear theory, without limits. Raises
    `ValueError` if no law is stable.
    """
    points = [point for point in trade.points if point.motion is not None]
    if not points:
        raise ValueError("no law of this trade is stable on its own ship: nothing to draw")
    with picture(path, title, (WIDEST_IN, 7.0), about) as figure:
        axes = figure.subplot_mosaic(
            [["trade", "radius"], ["trade", "pressure"], ["trade", "level"]], width_ratios=(1.45, 1)
        )
        _draw_trade(axes["trade"], points, trade)
        _draw_costs([axes[key] for key in ("radius", "pressure", "level")], points)
        _limit(axes["radius"], 1.0, "unstable above")
        _limit(axes["pressure"], pressure_limit_pa / 1e3, "pump's greatest pressure")
        _limit(axes["level"], level_limit_m, "level limit")
        axes["level"].set_xlabel(f"{trade.varied.capitalize()}, times that of the design")
    return path


def _draw_trade(axes: "Axes", points: list[TradePoint], trade: Trade) -> None:
    sensitivity = [point.robustness.nominal.peak_sensitivity for point in points]
    below = [point.roll_below_passive for point in points]
    reduction = [np.nan if share is None else 100 * share for share in below]
    axes.plot(sensitivity, reduction, color="#BBBBBB", linewidth=1.4, zorder=1)
    edge = max(*sensitivity, 1.1 * PEAK_SENSITIVITY)
    axes.set_xlim(0.97, edge + 0.1 * (edge - 1))
    axes.axvspan(PEAK_SENSITIVITY, 2 * edge, color=_REFUSED, alpha=0.07, linewidth=0)
    axes.axvline(PEAK_SENSITIVITY, color=_REFUSED, linewidth=0.9)
    marks = {}
    for point, x, y in sorted(
        zip(points, sensitivity, reduction, strict=True), key=lambda mark: mark[0].factor != 1
    ):
        text = "misses one: refused" if point.refused else "meets every required margin"
        if point.factor == 1:
            text = f"the design: {y:.0f} % less roll, peak sensitivity {x:.2f}"
        marks[text] = _mark(axes, x, y, point)
        if point.factor != 1 and math.log10(point.factor).is_integer():
            away: dict[str, Any] = {"xytext": (9, -6), "textcoords": "offset points"}
            axes.annotate(f"×{point.factor:g}", (x, y), va="center", color="#777777", **away)
    axes.figure.legend(marks.values(), marks.keys(), **BELOW)
    axes.set_ylim(min(0.0, *reduction) - 3, max(reduction) + 6)
    axes.set(xlabel="Peak sensitivity", ylabel="Roll RMS below the passive tank (%)")
    passive_deg = math.degrees(trade.passive.roll_rms_rad)
    text = f"Linear prediction, no limits; passive roll {passive_deg:.2f}° RMS"
    axes.set_title(text, loc="left", fontsize=10)


def _draw_costs(column: "list[Axes]", points: list[TradePoint]) -> None:
    factor = [point.factor for point in points]
    motions = [point.motion for point in points if point.motion is not None]
    radii = [point.robustness.worst_radius for point in points]
    costs = {
        "Largest eigenvalue over ships, gains, delays": radii,
        "Pressure RMS demanded (kPa)": [motion.pressure_rms_pa / 1e3 for motion in motions],
        "Tank level RMS (m)": [motion.level_rms_m for motion in motions],
    }
    for axis, (title, series) in zip(column, costs.items(), strict=True):
        axis.plot(factor, series, color="#BBBBBB", linewidth=1.4, zorder=1)
        for point, x, y in zip(points, factor, series, strict=True):
            _mark(axis, x, y, point)
        axis.margins(y=0.12)  # room for the star
        axis.set_xscale("log")
        axis.xaxis.set_major_formatter("{x:g}")
        axis.set_title(title, loc="left", fontsize=10)
        axis.tick_params(labelbottom=axis is column[-1])


def _mark(axes: "Axes", x: float, y: float, point: TradePoint) -> "Line2D":
    """Draw one law: a star for the design itself, an open dot if it is refused."""
    color = _REFUSED if point.refused else _ARMED
    face = "white" if point.refused else color
    sign, size, face, order = ("*", 19, HIGHLIGHT, 4) if point.factor == 1 else ("o", 6, face, 3)
    (mark,) = axes.plot(x, y, sign, c=color, markersize=size, markerfacecolor=face, zorder=order)
    return mark


def _limit(axes: "Axes", value: float, text: str) -> None:
    axes.axhline(value, color=_REFUSED, linewidth=0.9, linestyle="--", zorder=2)
    away: dict[str, Any] = {"xytext": (4, 3), "textcoords": "offset points", "fontsize": 9}
    axes.annotate(text, (0, value), xycoords=("axes fraction", "data"), color=_REFUSED, **away)
