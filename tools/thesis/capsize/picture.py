"""Figure of capsizing: phase planes with safe basins, and the erosion of the basins by waves."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tools.thesis.capsize.maps import CapsizeMap
from utank_hil.pictures.style import COLORS, DASHES, WIDEST_IN, picture

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

_CALM: Final = "#DCE9F3"
_IN_WAVES: Final = "#7FB2D8"
_LINE: Final = "#333333"


def draw_capsize_maps(maps: Sequence[CapsizeMap], path: Path, title: str) -> Path:
    """Draw the phase plane of each ship, and the erosion of all safe basins.

    Parameters
    ----------
    maps : sequence of CapsizeMap
        Such as one ship without and with its tank; all in the same wave.

    Raises
    ------
    ValueError
        If there are no maps, or more than there are colours.
    """
    if not 1 <= len(maps) <= len(COLORS):
        raise ValueError(f"can draw 1 to {len(COLORS)} maps in one picture, got {len(maps)}")
    with picture(path, title, (min(4.6 * (len(maps) + 1), WIDEST_IN), 5.0)) as figure:
        *planes, curves = figure.subplots(1, len(maps) + 1)
        for axes, each in zip(planes, maps, strict=True):
            _draw_plane(axes, each)
        planes[0].set_ylabel("Roll rate (°/s)")
        figure.legend(handles=_legend_handles(), loc="outside lower left", ncols=3, frameon=False)
        for color, dash, each in zip(COLORS, DASHES, maps, strict=False):
            curves.plot(
                each.amplitude_nm / 1e3,
                100 * each.area,
                color=color,
                linestyle=dash,
                linewidth=1.8,
                label=each.name,
            )
        curves.axvline(
            maps[0].wave_nm / 1e3,
            color="#888888",
            linewidth=0.9,
            linestyle="--",
            label="wave of the basins",
        )
        curves.set_xlim(0, maps[0].amplitude_nm[-1] / 1e3)
        curves.set_ylim(0, 105)
        curves.set_xlabel("Wave moment (kN m)")
        curves.set_ylabel("Area of the safe basin, of that in calm water (%)")
        curves.set_title("Erosion", loc="left", fontsize=10)
        curves.legend(
            frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.06), borderaxespad=0.0
        )
    return path


def _draw_plane(axes: "Axes", each: CapsizeMap) -> None:
    roll, rate = np.degrees(each.roll_rad), np.degrees(each.roll_rate_rad_s)
    for safe, color in ((each.calm, _CALM), (each.in_waves, _IN_WAVES)):
        axes.contourf(roll, rate, safe.astype(float), levels=(0.5, 1.5), colors=[color])
    for trajectory in each.trajectories:
        axes.plot(*np.degrees(trajectory.T), color=_LINE, linewidth=0.8)
    for at_rest in each.equilibria:
        axes.plot(np.degrees(at_rest.roll_rad), 0.0, **_mark(stable=at_rest.stable))
    axes.set_xlim(roll[0], roll[-1])
    axes.set_ylim(rate[0], rate[-1])
    axes.set_xlabel("Roll (°)")
    axes.set_title(each.name, loc="left", fontsize=10)


def _mark(*, stable: bool) -> dict[str, Any]:
    return {
        "marker": "o" if stable else "X",
        "linestyle": "none",
        "color": COLORS[2],
        "markeredgecolor": "white",
        "markersize": 8,
        "zorder": 4,
    }


def _legend_handles() -> "list[Artist]":
    """Handles of the legend of the phase planes."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    return [
        Patch(color=_CALM, label="survives in calm water"),
        Patch(color=_IN_WAVES, label="survives in waves"),
        Line2D([], [], color=_LINE, linewidth=0.8, label="calm water, from beside a saddle"),
        Line2D([], [], label="at rest, stable", **_mark(stable=True)),
        Line2D([], [], label="at rest, unstable: saddle", **_mark(stable=False)),
    ]
