"""Figure of a bench: roll reduction and its cost, and roll, level and pressure over time."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.canbus.enumerations import Mode, RetuningState
from utank_hil.pictures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

ZOOM_S: Final = 180.0  #: Length of the enlarged part. Chosen; no study.
WINDOWS: Final = 60
"""Number of parts of the run whose greatest values are drawn; a curve of an hour would be a block.
"""
_LANES: Final[dict[int, tuple[str, float]]] = {
    RetuningState.IDENTIFY: ("identification", 0.25),
    RetuningState.DESIGN: ("design", 0.4),
    RetuningState.TRIAL: ("trial", 0.55),
    RetuningState.RETUNED: ("retuned", 1.0),
    RetuningState.REFUSED: ("refused", 0.1),
    RetuningState.UNDONE: ("undone", 0.1),
}  # Label and opacity of each retuning state.
_LETTER: Final = 0.014  #: Width of a letter in a lane over the axis; a short section has no label.
_MARKS: Final = (("armed", Mode.ACTIVE), ("fault", Mode.FAULT))
_LABELS: Final = ("Roll (°)", "Tank level (m)", "Pump pressure (kPa)")


@dataclass(frozen=True, slots=True)
class BenchCurve:
    """Signals of one run of a bench."""

    label: str  #: Text in the legend, results included.
    #: time_s, roll_rad, level_m, pressure_pa: the level is the starboard level above still water.
    time_s: FloatArray
    roll_rad: FloatArray
    level_m: FloatArray
    pressure_pa: FloatArray
    retuning: FloatArray | None = None  #: `RetuningState` of a retuning run, drawn as a lane.
    mode: FloatArray | None = None  #: `Mode`: the first ACTIVE and the first FAULT are marked.


@dataclass(frozen=True, slots=True)
class BenchBar:
    """One run in the summary of a bench."""

    name: str
    color: str
    roll_rad: float | None  #: Root mean square, or None.
    said: str  #: Text beside the bar of the roll.
    power_w: float | None  #: Mean shaft power; None without a pump.
    cost: str  #: Text beside the bar of the power.


def draw_bench(
    curves: Sequence[BenchCurve],
    path: Path,
    title: str,
    about: Mapping[str, Any] | None = None,
    *,
    bare: BenchCurve | None = None,
    bars: Sequence[BenchBar] = (),
    wrong: Sequence[str] = (),
    interval: float | None = None,
) -> Path:
    """Draw the roll and cost of all runs as bars, and their roll, level and pressure over time.

    The whole run is drawn as the greatest value in each of `WINDOWS` parts, and three minutes in
    full, around the largest roll, or around the first trial of a new law. Lanes below show the
    retuning states. The first curve is the reference, the passive tank: drawn in grey, and searched
    for the largest roll. `bare` is the ship without a tank. `bars` are the runs of the summary,
    those of the curves last, or none; the problems in `wrong` are written above them. `interval` is
    the relative half-width of each roll RMS. Raises `ValueError` without curves, or for more than
    there are colours.
    """
    if not 1 <= len(curves) <= len(style.COLORS):
        raise ValueError(
            f"can draw 1 to {len(style.COLORS)} runs in one picture, got {len(curves)}"
        )
    whole = (float(curves[0].time_s[0]), float(curves[0].time_s[-1]))
    centre_s, zoomed = _centre(curves)
    zoom = _around(centre_s, whole)
    spans = [whole] if zoom == whole else [whole, zoom]
    retuning = any(curve.retuning is not None for curve in curves)
    lane = 0.25 * sum(curve.retuning is not None for curve in curves)
    curves_in = 6.6 + (0.6 + lane if retuning else 0.0)
    bars_in = 0.8 + 0.32 * len(bars) if bars else 0.0
    lines = [line for each in wrong for line in wrap(each, 120)]
    size_in = (style.WIDEST_IN if len(spans) > 1 else 9.0, curves_in + bars_in + 0.24 * len(lines))
    with style.picture(path, title, size_in, about) as whole_figure:
        figure: Figure | SubFigure = whole_figure
        if bars:
            heights = [bars_in + 0.24 * len(lines), curves_in]
            top, figure = whole_figure.subfigures(2, 1, squeeze=False, height_ratios=heights)[:, 0]
            if lines:
                top.suptitle("\n".join(lines), x=0.01, ha="left", fontsize=10, color=style.WRONG)
            _draw_bars(top, bars, "" if interval is None else f", each ±{interval:.0%} (95 %)")
        shape, ratios = (3 + retuning, len(spans)), [2.0, 2.0, 2.0, lane][: 3 + retuning]
        axes = figure.subplots(*shape, sharex="col", squeeze=False, height_ratios=ratios)
        for column, span_s in zip(axes.T, spans, strict=True):
            _draw_column(column, curves, bare, span_s, as_they_were=span_s == spans[-1])
        if len(spans) > 1:
            unit_s, _ = _time_unit(whole)
            for axis in axes[:3, 0]:
                axis.axvspan(
                    zoom[0] / unit_s, zoom[1] / unit_s, color=style.HIGHLIGHT, alpha=0.35, lw=0
                )
            part_s = (whole[1] - whole[0]) / WINDOWS
            part = f"Whole run: greatest in each {part_s:.{0 if part_s >= 2 else 1}f} s"
            axes[0, 0].set_title(part, loc="left", fontsize=10)
            axes[0, 1].set_title(zoomed, loc="left", fontsize=10)
        for axis, label in zip(axes[:, 0], _LABELS, strict=False):
            axis.set_ylabel(label)
        if retuning:
            axes[-1, 0].set_ylabel("Retuning", rotation=0, ha="right", va="center")
        figure.align_ylabels()
        drawn = [*([] if bare is None else [bare]), *curves]
        names = [bar.name for bar in bars[-len(drawn) :]] or [curve.label for curve in drawn]
        handles = axes[0, -1].get_lines()[: len(drawn)]
        whole_figure.legend(handles, names, **style.BELOW | {"ncols": len(drawn)})
    return path


def _centre(curves: Sequence[BenchCurve]) -> tuple[float, str]:
    known = [curve for curve in curves if curve.retuning is not None]
    trials = [curve.time_s[curve.retuning == RetuningState.TRIAL] for curve in known]
    if any(map(len, trials)):
        first_s = min(float(times_s[0]) for times_s in trials if len(times_s))
        return first_s, "Around the new law's first command"
    reference = curves[0]
    worst_s = float(reference.time_s[np.argmax(np.abs(reference.roll_rad))])
    return worst_s, "Around the largest roll"


def _around(centre_s: float, whole: tuple[float, float]) -> tuple[float, float]:
    if whole[1] - whole[0] < 2 * ZOOM_S:
        return whole
    start_s = min(max(centre_s - ZOOM_S / 2, whole[0]), whole[1] - ZOOM_S)
    return start_s, start_s + ZOOM_S


def _draw_bars(figure: "SubFigure", bars: Sequence[BenchBar], interval: str) -> None:
    rolls, powers = figure.subplots(1, 2, sharey=True, width_ratios=[3, 2])
    places = range(len(bars))
    degrees = [None if bar.roll_rad is None else math.degrees(bar.roll_rad) for bar in bars]
    for axis, label, values, words in (
        (rolls, f"Roll, RMS (°){interval}", degrees, [bar.said for bar in bars]),
        (powers, "Shaft power, mean", [bar.power_w for bar in bars], [bar.cost for bar in bars]),
    ):
        most = max((value for value in values if value is not None), default=0.0) or 1.0
        lengths = [value or 0.0 for value in values]
        axis.barh(places, lengths, 0.62, color=[bar.color for bar in bars])
        for place, length, word in zip(places, lengths, words, strict=True):
            axis.text(length + 0.012 * most, place, word, va="center", fontsize=10)
        axis.set(xlim=(0.0, 1.45 * most), xticks=[])
        axis.set_title(label, loc="left", fontsize=10)
        axis.grid(visible=False)
        axis.spines["bottom"].set_visible(False)
        axis.tick_params(axis="y", length=0)
    rolls.set_yticks(places, [bar.name for bar in bars])
    rolls.tick_params(axis="y", labelcolor="black")
    rolls.invert_yaxis()


def _time_unit(span_s: tuple[float, float]) -> tuple[float, str]:
    return (60.0, "min") if span_s[1] - span_s[0] > 600.0 else (1.0, "s")


def _draw_column(
    axes: "Sequence[Axes]",
    curves: Sequence[BenchCurve],
    bare: BenchCurve | None,
    span_s: tuple[float, float],
    *,
    as_they_were: bool,
) -> None:
    unit_s, unit = _time_unit(span_s)
    without = [] if bare is None else [(bare, style.NO_TANK, "-")]
    plots = axes[: len(_LABELS)]
    for curve, color, dashes in (*without, *zip(curves, style.COLORS, style.DASHES, strict=False)):
        shown = (curve.time_s >= span_s[0]) & (curve.time_s <= span_s[1])
        time = curve.time_s[shown] / unit_s
        values = (np.rad2deg(curve.roll_rad), curve.level_m, curve.pressure_pa / 1e3)
        for axis, value in zip(plots, values, strict=True):
            x, y = (time, value[shown]) if as_they_were else _greatest(time, value[shown])
            axis.plot(x, y, color=color, linewidth=1.4, linestyle=dashes)
    if not as_they_were:
        for axis in plots:
            axis.set_ylim(bottom=0.0)
    _mark(plots, curves, span_s)
    if len(axes) > len(plots):
        _draw_lanes(axes[-1], curves, span_s)
    axes[-1].set_xlim(span_s[0] / unit_s, span_s[1] / unit_s)
    axes[-1].set_xlabel(f"Time ({unit})")


def _mark(
    axes: "Sequence[Axes]", curves: Sequence[BenchCurve], span_s: tuple[float, float]
) -> None:
    """Mark when each run was first armed, and when it ended in a fault; words stand once."""
    unit_s, _ = _time_unit(span_s)
    said: set[tuple[str, int]] = set()
    for curve, color in zip(curves, style.COLORS, strict=False):
        for word, mode in _MARKS if curve.mode is not None else ():
            at_s = next(iter(curve.time_s[curve.mode == mode]), math.inf)
            if not span_s[0] <= at_s <= span_s[1]:
                continue
            for axis in axes:
                axis.axvline(at_s / unit_s, color=color, linewidth=0.9, linestyle=":")
            if (word, round(at_s)) not in said:
                said.add((word, round(at_s)))
                top = axes[0].get_xaxis_transform()
                axes[0].text(at_s / unit_s, 1.0, f" {word}", va="top", fontsize=9, transform=top)


def _greatest(time: FloatArray, value: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Middle of each part of a record, and the greatest absolute value in it."""
    parts = np.array_split(np.arange(len(time)), min(WINDOWS, len(time)))
    greatest = [np.fmax.reduce(np.abs(value[part])) for part in parts]  # NaN if all are NaN
    return np.array([time[part].mean() for part in parts]), np.array(greatest)


def _draw_lanes(axis: "Axes", curves: Sequence[BenchCurve], span_s: tuple[float, float]) -> None:
    unit_s, _ = _time_unit(span_s)
    place = 0
    for curve, color in zip(curves, style.COLORS, strict=False):
        if curve.retuning is None:
            continue
        starts = np.flatnonzero(np.diff(curve.retuning, prepend=np.nan))
        ends_s = [*curve.time_s[starts[1:]], curve.time_s[-1]]
        for start, end_s in zip(starts, ends_s, strict=True):
            name, strength = _LANES.get(int(curve.retuning[start]), ("", 0.0))
            begin_s, end_s = max(curve.time_s[start], span_s[0]), min(end_s, span_s[1])
            if not name or begin_s >= end_s:
                continue
            begin, length = begin_s / unit_s, (end_s - begin_s) / unit_s
            axis.barh(place, length, 0.8, begin, color=color, alpha=strength, lw=0)
            if end_s - begin_s > len(name) * _LETTER * (span_s[1] - span_s[0]):
                ink = "white" if strength > 0.6 else "black"
                middle = begin + length / 2
                axis.text(middle, place, name, ha="center", va="center", fontsize=9, color=ink)
        place += 1
    axis.set_ylim(place - 0.4, -0.6)
    axis.set_yticks([])
    axis.grid(visible=False)
