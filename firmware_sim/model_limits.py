"""Limits beyond which ship, tank, sea and pump of the bench are no longer a valid model.

A bench that passes a limit still runs; the limit is reported under the tables.
"""

import math
from collections.abc import Callable, Iterator
from typing import Final

import numpy as np

from firmware_sim.bench import BenchResult
from firmware_sim.voyage import spectra_on_the_way
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.sea import Spectrum

MOST_ROLL_RAD: Final = math.radians(40.0)
"""Roll up to which decks stay dry and cargo does not shift. Chosen; no study."""
MOST_LINEAR_ROLL_RAD: Final = math.radians(10.0)
"""Roll up to which the linear plant is used. Chosen; no study."""
OVERSPEED: Final = 1.02
"""Ratio to the pump's speed limit up to which the speed loop lets the rotor overshoot."""


def steepness(spectrum: Spectrum) -> tuple[float, float]:
    """Average steepness of a sea, and its limit.

    The steepness is the significant height divided by the length of a wave of mean zero-up-crossing
    period; its limit falls from 1/10 at 6 s to 1/15 at 12 s (DNV-RP-C205, section 3.5.4).
    """
    period_s = spectrum.tz_s
    found = 2 * math.pi * spectrum.hs_m / (GRAVITY_M_S2 * period_s**2)
    return found, float(np.interp(period_s, [6.0, 12.0], [1 / 10, 1 / 15]))


def _roll(result: BenchResult, limit_rad: float = MOST_ROLL_RAD) -> Iterator[str]:
    rolls = {"no tank": result.without_tank_rad}
    rolls |= {run.name: run.column("true_roll_rad") for run in result.runs}
    for name, roll_rad in rolls.items():
        most_rad = float(np.abs(roll_rad).max())
        if most_rad > limit_rad:
            yield f"{name} rolled to {math.degrees(most_rad):.0f}°"


def _level(result: BenchResult) -> Iterator[str]:
    limit_m = result.scenario.vessel.tank.level_limit_m
    for run in result.runs:
        most_m = float(np.abs(run.column("true_level_m")).max())
        if run.strikes:
            yield (
                f"{run.name}: water struck roof or bottom {run.strikes} times, at most with "
                f"{run.max_strike_impulse_nms / 1e6:.3g} MN m s"
            )
        elif most_m > limit_m:
            yield f"{run.name}: level of {most_m:.2f} m with room for {limit_m:g} m"


def _sea(result: BenchResult) -> Iterator[str]:
    scenario = result.scenario
    for time_s, section in spectra_on_the_way(scenario.voyage, scenario.sea.spectra):
        found, most = steepness(section.spectrum())
        if time_s <= result.end_s and found > most:
            yield f"the sea's steepness is {found:.3f} at {time_s:g} s, and seas reach {most:.3f}"


def _pump(result: BenchResult) -> Iterator[str]:
    pump = result.scenario.vessel.pump
    if pump is None:
        return
    most = pump.max_speed_rad_s
    for run in result.runs:
        if run.pump_speed_rad_s > OVERSPEED * most:
            yield (
                f"{run.name}: rotor at {run.pump_speed_rad_s:.0f} rad/s, made for {most:.0f} rad/s"
            )


MODEL_LIMITS: Final[tuple[tuple[str, Callable[[BenchResult], Iterator[str]]], ...]] = (
    (
        f"roll beyond {math.degrees(MOST_ROLL_RAD):.0f}°: neither deck in the water nor shifting "
        "cargo, and waves and damping as for an upright ship",
        _roll,
    ),
    (
        f"roll beyond {math.degrees(MOST_LINEAR_ROLL_RAD):.0f}° by linear equations: neither the "
        "restoring curve nor quadratic damping (plant: roll has both)",
        lambda result: _roll(
            result, MOST_LINEAR_ROLL_RAD if result.scenario.plant == "linear" else math.inf
        ),
    ),
    ("level at the tank's end: a strike is one impulse, without sloshing or trapped air", _level),
    ("steeper sea than there is: waves are linear and do not break", _sea),
    ("pump beyond its speed: blades neither cavitate nor burst", _pump),
)  #: All limits, in the order of their report.


def passed_limits(result: BenchResult) -> list[str]:
    """Descriptions of all limits that were passed, with run and amount."""
    return [
        f"limit of the model passed, {limit}: {'; '.join(found)}"
        for limit, passed in MODEL_LIMITS
        if (found := list(passed(result)))
    ]
