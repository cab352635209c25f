"""Runs of Patti-B with the laws of section 4.5: histories, and who capsizes in which wave."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from tools.thesis.capsize import (
    LAWS,
    PATTI_B,
    PRINTED_NM,
    WAVE_RAD_S,
    Contest,
    Survival,
    contest,
    controlled_run,
    law_factory,
    without_tank,
)
from tools.thesis.figure import Check, Figure, Table, Verdict
from tools.thesis.simulate import WaveMoment
from utank_hil.base.arrays import FloatArray
from utank_hil.control.fuzzy.adaptive import DirectFuzzyController
from utank_hil.control.interface import Controller
from utank_hil.dynamics import RollModel

NO_TANK, PASSIVE, LINEARIZED, _, SMALL_GAIN, ROBUST, _ = LAWS
WEAK_NM, MIDDLE_NM, PASSIVE_NM, STRONG_NM = PRINTED_NM
DURATION_S: Final = 300.0
OPEN: Final = (
    "Lz, friction, pump and the laws' parameters are not given: Lz = 0, damping ratio 0.10, "
    "reservoirs of ±2 m, a pump without limits, wave M cos(0.6 t) from rest; parameters as in "
    "`tools.thesis.capsize`. Other Lz, frictions and phases: group `capsize`."
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


CONTROLLED: Final = (LINEARIZED, SMALL_GAIN, ROBUST)
PUMPS_PA: Final = (math.inf, 100e3, 20e3)


def figure_contest() -> Figure:
    """Every law in the printed waves, and the greatest that it survives."""
    found = {
        (law, pump): contest(law, pump)
        for pump in PUMPS_PA
        for law in LAWS
        if law != NO_TANK or math.isinf(pump)  # the same with any pump
    }
    largest = {entry: each.survivable_nm for entry, each in found.items()}
    bare, passive = (largest[law, math.inf] for law in (NO_TANK, PASSIVE))
    controlled = [largest[law, math.inf] for law in CONTROLLED]
    small = {law: largest[law, PUMPS_PA[-1]] for law in LAWS if law != NO_TANK}
    return Figure(
        "nonlinear model, M cos(0.6 t) from rest for 300 s, laws sampled at 20 ms without delay; "
        "the greatest wave survived by bisection",
        "Lz, friction, pump and the laws' parameters are not given: Lz = 0, damping ratio 0.10, "
        "reservoirs of ±2 m. A limited pump has ten times its pressure a second and the level "
        "barrier at 1.9 m, with the passive law too; the fuzzy laws have lower gains then.",
        table=Table(
            (
                "pump",
                "law",
                *(f"{amplitude / 1e3:.1f} kN m" for amplitude in PRINTED_NM),
                "greatest survived, kN m",
                "greatest pressure, kPa",
                "strikes",
            ),
            tuple(_cells(law, pump, each) for (law, pump), each in found.items()),
        ),
        checks=(
            Check(
                "in rising order of the wave survived: no tank, passive tank, controlled tank",
                Verdict.of(bare < passive < min(controlled)),
                f"unlimited pump: {bare / 1e3:.0f}, {passive / 1e3:.0f}, "
                + " and ".join(f"{value / 1e3:.0f}" for value in controlled)
                + " kN m ((4.11), (4.20), (4.23))",
            ),
            Check(
                "so it is with a pump that the boat can carry",
                Verdict.of(small[PASSIVE] < min(small[law] for law in CONTROLLED)),
                f"{PUMPS_PA[-1] / 1e3:.0f} kPa: "
                + ", ".join(f"{law} {value / 1e3:.0f} kN m" for law, value in small.items()),
            ),
        ),
    )


def _cells(law: str, pump_pa: float, found: Contest) -> tuple[str, ...]:
    """One law with one pump; pressure and strikes of the runs survived."""
    alive: list[Survival] = [run for run in found.runs if math.isinf(run.capsized_s)]
    pressure_pa = max((run.max_command for run in alive), default=0.0)
    return (
        "unlimited" if math.isinf(pump_pa) else f"{pump_pa / 1e3:g} kPa",
        law,
        *(told(run) for run in found.runs),
        f"{found.survivable_nm / 1e3:.1f}",
        f"{pressure_pa / 1e3:.0f}" if pressure_pa else "",
        "yes" if any(run.strikes for run in alive) else "",
    )
