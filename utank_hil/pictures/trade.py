"""Figure of a trade-off: roll reduction against margins, pressure and level."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from utank_hil.analysis.loop.robustness import PEAK_SENSITIVITY
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
    """Draw roll reduction over peak sensitivity, and the cost of each law.

    Filled dots meet every required margin, open ones miss one, and the star is the design itself.
    Laws that are unstable on their own ship are left out. `pressure_limit_pa` and `level_limit_m`
    are drawn as lines; the RMS values are those of linear theory, without limits. Raises
    `ValueError` if no law is stable.
    """
    points = [point for point in trade.points if point.motion is not None]
    if not points:
        raise ValueError("no law of this trade is stable on its own ship: nothing to draw")
    with picture(path, title, (WIDEST_IN, 7.0), about) as figure:
        axes = figure.subplot_mosaic(
            [["trade", "radius"], ["trade", "pressure"], ["trade", "level"]],
            width_ratios=(1.45, 1),
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
    reduction = [100 * _roll_reduction(point) for point in points]
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
            axes.annotate(
                f"×{point.factor:g}",
                (x, y),
                xytext=(9, -6),
                textcoords="offset points",
                va="center",
                color="#777777",
            )
    axes.figure.legend(marks.values(), marks.keys(), **BELOW)
    axes.set_ylim(min(0.0, *reduction) - 3, max(reduction) + 6)
    axes.set_xlabel("Peak sensitivity")
    axes.set_ylabel("Roll RMS below the passive tank (%)")
    axes.set_title(
        f"Linear prediction, no limits; passive roll {_degrees(trade.passive.roll_rms_rad)} RMS",
        loc="left",
        fontsize=10,
    )


def _draw_costs(column: "list[Axes]", points: list[TradePoint]) -> None:
    titles = (
        "Largest eigenvalue over ships, gains, delays",
        "Pressure RMS demanded (kPa)",
        "Tank level RMS (m)",
    )
    factor = [point.factor for point in points]
    motions = [point.motion for point in points if point.motion is not None]
    values = (
        [point.robustness.worst_radius for point in points],
        [motion.pressure_rms_pa / 1e3 for motion in motions],
        [motion.level_rms_m for motion in motions],
    )
    for axis, title, series in zip(column, titles, values, strict=True):
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
    star = point.factor == 1
    (mark,) = axes.plot(
        x,
        y,
        color=color,
        linestyle="none",
        marker="*" if star else "o",
        markersize=19 if star else 6,
        markerfacecolor=HIGHLIGHT if star else "white" if point.refused else color,
        zorder=4 if star else 3,
    )
    return mark


def _limit(axes: "Axes", value: float, text: str) -> None:
    axes.axhline(value, color=_REFUSED, linewidth=0.9, linestyle="--", zorder=2)
    axes.annotate(
        text,
        (0, value),
        xycoords=("axes fraction", "data"),
        xytext=(4, 3),
        textcoords="offset points",
        color=_REFUSED,
        fontsize=9,
    )


def _roll_reduction(point: TradePoint) -> float:
    return np.nan if point.roll_below_passive is None else point.roll_below_passive


def _degrees(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.2f}°"
