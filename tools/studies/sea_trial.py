"""Laws in the same realisations of irregular seas, on all cores.

One trial is one realisation of a sea: the linear ship without its tank, with the tank passive, and
then under each entrant, all in the same waves and with the same sensor noise. Differences between
two entrants of a trial scatter far less from realisation to realisation than their rolls do, so
they are compared trial by trial (`utank_hil.analysis.motion.confidence`).
"""

import dataclasses
import math
import multiprocessing
import os
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass

import numpy as np

from tools.studies.clairvoyant import clairvoyant_bound
from utank_hil.analysis.loop.loop_simulation import (
    LoopRun,
    SensorNoise,
    passive_motion,
    simulate_loop,
)
from utank_hil.analysis.motion.bare_ship import roll_without_tank
from utank_hil.base.arrays import FloatArray
from utank_hil.base.background import one_thread_each
from utank_hil.base.tick import TICK_S
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.interface import LinearLaw
from utank_hil.control.limits import PumpLimits
from utank_hil.dynamics.linear import STATES
from utank_hil.dynamics.tank import Tank
from utank_hil.sea import EffectiveSlope, Sea, Spectrum

NO_TANK, PASSIVE, CLAIRVOYANT = "no tank", "passive", "clairvoyant"
_BOUND_TICKS = 20  # the clairvoyant commands every 0.2 s
_HELD_BACK = 0.01  # of the greatest pressure: a command this far from what was asked was held back
_LEVEL, _SPEED = STATES.index("level_m"), STATES.index("level_rate_m_s")


@dataclass(frozen=True, slots=True)
class Entrant:
    """A law that takes part."""

    name: str
    law: LinearLaw  #: Also one that is linear within its limits only.
    measured: tuple[str, ...]  #: Names of `STATES` that it sees, in its order.
    limits: PumpLimits  #: Of the limiter behind it.


@dataclass(frozen=True, slots=True)
class TrialShip:
    """The real plant, which may differ from that which a law was designed for."""

    plant: DesignPlant  #: As it really is; its limits are each entrant's own.
    effective_slope: float = 0.5  #: Ratio of effective to true wave slope.
    pump_gain: float = 1.0  #: As in `simulate_loop`.
    noise: SensorNoise | None = None  #: None for the usual one
    #: heading_rad, speed_m_s: as `Sea.irregular` takes them.
    heading_rad: float = math.pi / 2
    speed_m_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Trial:
    """One realisation of a sea, and who sails in it."""

    sea: Spectrum
    seed: int  #: Of waves and sensor noise.
    vessel: TrialShip
    entrants: tuple[Entrant, ...]
    duration_s: float = 3600.0
    #: Limits of the clairvoyant bound (`CLAIRVOYANT`); None leaves it out.
    bound_limits: PumpLimits | None = None


@dataclass(frozen=True, slots=True)
class TrialFigures:
    """One run in figures."""

    roll_rms_rad: float
    level_rms_m: float = 0.0
    level_peak_m: float = 0.0
    pressure_rms_pa: float = 0.0
    power_peak_w: float = 0.0  #: Into the water.
    #: Share of the law's samples at whose end the limiter had still not come to the pressure that
    #: was asked for, by 1 % of the pump's greatest or more.
    held_back: float = 0.0


def run_trial(trial: Trial) -> dict[str, TrialFigures]:
    """Figures by name: `NO_TANK`, `PASSIVE`, the entrants, and `CLAIRVOYANT` if it was asked for.

    Raises `ValueError` if two entrants have one name, or the clairvoyant bound does not exist.
    """
    names = [entrant.name for entrant in trial.entrants]
    if len(set(names)) < len(names):
        raise ValueError(f"entrants need names of their own, got {', '.join(names)}")
    vessel = trial.vessel
    plant, ship, tank = vessel.plant, vessel.plant.ship, vessel.plant.tank
    waves = Sea.irregular(
        trial.sea, trial.seed, heading_rad=vessel.heading_rad, speed_m_s=vessel.speed_m_s
    )
    moment = waves.roll_moment(ship.stiffness_nm_rad, EffectiveSlope(vessel.effective_slope))
    count = round(trial.duration_s / TICK_S) + 1
    passive = passive_motion(ship, tank, moment, TICK_S, count)
    figures = {
        NO_TANK: TrialFigures(_rms(roll_without_tank(ship, moment, TICK_S, count))),
        PASSIVE: _motion_figures(passive),
    }
    for entrant in trial.entrants:
        run = simulate_loop(
            dataclasses.replace(plant, limits=entrant.limits),
            passive,
            entrant.law.controller(),
            entrant.measured,
            pump_gain=vessel.pump_gain,
            noise=vessel.noise,
            seed=trial.seed,
        )
        figures[entrant.name] = _run_figures(run, tank, entrant)
    if trial.bound_limits is not None:
        bound = clairvoyant_bound(
            dataclasses.replace(plant, limits=trial.bound_limits), passive[::_BOUND_TICKS]
        )
        figures[CLAIRVOYANT] = _motion_figures(bound.motion)
    return figures


def run_trials(
    trials: Sequence[Trial], progress: Callable[[float], None] | None = None
) -> list[dict[str, TrialFigures]]:
    """Run trials in a process for each core; results in their order.

    The calling module must be importable (`if __name__ == "__main__"`): processes are spawned.
    Raises `ValueError` as `run_trial`.

    `progress` takes the finished share after each trial.
    """
    context = multiprocessing.get_context("spawn")
    with (
        one_thread_each(),
        ProcessPoolExecutor(
            min(len(trials), os.cpu_count() or 1) or 1,
            mp_context=context,
            initializer=_leave_interrupts_to_the_caller,
        ) as pool,
    ):
        futures = [pool.submit(run_trial, trial) for trial in trials]
        try:
            for done, future in enumerate(as_completed(futures), 1):
                future.result()
                if progress is not None:
                    progress(done / len(futures))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        return [future.result() for future in futures]


def _leave_interrupts_to_the_caller() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _motion_figures(motion: FloatArray) -> TrialFigures:
    return TrialFigures(
        roll_rms_rad=_rms(motion[:, 0]),
        level_rms_m=_rms(motion[:, _LEVEL]),
        level_peak_m=float(np.abs(motion[:, _LEVEL]).max()),
    )


def _run_figures(run: LoopRun, tank: Tank, entrant: Entrant) -> TrialFigures:
    ticks = round(entrant.law.sample_time_s / TICK_S)
    short_pa = np.abs(run.command_pa - run.wish_pa)[ticks - 1 :: ticks]
    power_w = run.pressure_pa * tank.reservoir_area_m2 * run.motion[:, _SPEED]
    return dataclasses.replace(
        _motion_figures(run.motion),
        pressure_rms_pa=_rms(run.pressure_pa),
        power_peak_w=float(power_w.max()),
        held_back=float((short_pa > _HELD_BACK * entrant.limits.pressure_pa).mean()),
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
