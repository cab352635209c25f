"""Runs of Patti-B with the laws of section 4.5: histories, and what a fuzzy law learns."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from tools.thesis.capsize.contest import LAWS, PATTI_B, PRINTED_NM, WAVE_RAD_S, law_factory
from tools.thesis.capsize.survival import Survival, controlled_run
from tools.thesis.capsize.threshold import without_tank
from utank_hil.base.arrays import FloatArray
from utank_hil.control.fuzzy.direct import DirectFuzzyController
from utank_hil.control.interface import Controller
from utank_hil.dynamics import RollModel, WaveMoment

NO_TANK, PASSIVE, LINEARIZED, _, SMALL_GAIN, ROBUST, _ = LAWS
WEAK_NM, MIDDLE_NM, PASSIVE_NM, STRONG_NM = PRINTED_NM
DURATION_S: Final = 300.0
OPEN: Final = (
    "Lz, friction, pump and the laws' parameters are not given: Lz = 0, damping ratio 0.10, "
    "reservoirs of ±2 m, a pump without limits, wave M cos(0.6 t) from rest; parameters as in "
    "`tools.thesis.capsize.contest`. Other Lz, frictions and phases: group `capsize`."
)
METHOD: Final = "nonlinear model, compiled simulation, laws sampled at 20 ms without delay"


@dataclass(frozen=True, slots=True)
class Run:
    """One law in one wave."""

    #: time_s, roll_deg, rate_deg_s: shape (n,): to the end, or to capsizing.
    time_s: FloatArray
    roll_deg: FloatArray
    rate_deg_s: FloatArray
    pressure_pa: FloatArray  #: shape (n,)
    parameters: FloatArray  #: shape (n, p): of a direct fuzzy law; p = 0 for others.
    result: Survival


def run(law: str, amplitude_nm: float, duration_s: float = DURATION_S) -> Run:
    """Run one of `LAWS` with an unlimited pump from rest in M cos(0.6 t)."""
    model = without_tank(PATTI_B) if law == NO_TANK else PATTI_B
    wave = WaveMoment([amplitude_nm], [WAVE_RAD_S], [0.0])
    return run_controller(model, law_factory(law, unlimited=True)(), wave, duration_s)


def run_controller(
    model: RollModel,
    controller: Controller,
    wave: WaveMoment,
    duration_s: float = DURATION_S,
    initial: FloatArray | None = None,
) -> Run:
    """Run a controller with an unlimited pump and keep every sample."""
    kept: list[tuple[float, float, float, float]] = []
    learnt: list[tuple[float, ...]] = []

    def keep(time_s: float, state: FloatArray, command: float) -> None:
        kept.append((time_s, math.degrees(state[0]), math.degrees(state[1]), command))
        learnt.append(
            controller.parameters if isinstance(controller, DirectFuzzyController) else ()
        )

    result = controlled_run(model, controller, wave, duration_s, initial=initial, each_step=keep)
    time, roll, rate, pressure = np.array(kept).T
    return Run(time, roll, rate, pressure, np.array(learnt), result)


def told(result: Survival) -> str:
    """Greatest roll, or when it capsized."""
    if math.isfinite(result.capsized_s):
        return f"capsizes at {result.capsized_s:.0f} s"
    return f"{math.degrees(result.max_roll_rad):.1f}°"
