"""The picture of a bench: what the tank did to the ship, passive beside active."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.telemetry.style import COLORS, HIGHLIGHT, picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ZOOM_S: Final = 180.0
_LABELS: Final = ("Roll (°)", "Tank level (m)", "Pump pressure (kPa)")


@dataclass(frozen=True, slots=True)
class BenchCurve:
    """One run of a bench, as it is drawn.

    Attributes
    ----------
    label : str
        What the legend says of it, figures included: they come from who judges the run.
    time_s, roll_rad, level_m, pressure_pa : array (n,)
        Level is the starboard surface above its still level.
    """

    label: str
    time_s: FloatArray
    roll_rad: FloatArray
    level_m: FloatArray
    pressure_pa: FloatArray


def draw_bench(curves: Sequence[BenchCurve], path: Path, title: str) -> Path:
    """Draw roll, level and pressure of all runs: the whole time, and the worst three minutes.

    Parameters
    ----------
    curves : sequence of BenchCurve
        The first is the reference, the passive tank: the zoom is around its largest roll, and it is
        drawn in grey behind the others.
    path : Path
        The `.png` file; written anew.
    title : str
        Stands above the picture.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    ValueError
        If there are no curves, or more than the colours that can be told apart.
    """
    if not 1 <= len(curves) <= len(COLORS):
        raise ValueError(f"can draw 1 to {len(COLORS)} runs in one picture, got {len(curves)}")
    whole = (float(curves[0].time_s[0]), float(curves[0].time_s[-1]))
    zoom = _worst_span(curves[0], whole)
    spans = [whole] if zoom == whole else [whole, zoom]
    with picture(path, title, (13.0 if len(spans) > 1 else 9.0, 7.5)) as figure:
        axes = figure.subplots(3, len(spans), sharex="col", sharey="row", squeeze=False)
        for column, span_s in zip(axes.T, spans, strict=True):
            _draw_column(column, curves, span_s)
        if len(spans) > 1:
            unit_s, _ = _time_unit(whole)
            for axis in axes[:, 0]:
                axis.axvspan(zoom[0] / unit_s, zoom[1] / unit_s, color=HIGHLIGHT, alpha=0.35, lw=0)
            axes[0, 0].set_title("Whole run", loc="left", fontsize=10)
            axes[0, 1].set_title("Around the largest roll", loc="left", fontsize=10)
        for axis, label in zip(axes[:, 0], _LABELS, strict=True):
            axis.set_ylabel(label)
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


def _worst_span(reference: BenchCurve, whole: tuple[float, float]) -> tuple[float, float]:
    """Return `ZOOM_S` around the largest roll, or all of a run that is not much longer."""
    if whole[1] - whole[0] < 2 * ZOOM_S:
        return whole
    worst_s = float(reference.time_s[np.argmax(np.abs(reference.roll_rad))])
    start_s = min(max(worst_s - ZOOM_S / 2, whole[0]), whole[1] - ZOOM_S)
    return start_s, start_s + ZOOM_S


def _time_unit(span_s: tuple[float, float]) -> tuple[float, str]:
    """Return the length in seconds, and the name, of the unit a time axis is labelled in."""
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
        for axis, value in zip(axes, values, strict=True):
            axis.plot(time, value[shown], color=color, linewidth=width)
    axes[-1].set_xlim(span_s[0] / unit_s, span_s[1] / unit_s)
    axes[-1].set_xlabel(f"Time ({unit})")
