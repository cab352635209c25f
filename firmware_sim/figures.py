"""The runs of a bench in figures, over its window."""

from dataclasses import dataclass
from typing import Final

from firmware_sim.bench import BenchResult
from firmware_sim.run import RECORD_S, Run
from firmware_sim.scenario import PASSIVE
from firmware_sim.verdicts import active_share, mark_of
from utank_hil.analysis.motion.statistics import (
    PumpStatistics,
    RollStatistics,
    pump_statistics,
    roll_statistics,
)
from utank_hil.canbus import Fault, Mode

LEAST_ROLL_RAD: Final = 1e-6
"""Less roll than this is none: a share of it says nothing."""


@dataclass(frozen=True, slots=True)
class RunFigures:
    """One run in figures, over the window of the bench.

    Attributes
    ----------
    ranked : bool
        Whether the run counts, see `firmware_sim.verdicts`.
    rank : int or None
        Place by roll RMS among the runs that count, from 1.
    roll_below_no_tank, roll_below_passive : float or None
        Share by which the roll RMS is less than without a tank, and than with the passive tank;
        None where the run or the one it is compared with does not count, and on still water.
    strikes : int
        How often the water hit a reservoir's roof or bottom, over the whole run.
    mode, fault : str
        Of the controller at the end of the run.
    active_share : float
        Share of the window in which the controller was in charge.
    """

    name: str
    ranked: bool
    rank: int | None
    roll: RollStatistics
    roll_below_no_tank: float | None
    roll_below_passive: float | None
    pump: PumpStatistics
    strikes: int
    bus_load: float
    refused_commands: int
    mode: str
    fault: str
    active_share: float


def figures(result: BenchResult) -> tuple[RollStatistics, tuple[RunFigures, ...]]:
    """Figures of the bare ship, and of each run that has rows enough in the window."""
    bare = roll_statistics(result.without_tank_rad[round(result.settle_s / RECORD_S) :])
    compared = [run for run in result.runs if result.compares(run)]
    rolls = {run.name: _roll(result, run) for run in compared}
    ranked = [run.name for run in compared if mark_of(result, run) is None]
    order = sorted(ranked, key=lambda name: rolls[name].rms_rad)
    passive = rolls[PASSIVE] if PASSIVE in ranked else None
    afloat = bare if result.without_tank_capsized_s >= result.end_s else None
    found = []
    for run in compared:
        counts = run.name in ranked
        window = run.between(result.settle_s, result.end_s)
        found.append(
            RunFigures(
                name=run.name,
                ranked=counts,
                rank=order.index(run.name) + 1 if counts else None,
                roll=rolls[run.name],
                roll_below_no_tank=_share_below(rolls[run.name], afloat) if counts else None,
                roll_below_passive=_share_below(rolls[run.name], passive) if counts else None,
                pump=pump_statistics(
                    run.column("true_pressure_pa")[window],
                    run.column("true_shaft_power_w")[window],
                    run.column("true_level_m")[window],
                ),
                strikes=run.strikes,
                bus_load=run.bus_load,
                refused_commands=run.refused_commands,
                mode=Mode(int(run.column("mode")[-1])).name,
                fault=Fault(int(run.column("fault")[-1])).name,
                active_share=active_share(result, run),
            )
        )
    return bare, tuple(found)


def _roll(result: BenchResult, run: Run) -> RollStatistics:
    window = run.between(result.settle_s, result.end_s)
    return roll_statistics(run.column("true_roll_rad")[window])


def _share_below(roll: RollStatistics, reference: RollStatistics | None) -> float | None:
    if reference is None or reference.rms_rad < LEAST_ROLL_RAD:
        return None
    return 1.0 - roll.rms_rad / reference.rms_rad
