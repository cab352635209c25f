"""The tables that a bench prints."""

import math
from collections.abc import Sequence
from typing import Final

from rich.markup import escape
from rich.table import Table as RichTable

from firmware_sim.bench import BenchResult
from firmware_sim.figures import RunFigures, figures
from firmware_sim.retuning_figures import SETTLING_S, RetuningFigures, retuning_figures
from firmware_sim.scenario import PASSIVE
from firmware_sim.verdicts import mark_of
from utank_hil.analysis.motion.statistics import RollStatistics

NO_TANK: Final = "no tank"
_PREFIXES: Final = (("M", 1e6), ("k", 1e3), ("", 1.0))


def motion_table(result: BenchResult) -> RichTable:
    """Table of how much the ship rolled; runs that do not count stand at its end."""
    bare, runs = figures(result)
    table = _table(
        f"{result.scenario.name} · {result.mode} · seed {result.seed}",
        "roll\nRMS °",
        "signif.\n°",
        "max.\n°",
        "below\nno tank",
        "below\npassive",
        "in\ncharge",
        "water\nstrikes",
    )
    table.caption = (
        f"{result.settle_s:g} s to {result.end_s:g} s of the same waves; strikes of the whole run"
    )
    counting = [run for run in runs if run.ranked]
    capsized = result.without_tank_capsized_s < result.end_s
    table.add_row(
        NO_TANK, *_roll_cells(bare), "capsized" if capsized else "", end_section=not counting
    )
    for run in counting:
        table.add_row(*_motion_cells(run), end_section=run is counting[-1])
    marks = {run.name: mark_of(result, run) for run in result.runs}
    for run in runs:
        mark = marks[run.name]
        if mark is not None:
            table.add_row(*_motion_cells(run, mark.word), style="red")
    return table


def _motion_cells(run: RunFigures, mark: str = "") -> tuple[str, ...]:
    return (
        run.name,
        *_roll_cells(run.roll),
        mark or _percent(run.roll_below_no_tank),
        "" if run.name == PASSIVE else _percent(run.roll_below_passive),
        "" if run.name == PASSIVE else f"{run.active_share:.0%}",
        str(run.strikes),
    )


def pump_table(result: BenchResult) -> RichTable:
    """Table of what pump and bus did for it."""
    runs = figures(result)[1]
    pumps = [run.pump for run in runs]
    columns = [
        ("pressure\nRMS", *in_one_unit([pump.pressure_rms_pa for pump in pumps], "Pa")),
        ("pressure\npeak", *in_one_unit([pump.pressure_peak_pa for pump in pumps], "Pa")),
        ("power\nmean", *in_one_unit([pump.power_mean_w for pump in pumps], "W")),
        ("power\npeak", *in_one_unit([pump.power_peak_w for pump in pumps], "W")),
    ]
    table = _table(
        "Pump and bus",
        *(f"{heading} {unit}" for heading, unit, _ in columns),
        "level\npeak m",
        "bus\nload",
    )
    table.caption = "peaks of values every 50 ms; power that\nthe shaft draws, not what flows back"
    for index, run in enumerate(runs):
        table.add_row(
            run.name,
            *(cells[index] for _, _, cells in columns),
            f"{run.pump.level_peak_m:.2f}",
            f"{run.bus_load:.1%}",
        )
    return table


def in_one_unit(values: Sequence[float], unit: str) -> tuple[str, list[str]]:
    """Values of a column in the one unit that suits the largest, which has three digits or more.

    Parameters
    ----------
    values : sequence of float
        Zero or more, in the unit without a prefix.
    unit : str

    Returns
    -------
    unit : str
        With its prefix.
    cells : list of str
    """
    largest = max(values, default=0.0)
    prefix, scale = next((each for each in _PREFIXES if largest >= each[1]), _PREFIXES[-1])
    digits = 2 if largest < scale else max(0, 2 - math.floor(math.log10(largest / scale)))
    return prefix + unit, [f"{value / scale:.{digits}f}" for value in values]


def retuning_table(result: BenchResult) -> RichTable | None:
    """Table of what retuning found and gained; None where nothing retuned."""
    found = {
        run.name: retuning_figures(run, result.scenario, result.settle_s) for run in result.runs
    }
    if not any(found.values()):
        return None
    table = _table(
        "Retuning",
        "retuned\nat s",
        "roll RMS\nbefore °",
        "roll RMS\nafter °",
        "\nless",
        "roll period s\nfound ± / true",
        "ship damping MN m s\nfound / true",
        "tank damping ratio\nfound / true",
    )
    table.add_column("\nended in", no_wrap=True)
    table.add_column("\nbecause")
    table.caption = (
        f"± one standard deviation; before the first identification, and from {SETTLING_S:g} s "
        "after the new law took charge"
    )
    for name, retuning in found.items():
        if retuning is not None:
            table.add_row(name, *_retuning_cells(retuning))
    return table


def _retuning_cells(retuning: RetuningFigures) -> tuple[str, ...]:
    found, true = retuning.found, retuning.truth
    period = ship = tank = ""
    if found is not None:
        deviation_s = found.roll_period_s * found.period_deviation
        period = f"{found.roll_period_s:.3f} ± {deviation_s:.3f} / {true.roll_period_s:.3f}"
        ship = f"{found.damping_nms_rad / 1e6:#.4g} / {true.damping_nms_rad / 1e6:#.4g}"
        tank = f"{found.tank_damping_ratio:.4f} / {true.tank_damping_ratio:.4f}"
    rolls = (retuning.roll_before_rad, retuning.roll_after_rad)
    return (
        "" if retuning.retuned_at_s is None else f"{retuning.retuned_at_s:.0f}",
        *("" if roll is None else f"{math.degrees(roll):.2f}" for roll in rolls),
        _percent(retuning.roll_after_below_before),
        period,
        ship,
        tank,
        retuning.state
        if retuning.attempts <= 1
        else f"{retuning.state}, attempt {retuning.attempts}",
        escape("; ".join(retuning.reasons)),
    )


def _percent(share: float | None) -> str:
    return "" if share is None else f"{share:.1%}"


def _table(title: str, *headings: str) -> RichTable:
    table = RichTable(title=title)
    table.add_column("", no_wrap=True)
    for heading in headings:
        table.add_column(heading, justify="right", no_wrap=True)
    return table


def _roll_cells(roll: RollStatistics) -> tuple[str, str, str]:
    return (
        f"{math.degrees(roll.rms_rad):.2f}",
        "" if roll.significant_rad is None else f"{math.degrees(roll.significant_rad):.2f}",
        f"{math.degrees(roll.maximum_rad):.2f}",
    )
