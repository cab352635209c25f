"""Picture of a tank for a ship: roll in waves, other loadings."""

from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

from utank_hil.analysis.tank_filling import Filling
from utank_hil.analysis.tank_response import RollCurves
from utank_hil.analysis.tank_sweep import SweptTank
from utank_hil.pictures.style import BELOW, COLORS, DASHES, WIDEST_IN, picture

_NAMES = ("without tank", "passive tank", "active tank")


def draw_tank(
    curves: RollCurves,
    loadings: Mapping[float, Sequence[float]],
    path: Path,
    title: str,
    about: Mapping[str, Any] | None = None,
) -> Path:
    """Draw roll over wave period, and roll RMS in the sea over the ship's loading.

    `loadings` has, by the factor on the roll period, the roll in rad without tank, passive and
    active; NaN where there is none.
    """
    with picture(path, title, (WIDEST_IN, 4.6), about) as figure:
        waves, loading = figure.add_subplot(1, 2, 1), figure.add_subplot(1, 2, 2)
        energy = curves.sea * 0.5 * curves.without_tank.max()
        label = "energy of the wave moment"
        waves.fill_between(curves.sea_period_s, energy, step="mid", color="#DDDDDD", label=label)
        rolls = (curves.without_tank, curves.passive, curves.active)
        for roll, name, color, dash in zip(rolls, _NAMES, COLORS, DASHES, strict=False):
            if roll is not None:
                waves.plot(curves.period_s, roll, color=color, linestyle=dash, label=name)
        waves.set(xlabel="Wave period (s)", ylabel="Roll per effective wave slope")
        rolls_deg = np.degrees(np.reshape(list(loadings.values()), (-1, len(_NAMES))))
        for values, color, dash in zip(rolls_deg.T, COLORS, DASHES, strict=False):
            if not np.isnan(values).all():
                loading.plot(list(loadings), values, marker="o", color=color, linestyle=dash)
        loading.set_ylim(bottom=0)
        loading.set_xlabel("Roll period, times the ship's: tank and law as they are")
        loading.set_ylabel("Roll RMS in the sea (°)")
        figure.legend(*waves.get_legend_handles_labels(), **BELOW)
    return path


def draw_sweep(
    found: Sequence[SweptTank], path: Path, title: str, about: Mapping[str, Any] | None = None
) -> Path:
    """Draw roll in the sea over the water's frequency, a curve for each share of stability."""
    with picture(path, title, (WIDEST_IN, 4.6), about) as figure:
        axes = figure.add_subplot()
        shares = dict.fromkeys(each.stability_share for each in found)
        for share, color, dash in zip(shares, cycle(COLORS), cycle(DASHES)):
            here = [each for each in found if each.stability_share == share]
            axes.plot(
                [each.frequency_ratio for each in here],
                [np.degrees(each.roll_rms_rad) for each in here],
                color=color,
                linestyle=dash,
                marker="o",
                label=f"{share:.0%}",
            )
        axes.set(xlabel="Frequency of the water per roll frequency")
        axes.set_ylabel("Roll RMS in the sea, passive tank (°)")
        axes.set_ylim(bottom=0)
        figure.legend(*axes.get_legend_handles_labels(), title="Stability taken", **BELOW)
    return path


def draw_filling(
    found: Sequence[Filling], path: Path, title: str, about: Mapping[str, Any] | None = None
) -> Path:
    """Draw the best still level and the roll that it leaves over GM, a curve per displacement."""
    with picture(path, title, (WIDEST_IN, 4.6), about) as figure:
        levels, rolls = figure.add_subplot(1, 2, 1), figure.add_subplot(1, 2, 2)
        loads = dict.fromkeys(each.displacement_t for each in found)
        for load_t, color, dash in zip(loads, cycle(COLORS), cycle(DASHES)):
            here = [each for each in found if each.displacement_t == load_t]
            gm_m = [each.gm_m for each in here]
            style: dict[str, Any] = {"color": color, "linestyle": dash, "marker": "o"}
            style["label"] = f"{load_t:.5g} t"
            levels.plot(gm_m, [each.level_m for each in here], **style)
            rolls.plot(gm_m, [100 * each.passive_below_no_tank for each in here], **style)
        levels.set(xlabel="GM, solid (m)", ylabel="Still level above the duct (m)")
        rolls.set(xlabel="GM, solid (m)", ylabel="Roll below no tank, passive (%)")
        levels.set_ylim(bottom=0)
        figure.legend(*levels.get_legend_handles_labels(), **BELOW)
    return path
