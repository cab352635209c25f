"""The tables of docs/controllers.md on the nonlinear laws, but for thesis 4.5.

    python -m tools.studies.nonlinear_law_tables                    # all of them
    python -m tools.studies.nonlinear_law_tables growth --json      # or storm, valves, stimulation

* growth: how fast the loop of feedback linearization grows (or decays, if negative) about rest.
* storm: feedback linearization on the first ship in the storm hour, against the passive tank.
* valves: roll of the first ship, tank damping 3 %, with each valve law and the best fixed opening.
* stimulation: roll amplitude reached on still water, on the ship it was made for and another.

Thesis 4.5 is `python -m tools.thesis contest`. Takes about five minutes on one core.
"""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track

from tools.printing import print_tables
from tools.studies.trial_setup import STORM_HOUR, measured_hour, shipped
from tools.thesis.capsize.contest import PATTI_B
from tools.thesis.capsize.survival import controlled_run
from utank_hil.analysis.loop.closed_loop import closed_loop_radius
from utank_hil.analysis.loop.loop_simulation import passive_motion, simulate_loop
from utank_hil.analysis.loop.margins import radius_and_peak
from utank_hil.base.arrays import FloatArray
from utank_hil.base.tick import TICK_S
from utank_hil.control import (
    ClippedValve,
    DesignPlant,
    FeedbackLinearization,
    GainLaw,
    OnOffValve,
    Stimulation,
    design_lqr,
)
from utank_hil.dynamics import RollModel, RollShip, Tank, WaveMoment
from utank_hil.dynamics.linear import STATES
from utank_hil.dynamics.valves import ValveRange, duct_valve_loss
from utank_hil.sea import EffectiveSlope, Harmonics, Sea

Rows = dict[str, dict[str, float]]
FIRST = shipped("gpc").vessel
DIFFERENCE = 1e-6  # of the states, for the slope of a law
STORM_S, STORM_SEEDS = 1800.0, (7, 21)
OPENINGS = (1.0, 0.5, 0.3, 0.2, 0.15, 0.1)
REGULAR_RAD_S = (0.40, 0.45, 0.50, 0.55)
WAVE_SLOPE_RAD = 0.02


def linearization(ship: RollShip, tank: Tank, **changes: float) -> FeedbackLinearization:
    """The law with outer poles at the ship's roll frequency, limits wide enough not to act."""
    numbers: dict[str, Any] = {
        "frequency_rad_s": 0.59 if ship is PATTI_B.ship else 0.5,
        "damping_ratio": 0.5,
        "soft_level_m": 1e3,
        "hard_level_m": 2e3,
        "shift_length_m": 10.0,  # the shifted output keeps its grip within the reservoirs
    }
    return FeedbackLinearization(**{**numbers, **changes}, ship=ship, tank=tank)


def slope(law: FeedbackLinearization) -> GainLaw:
    """The law about rest."""
    steps = DIFFERENCE * np.eye(len(STATES))
    gain = [(law.pressure_pa(-x) - law.pressure_pa(x)) / (2 * DIFFERENCE) for x in steps]
    return GainLaw(np.array([gain]), law.sample_time_s)


def growth_rows() -> Rows:
    """Growth of the linearized loop per second, in three timings."""
    timings = {"ideal, 20 ms": (0.02, 0.0, 0.0), "ideal, 10 ms": (0.01, 0.0, 0.0)}
    late = "10 ms, 50 ms late, lag 0.1 s"
    timings[late] = (0.01, 0.05, 0.1)
    found: Rows = {}
    boats = {"Patti-B": (PATTI_B.ship, PATTI_B.tank), "first ship": (FIRST.ship, FIRST.tank)}
    for boat, (ship, tank) in boats.items():
        shift = 0.1 if ship is PATTI_B.ship else 0.03
        forms: dict[str, dict[str, float]] = {
            "kL = 0": {},
            f"kL = {shift:g} rad/m": {"shift_rad_m": shift},
            "level braked, zeta_h 0.4": {"level_damping_ratio": 0.4},
        }
        for form, changes in forms.items():
            row = {}
            for timing, (step_s, delay_s, lag_s) in timings.items():
                law = slope(linearization(ship, tank, sample_time_s=step_s, **changes))
                plant = DesignPlant(ship, tank, delay_s, lag_s).sampled(STATES, step_s)
                row[f"{timing}: 1/s"] = math.log(closed_loop_radius(law, plant)) / step_s
                if timing == late and row[f"{timing}: 1/s"] < 0:
                    row["peak sensitivity then"] = radius_and_peak(law, plant)[1]
            found[f"{boat}, {form}"] = row
    return found


def storm_rows() -> Rows:
    """Feedback linearization in the storm hour: roll above the passive tank's."""
    settings: dict[str, dict[str, float]] = {
        "as shipped": {"level_damping_ratio": 0.4},
        "level braked less": {"level_damping_ratio": 0.2},
        "level braked more": {"level_damping_ratio": 0.8},
        "not braked": {},
        "shifted, kL = 0.03 rad/m": {"shift_rad_m": 0.03},
        "slower, 0.35 rad/s": {"frequency_rad_s": 0.35, "level_damping_ratio": 0.4},
        "soft limit 1 m": {"soft_level_m": 1.0, "level_damping_ratio": 0.4},
    }
    found: Rows = {}
    plant, count = shipped("feedback_linearization").plant, round(STORM_S / TICK_S)
    waves = {
        seed: passive_motion(plant.ship, plant.tank, _storm(seed), TICK_S, count)
        for seed in STORM_SEEDS
    }
    for name in track(settings, "storm", console=Console(stderr=True)):
        shares, peaks = [], []
        for seed, passive in waves.items():
            level = {"soft_level_m": 2.5, "hard_level_m": 3.5}
            law = linearization(plant.ship, plant.tank, **{**level, **settings[name]})
            run = simulate_loop(plant, passive, law.controller(), STATES, seed=seed)
            shares.append(_rms(run.motion[:, 0]) / _rms(passive[:, 0]) - 1)
            peaks.append(float(np.abs(run.motion[:, 2]).max()))
        found[name] = {"roll above passive": float(np.mean(shares)), "level peak m": max(peaks)}
    return found


def _storm(seed: int) -> Harmonics:
    """Roll moment of the storm hour on the first ship."""
    sea = Sea.irregular(measured_hour(STORM_HOUR), seed)
    return sea.roll_moment(FIRST.ship.stiffness_nm_rad, EffectiveSlope(0.5))


class FixedOpening:
    """A valve that stays where it is."""

    sample_time_s = 0.1

    def __init__(self, loss: float) -> None:
        self._loss = np.array([loss])

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:  # noqa: ARG002
        """The loss, whatever is measured."""
        return self._loss.copy()

    def applied(self, u: FloatArray) -> None:
        """Nothing to remember."""

    def reset(self) -> None:
        """Nothing to forget."""


def valve_rows() -> Rows:
    """Roll RMS in regular waves and in the storm hour."""
    tank = dataclasses.replace(FIRST.tank, damping_ratio=0.03)
    model = RollModel(FIRST.ship, tank)
    valve = ValveRange(0.0, duct_valve_loss(tank, min(OPENINGS)))
    regulator = design_lqr(DesignPlant(FIRST.ship, tank, 0.0, 0.0).sampled(STATES, 0.1), 1e11)
    amplitude = FIRST.ship.stiffness_nm_rad * WAVE_SLOPE_RAD
    storm = _storm(STORM_SEEDS[0])
    seas = {f"{w:.2f} rad/s": WaveMoment([amplitude], [w], [0.0]) for w in REGULAR_RAD_S}
    seas["storm hour"] = WaveMoment(storm.amplitude, storm.frequency_rad_s, storm.phase_rad)

    def roll(controller: OnOffValve | ClippedValve | FixedOpening, wave: WaveMoment) -> float:
        rolls: list[float] = []
        controlled_run(
            model,
            controller,
            wave,
            STORM_S,
            valve=True,
            step_s=0.05,
            each_step=_keep_roll(rolls),
        )
        return _rms(np.array(rolls[len(rolls) // 3 :]))

    found: Rows = {}
    for name, wave in track(seas.items(), "valves", console=Console(stderr=True)):
        fixed = {s: roll(FixedOpening(duct_valve_loss(tank, s)), wave) for s in OPENINGS}
        best = min(fixed, key=lambda s: fixed[s])
        found[name] = {
            "best fixed rad": fixed[best],
            "its opening": best,
            "on-off rad": roll(OnOffValve(valve), wave),
            "clipped LQR rad": roll(ClippedValve(valve, regulator.controller()), wave),
        }
    return found


def stimulation_rows() -> Rows:
    """Roll amplitude over a period after some time, relative to what is wanted."""
    amplitude_rad, period_s = math.radians(3.0), 12.5
    other = dataclasses.replace(
        FIRST.ship,
        damping_nms_rad=3 * FIRST.ship.damping_nms_rad,
        stiffness_nm_rad=0.93 * FIRST.ship.stiffness_nm_rad,
    )
    ships = {"first ship": FIRST.ship, "3 x damping, 0.93 x stiffness": other}
    plan = Stimulation(
        amplitude_rad,
        period_s,
        ramp_s=60.0,
        roll_limit_rad=math.radians(6.0),
        ship=FIRST.ship,
        tank=FIRST.tank,
        pressure_pa=50e3,
        level_limit_m=4.0,
    )
    found: Rows = {}
    for name, ship in ships.items():
        rolls: list[float] = []
        controlled_run(
            RollModel(ship, FIRST.tank),
            plan.controller(),
            WaveMoment([], [], []),
            1200.0,
            each_step=_keep_roll(rolls),
        )
        step_s = plan.controller().sample_time_s
        record = np.abs(rolls)
        found[name] = {
            f"after {after} s": float(
                record[round(after / step_s) : round((after + period_s) / step_s)].max()
                / amplitude_rad
            )
            for after in (100, 200, 350, 700, 1100)
        }
    return found


def _keep_roll(rolls: list[float]) -> Callable[[float, FloatArray, float], None]:
    return lambda _time, state, _command: rolls.append(float(state[0]))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


TABLES: dict[str, Callable[[], Rows]] = {
    "growth": growth_rows,
    "storm": storm_rows,
    "valves": valve_rows,
    "stimulation": stimulation_rows,
}


def main() -> None:
    """Print the tables that were asked for."""
    print_tables(__doc__, TABLES)


if __name__ == "__main__":
    main()
