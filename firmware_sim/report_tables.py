"""Tables of a bench, for the terminal and for its page."""

import math
from collections.abc import Sequence
from typing import Final

from rich.table import Table as RichTable

from firmware_sim.figures import NO_TANK, BenchFigures, RunFigures
from firmware_sim.scenario_content import PASSIVE
from utank_hil.analysis.motion.statistics import RollStatistics
from utank_hil.console.terminal import new_table

_PREFIXES: Final = (("M", 1e6), ("k", 1e3), ("", 1.0))
_ROLL_DAMPING: Final = 0.1  # Damping ratio of the roll of the shipped ships with their tanks.
_LEAST_INTERVAL: Final = 0.1
"""Interval of the roll RMS from which it is said; an hour of the first ship has 0.07."""


def roll_interval(found: BenchFigures, roll_rad_s: float) -> float:
    """Relative half-width at 95 % of the roll RMS, as of one draw of the sea.

    The variance of a lightly damped motion in T seconds has the relative variance 1 / (zeta w T)
    (Bendat and Piersol, Random Data, 8.2, with the autocorrelation of an oscillator).
    """
    window_s = max(found.end_s - found.settle_s, 1.0)
    return 1.96 / 2 / math.sqrt(_ROLL_DAMPING * roll_rad_s * window_s)


def few_rolls(found: BenchFigures, roll_rad_s: float) -> str:
    """Return how uncertain the roll of a short window is; empty for a long one."""
    interval, window_s = roll_interval(found, roll_rad_s), found.end_s - found.settle_s
    if interval < _LEAST_INTERVAL:
        return ""
    rolls = window_s * roll_rad_s / (2 * math.pi)
    return (
        f"{window_s:.0f} s hold {rolls:.0f} rolls: each roll RMS is uncertain by ±{interval:.0%} "
        "(95 %). Laws that differ by less are not ranked by it: use a longer --duration."
    )


def tables(found: BenchFigures) -> list[RichTable]:
    """All tables of a bench that have rows."""
    made = [motion_table(found), pump_table(found)]
    return [table for table in made if table.rows]


def motion_table(found: BenchFigures) -> RichTable:
    """Table of the roll; runs that do not count are at its end."""
    figures = (
        "roll\nRMS °", "signif.\n°", "max.\n°", "below\nno tank", "below\npassive",
        "in\ncharge", "water\nstrikes",
    )  # fmt: skip
    span = f"{found.settle_s:g} s to {found.end_s:g} s of the same waves"
    title = f"{found.scenario} · {found.mode} · seed {found.seed}"
    table = new_table(title, *figures, caption=f"{span}; strikes of the whole run")
    bare = found.no_tank
    counting = [run for run in found.compared if run.ranked]
    capsized = bare.capsized_s is not None and bare.capsized_s < found.end_s
    table.add_row(
        NO_TANK, *_roll_cells(bare), "capsized" if capsized else "", end_section=not counting
    )
    for run in counting:
        table.add_row(*_motion_cells(run), end_section=run is counting[-1])
    for run in found.compared:
        if run.mark is not None:
            table.add_row(*_motion_cells(run), style="red")
    return table


def _motion_cells(run: RunFigures) -> tuple[str, ...]:
    passive = run.name == PASSIVE
    assert run.roll is not None
    return (
        run.name,
        *_roll_cells(run.roll),
        _percent(run.roll_below_no_tank) if run.mark is None else run.mark.word,
        "" if passive else _percent(run.roll_below_passive),
        "" if passive else f"{run.active_share:.0%}",
        str(run.strikes),
    )


def pump_table(found: BenchFigures) -> RichTable:
    """Table of the pump."""
    pumps = [(run, run.pump) for run in found.compared if run.pump is not None]
    pressures_pa = [pump.pressure_rms_pa for _, pump in pumps]
    pressures_pa += [pump.pressure_peak_pa for _, pump in pumps]
    # A peak with fewer digits than its RMS would read less.
    unit, cells = in_one_unit(pressures_pa, "Pa")
    columns = [
        ("pressure\nRMS", unit, cells[: len(pumps)]),
        ("pressure\npeak", unit, cells[len(pumps) :]),
    ]
    columns += [
        (heading, *in_one_unit([getattr(pump, name) for _, pump in pumps], "W"))
        for heading, name in (("power\nmean", "power_mean_w"), ("power\npeak", "power_peak_w"))
    ]
    flows = iter(
        like_largest([run.flow_peak_m3_s for run, _ in pumps if run.flow_peak_m3_s is not None])
    )
    headings = (f"{heading} {unit}" for heading, unit, _ in columns)
    caption = "peaks of values every 50 ms; power that\nthe shaft draws, not what flows back"
    table = new_table("Pump", *headings, "level\npeak m", "flow peak\nm³/s", caption=caption)
    for index, (run, pump) in enumerate(pumps):
        table.add_row(
            run.name,
            *(cells[index] for _, _, cells in columns),
            f"{pump.level_peak_m:.2f}",
            "" if run.flow_peak_m3_s is None else next(flows),
        )
    return table


def in_one_unit(values: Sequence[float], unit: str) -> tuple[str, list[str]]:
    """Prefixed unit and cells of a column, not negative: at most three integer digits."""
    largest = max(values, default=0.0)
    prefix, scale = next((each for each in _PREFIXES if largest >= each[1]), _PREFIXES[-1])
    return prefix + unit, like_largest([value / scale for value in values])


def like_largest(values: Sequence[float], digits: int = 3) -> list[str]:
    """Values of a column, not negative, with the decimals that give the largest so many digits."""
    largest = max(values, default=0.0)
    places = max(0, digits - 1 - math.floor(math.log10(max(largest, 1.0))))
    return [f"{value:.{places}f}" for value in values]


def _percent(share: float | None) -> str:
    return "" if share is None else f"{round(share, 2) + 0.0:.0%}"  # no -0%


def _roll_cells(roll: RollStatistics) -> tuple[str, ...]:
    values = (roll.rms_rad, roll.significant_rad, roll.maximum_rad)
    return tuple("" if value is None else f"{math.degrees(value):.2f}" for value in values)
