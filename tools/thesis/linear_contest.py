"""The laws of Fig. 3.6 to 3.10 on one ship, in the timing of the source.

u(k) is made of y(k-1) and acts over [k, k+1), 0.2 s; PD and LQR feed back the newest state.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from tools.thesis.printed_laws import (
    DPC_BOTH,
    DPC_ROLL,
    GPC_BOTH,
    GPC_ROLL,
    PRINTED,
    SAMPLE_TIME_S,
    held_model,
)
from utank_hil.analysis.loop.closed_loop import closed_loop_radius, closed_loop_response
from utank_hil.base.arrays import FloatArray
from utank_hil.control import DesignPlant
from utank_hil.control.gain import GainLaw
from utank_hil.control.interface import Controller, LinearLaw
from utank_hil.control.lqg import design_lqr
from utank_hil.control.optimal_tank import ship_ratios
from utank_hil.control.pd import PD_MEASURED, design_pd
from utank_hil.control.predictive.law import PredictiveLaw
from utank_hil.dynamics.linear import STATES, pump_model, state_matrices
from utank_hil.dynamics.sampling import sample, transition_and_step
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank

PD, LQR, PASSIVE = "PD", "LQR", "passive"
ROLL_ONLY: Final = (PASSIVE, PD, GPC_ROLL, DPC_ROLL)
WHOLE: Final = (PASSIVE, LQR, GPC_BOTH, DPC_BOTH)
LQR_WEIGHT: Final = 1e14
PD_SAMPLE_S: Final = 0.02
STEP_S: Final = 0.02


@dataclass(frozen=True, slots=True)
class Entrant:
    """A law on a ship."""

    law: GainLaw | PredictiveLaw
    measured: tuple[str, ...]
    delay_s: float  #: From measurement to effect.


@dataclass(frozen=True, slots=True)
class Response:
    """A law's answer to waves over the frequency ratio q."""

    ratio: FloatArray  #: shape (n,)
    roll: FloatArray  #: shape (n,): per static roll.
    pressure_pa: FloatArray  #: shape (n,): per rad of static roll.


def lqr_on_roll(ship: RollShip, tank: Tank) -> Entrant:
    """LQR with the printed weight on roll alone, as GPC has it: this gives the printed index."""
    return _lqr(ship, tank, np.diag([LQR_WEIGHT, 0.0, 0.0, 0.0]))


def lqr_as_printed(ship: RollShip, tank: Tank) -> Entrant:
    """LQR with the printed weight on all four states: roll, tank angle, and their rates."""
    per_metre = (2 / tank.width_m) ** 2
    return _lqr(ship, tank, LQR_WEIGHT * np.diag([1.0, 1.0, per_metre, per_metre]))


def _lqr(ship: RollShip, tank: Tank, weight: FloatArray) -> Entrant:
    return Entrant(design_lqr(held_model(ship, tank, STATES), weight), STATES, 0.0)


def entrants(ship: RollShip, tank: Tank) -> dict[str, Entrant]:
    """PD and LQR designed for the ship, and the four predictive laws as printed."""
    found = {
        PD: Entrant(design_pd(ship, tank, PD_SAMPLE_S), PD_MEASURED, 0.0),
        LQR: lqr_on_roll(ship, tank),
    }
    for name, printed in PRINTED.items():
        found[name] = Entrant(printed.law(tank), printed.measured, SAMPLE_TIME_S)
    return found


def radius(ship: RollShip, tank: Tank, entrant: Entrant) -> float:
    """Greatest eigenvalue of the closed loop; below one it is stable."""
    model = pump_model(ship, tank, entrant.measured)
    return closed_loop_radius(
        entrant.law, sample(model, entrant.law.sample_time_s, entrant.delay_s, 0.0)
    )


def responses(
    ship: RollShip, tank: Tank, laws: Mapping[str, Entrant], ratio: FloatArray
) -> dict[str, Response]:
    """Answers of the passive tank and of all laws, exact for the sampled loop."""
    w = ratio * ship_ratios(ship, tank)[1]
    row = STATES.index("roll_rad")
    stiffness = ship.stiffness_nm_rad
    found = {}
    everyone: dict[str, tuple[LinearLaw | None, tuple[str, ...], float]] = {
        PASSIVE: (None, ("roll_rad",), 0.0)
    }
    everyone |= {name: (each.law, each.measured, each.delay_s) for name, each in laws.items()}
    for name, (law, measured, delay_s) in everyone.items():
        motion, pressure = closed_loop_response(
            law, DesignPlant(ship, tank, delay_s, 0.0), measured, w
        )
        found[name] = Response(
            ratio, stiffness * np.abs(motion[:, row]), stiffness * np.abs(pressure)
        )
    return found


@dataclass(frozen=True, slots=True)
class History:
    """A run in a regular wave."""

    #: time_s, roll_rad, level_m, pressure_pa: shape (n,)
    time_s: FloatArray
    roll_rad: FloatArray
    level_m: FloatArray
    pressure_pa: FloatArray


def regular_wave_run(
    ship: RollShip,
    tank: Tank,
    entrant: Entrant | None,
    moment_nm: float,
    wave_rad_s: float,
    duration_s: float,
) -> History:
    """Linear ship from rest in a moment M sin(w t); the law is on from the start.

    The moment is held over each step at its middle value.

    The entrant's delay is none or one sample, and its sample time a whole number of steps; None is
    the passive tank.
    """
    a, b = transition_and_step(*state_matrices(ship, tank), STEP_S)
    count = round(duration_s / STEP_S)
    wave = moment_nm * np.sin(wave_rad_s * STEP_S * (np.arange(count) + 0.5))
    controller: Controller | None = None
    columns: list[int] = []
    every, late = count + 1, False
    if entrant is not None:
        controller = entrant.law.controller()
        columns = [STATES.index(name) for name in entrant.measured]
        every, late = round(controller.sample_time_s / STEP_S), entrant.delay_s > 0
    state, states = np.zeros(len(STATES)), np.empty((count, len(STATES)))
    pressure, seen = np.zeros(count), np.zeros(len(columns))
    held = 0.0
    for k in range(count):
        states[k] = state
        if controller is not None and k % every == 0:
            now = state[columns]
            held = float(controller.step(seen if late else now)[0])
            seen = now
        pressure[k] = held
        state = a @ state + b @ (held, wave[k])
    time_s = np.arange(count, dtype=np.float64) * STEP_S
    return History(time_s, states[:, 0], states[:, 2], pressure)
