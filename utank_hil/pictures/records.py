"""Figures of records: over time, and in a phase plane."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from utank_hil.base.arrays import FloatArray
from utank_hil.pictures.style import COLORS, STROKES, picture


def draw_time(
    time_s: FloatArray,
    panels: Mapping[str, Mapping[str, FloatArray]],
    path: Path,
    title: str,
) -> Path:
    """Draw records over a common time axis, in panels one below the other.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
    panels : mapping of str to mapping of str to ndarray, shape (n,)
        Records by name, of each panel by its label; records are in the unit of the label. A name
        has the same stroke in all panels, the first one grey.

    Raises
    ------
    ValueError
        If there are no records, or more names than there are colours.
    """
    names = list(dict.fromkeys(name for records in panels.values() for name in records))
    stroke = _strokes(names)
    with picture(path, title, (10.0, 1.2 + 2.1 * len(panels))) as figure:
        column = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        lines = {}
        for axis, (label, records) in zip(column, panels.items(), strict=True):
            axis.set_ylabel(label)
            for name, record in records.items():
                (lines[name],) = axis.plot(time_s, record, linewidth=1.3, **stroke[name])
        column[-1].set_xlim(time_s[0], time_s[-1])
        column[-1].set_xlabel("Time (s)")
        figure.align_ylabels()
        figure.legend(
            [lines[name] for name in names],
            names,
            loc="outside lower left",
            ncols=len(names),
            frameon=False,
        )
    return path


def draw_phase(
    trajectories: Mapping[str, tuple[FloatArray, FloatArray]],
    labels: tuple[str, str],
    path: Path,
    title: str,
) -> Path:
    """Draw trajectories in a plane, such as roll rate over roll; a dot marks each start.

    Parameters
    ----------
    trajectories : mapping of str to tuple of ndarray, shape (n,)
        Abscissa and ordinate by name, in the units of the labels.
    labels : tuple of str
        Labels of the two axes, units included.

    Raises
    ------
    ValueError
        If there are no trajectories, or more than there are colours.
    """
    stroke = _strokes(list(trajectories))
    with picture(path, title, (7.5, 6.5)) as figure:
        axes = figure.add_subplot()
        for name, (x, y) in trajectories.items():
            axes.plot(x, y, linewidth=1.1, label=name, **stroke[name])
            axes.plot(x[0], y[0], marker="o", color=stroke[name]["color"], markersize=5)
        axes.set_xlabel(labels[0])
        axes.set_ylabel(labels[1])
        figure.legend(loc="outside lower left", ncols=len(trajectories), frameon=False)
    return path


def _strokes(names: list[str]) -> dict[str, dict[str, Any]]:
    if not 1 <= len(names) <= len(COLORS):
        raise ValueError(f"can draw 1 to {len(COLORS)} records in one picture, got {len(names)}")
    return dict(zip(names, STROKES, strict=False))
