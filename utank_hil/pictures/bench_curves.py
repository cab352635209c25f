"""Figure of a bench: roll, level and pressure over time, with passive and active tank."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.canbus.enumerations import RetuningState
from utank_hil.pictures.style import COLORS, HIGHLIGHT, picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ZOOM_S: Final = 180.0
_LANES: Final[dict[int, tuple[str, float]]] = {
    RetuningState.IDENTIFY: ("identification", 0.25),
    RetuningState.DESIGN: ("design", 0.4),
    RetuningState.TRIAL: ("trial", 0.55),
    RetuningState.RETUNED: ("retuned", 1.0),
    RetuningState.REFUSED: ("refused", 0.1),
    RetuningState.UNDONE: ("undone", 0.1),
}
"""Label and opacity of each retuning state."""
_NAMED_SHARE: Final = 0.07
"""Shortest labelled section of a lane, relative to the axis."""
_LABELS: Final = ("Roll (°)", "Tank level (m)", "Pump pressure (kPa)")


@dataclass(frozen=True, slots=True)
class BenchCurve:
    """Signals of one run of a bench.

    Attributes
    ----------
    label : str
        Text in the legend, results included.
    time_s, roll_rad, level_m, pressure_pa : array (n,)
        The level is the starboard level above still water.
    retuning : array (n,), optional
        `RetuningState` of a retuning run, drawn as a lane.
    """

    label: str
    time_s: FloatArray
    roll_rad: FloatArray
    level_m: FloatArray
    pressure_pa: FloatArray
    retuning: FloatArray | None = None


def draw_bench(
    curves: Sequence[BenchCurve], path: Path, title: str, about: Mapping[str, Any] | None = None
) -> Path:
    """Draw roll, level and pressure of all runs: the whole time, and three minutes enlarged.

    The enlarged part is around the largest roll, or around the first trial of a new law if a run
    retuned. Lanes below show the retuning states of each run.

    Parameters
    ----------
    curves : sequence of BenchCurve
        The first is the reference, the passive tank: drawn in grey, and searched for the largest
        roll.
    path : Path
        The `.png` file; overwritten.
    title : str
        Title of the figure.
    about : mapping, optional
        As in `picture`.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    ValueError
        If there are no curves, or more than there are colours.
    """
    if not 1 <= len(curves) <= len(COLORS):
        raise ValueError(f"can draw 1 to {len(COLORS)} runs in one picture, got {len(curves)}")
    whole = (float(curves[0].time_s[0]), float(curves[0].time_s[-1]))
    centre_s, zoomed = _centre(curves)
    zoom = _around(centre_s, whole)
    spans = [whole] if zoom == whole else [whole, zoom]
    retuning = any(curve.retuning is not None for curve in curves)
    lane = 0.25 * sum(curve.retuning is not None for curve in curves)
    size_in = (13.0 if len(spans) > 1 else 9.0, 7.5 + (0.6 + lane if retuning else 0.0))
    with picture(path, title, size_in, about) as figure:
        axes = figure.subplots(
            3 + retuning,
            len(spans),
            sharex="col",
            sharey="row",
            squeeze=False,
            height_ratios=[2.0, 2.0, 2.0, lane][: 3 + retuning],
        )
        for column, span_s in zip(axes.T, spans, strict=True):
            _draw_column(column, curves, span_s)
        if len(spans) > 1:
            unit_s, _ = _time_unit(whole)
            for axis in axes[:3, 0]:
                axis.axvspan(zoom[0] / unit_s, zoom[1] / unit_s, color=HIGHLIGHT, alpha=0.35, lw=0)
            axes[0, 0].set_title("Whole run", loc="left", fontsize=10)
            axes[0, 1].set_title(zoomed, loc="left", fontsize=10)
        for axis, label in zip(axes[:, 0], _LABELS, strict=False):
            axis.set_ylabel(label)
        if retuning:
            axes[-1, 0].set_ylabel("Retuning", rotation=0, ha="right", va="center")
        figure.align_ylabels()
        handles = axes[0, -1].get_lines()[: len(curves)]
        figure.legend(
            handles,
            [curve.label for curve in curves],
            loc="outside lower left",
            ncols=len(curves),
            frameon=False,
        )
    return path


def _centre(curves: Sequence[BenchCurve]) -> tuple[float, str]:
    """Return the centre of the enlarged part in s, and its title."""
    trials = [
        float(curve.time_s[curve.retuning == RetuningState.TRIAL][0])
        for curve in curves
        if curve.retuning is not None and (curve.retuning == RetuningState.TRIAL).any()
    ]
    if trials:
        return min(trials), "Around the new law's first command"
    reference = curves[0]
    worst_s = float(reference.time_s[np.argmax(np.abs(reference.roll_rad))])
    return worst_s, "Around the largest roll"


def _around(centre_s: float, whole: tuple[float, float]) -> tuple[float, float]:
    """Return a span of `ZOOM_S` around a time, or the whole of a short run."""
    if whole[1] - whole[0] < 2 * ZOOM_S:
        return whole
    start_s = min(max(centre_s - ZOOM_S / 2, whole[0]), whole[1] - ZOOM_S)
    return start_s, start_s + ZOOM_S


def _time_unit(span_s: tuple[float, float]) -> tuple[float, str]:
    """Return the unit of a time axis: its length in s, and its name."""
    return (60.0, "min") if span_s[1] - span_s[0] > 600.0 else (1.0, "s")


def _draw_column(
    axes: "Sequence[Axes]", curves: Sequence[BenchCurve], span_s: tuple[float, float]
) -> None:
    """Draw roll, level and pressure over one span of time."""
    unit_s, unit = _time_unit(span_s)
    width = 0.5 if unit_s > 1 else 1.4
    for curve, color in zip(curves, COLORS, strict=False):
        shown = (curve.time_s >= span_s[0]) & (curve.time_s <= span_s[1])
        time = curve.time_s[shown] / unit_s
        values = (np.rad2deg(curve.roll_rad), curve.level_m, curve.pressure_pa / 1e3)
        for axis, value in zip(axes, values, strict=False):
            axis.plot(time, value[shown], color=color, linewidth=width)
    if len(axes) > len(values):
        _draw_lanes(axes[-1], curves, span_s)
    axes[-1].set_xlim(span_s[0] / unit_s, span_s[1] / unit_s)
    axes[-1].set_xlabel(f"Time ({unit})")


def _draw_lanes(axis: "Axes", curves: Sequence[BenchCurve], span_s: tuple[float, float]) -> None:
    """Draw the retuning states of each retuning run over time."""
    unit_s, _ = _time_unit(span_s)
    lanes = [
        (curve, c) for curve, c in zip(curves, COLORS, strict=False) if curve.retuning is not None
    ]
    for place, (curve, color) in enumerate(lanes):
        assert curve.retuning is not None
        starts = np.flatnonzero(np.diff(curve.retuning, prepend=np.nan))
        ends_s = [*curve.time_s[starts[1:]], curve.time_s[-1]]
        for start, end_s in zip(starts, ends_s, strict=True):
            name, strength = _LANES.get(int(curve.retuning[start]), ("", 0.0))
            begin_s, end_s = max(curve.time_s[start], span_s[0]), min(end_s, span_s[1])
            if not name or begin_s >= end_s:
                continue
            axis.barh(
                place,
                (end_s - begin_s) / unit_s,
                0.8,
                begin_s / unit_s,
                color=color,
                alpha=strength,
                lw=0,
            )
            if end_s - begin_s > _NAMED_SHARE * (span_s[1] - span_s[0]):
                axis.text(
                    (begin_s + end_s) / 2 / unit_s,
                    place,
                    name,
                    ha="center",
                    va="center",
                    fontsize=8,
                    color="white" if strength > 0.6 else "black",
                )
    axis.set_ylim(len(lanes) - 0.4, -0.6)
    axis.set_yticks([])
    axis.grid(visible=False)
