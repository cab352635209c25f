"""Figure of a campaign: means with their intervals, and exceedance of roll."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from utank_hil.pictures.style import BELOW, COLORS, DASHES, WIDEST_IN, picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_GROUPS: Final = 40  #: Limit on the named groups in a figure. Chosen; no study.


@dataclass(frozen=True, slots=True)
class CampaignRun:
    """One run of a campaign's groups."""

    name: str
    #: mean_rad, half_width_rad: roll RMS of each group, or NaN.
    mean_rad: Sequence[float]
    half_width_rad: Sequence[float]
    rolls_rad: Sequence[float]  #: Roll RMS of each case.


def draw_campaign(
    groups: Sequence[str | float],
    axis: str,
    runs: Sequence[CampaignRun],
    path: Path,
    title: str,
    about: Mapping[str, Any] | None = None,
) -> Path:
    """Draw the roll RMS of groups of cases, and the share of cases above a roll.

    Groups are numbers along an axis named `axis`, or up to `MOST_GROUPS` names one below the other.
    """
    along = len(groups) > 1 and all(isinstance(group, float | int) for group in groups)
    height = 5.0 if along else min(2.5 + 0.3 * len(groups) * max(len(runs), 2), 16.0)
    with picture(path, title, (WIDEST_IN, max(height, 4.5)), about) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(1.3, 1))
        for number, run in enumerate(runs):
            color, dash = COLORS[number % len(COLORS)], DASHES[number % len(COLORS)]
            if along:
                _curve(left, np.array(groups, dtype=float), run, color, dash)
            else:
                _bars(left, number / max(len(runs), 1), run, color)
            _exceedance(right, run, color, dash)
        rolled = "Roll RMS (°), 95 % interval of the mean"
        if along:
            left.set(xlabel=axis, ylabel=rolled)
            left.set_ylim(bottom=0)
        else:
            shown = [str(group) for group in groups[:MOST_GROUPS] if group != ""]
            left.set_yticks(-np.arange(len(shown)) - 0.4, shown)
            left.set_xlabel(rolled)
        ordinate = "Share of the cases above it"
        right.set(xlabel="Roll RMS of a case (°)", ylabel=ordinate, yscale="log")
        figure.legend(*left.get_legend_handles_labels(), **BELOW)
    return path


def _curve(
    axes: "Axes", at: "np.ndarray[Any, Any]", run: CampaignRun, color: str, dash: Any
) -> None:
    order = np.argsort(at)
    mean, width = (np.degrees(np.array(each))[order] for each in (run.mean_rad, run.half_width_rad))
    axes.plot(at[order], mean, "o", ls=dash, color=color, markersize=4, label=run.name)
    axes.fill_between(at[order], mean - width, mean + width, color=color, alpha=0.12, linewidth=0)


def _bars(axes: "Axes", shift: float, run: CampaignRun, color: str) -> None:
    mean, width = (
        np.degrees(np.array(each[:MOST_GROUPS])) for each in (run.mean_rad, run.half_width_rad)
    )
    axes.errorbar(
        mean, -np.arange(len(mean)) - 0.8 * shift, xerr=np.nan_to_num(width), fmt="o", color=color,
        markersize=4, capsize=3, label=run.name,
    )  # fmt: skip


def _exceedance(axes: "Axes", run: CampaignRun, color: str, dash: Any) -> None:
    rolls = np.sort([math.degrees(roll) for roll in run.rolls_rad])
    if len(rolls):
        above = 1.0 - np.arange(len(rolls)) / len(rolls)
        mark = "o" if rolls[0] == rolls[-1] else None  # a step would have no width
        axes.step(rolls, above, where="pre", color=color, ls=dash, label=run.name, marker=mark)
