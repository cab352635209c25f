"""The laws of Fig. 3.6 to 3.10 on one ship, in the timing of the source.

u(k) is made of y(k-1) and acts over [k, k+1), 0.2 s; PD and LQR feed back the newest state.

The predictive laws are those that the thesis prints in section 3.8, with two misprints put right:
u(k-2) of DPC (roll, level) reads -2.9047e-2, and the roll gains of GPC (roll, level) read e8. The
"h" that is fed back is a tank angle h / (L/2). The sixteen roll gains come from one ARX(4) model,
`PRINTED_ARX`, which is not that of the printed ship: its reservoirs' area, 17.11 m², looks like the
width, 17.1 m (docs/control.md).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from utank_hil.analysis.loop.margins import closed_loop_radius, closed_loop_response
from utank_hil.base.arrays import FloatArray
from utank_hil.control.arx import ARX
from utank_hil.control.gain import PD_MEASURED, GainLaw, design_pd
from utank_hil.control.interface import Controller, DesignPlant, LinearLaw
from utank_hil.control.lqg import design_lqr
from utank_hil.control.optimal_tank import ship_ratios
from utank_hil.control.predictive.law import PredictiveLaw, design_dpc, design_gpc
from utank_hil.dynamics.linear import STATES, pump_model, state_matrices
from utank_hil.dynamics.sampling import LinearModel, sample, transition_and_step
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank

SAMPLE_TIME_S: Final = 0.2
GPC_ROLL, DPC_ROLL = "GPC (roll)", "DPC (roll)"
GPC_BOTH, DPC_BOTH = "GPC (roll, level)", "DPC (roll, level)"
PRINTED_ARX: Final = ARX(
    np.array([3.94063822, -5.84238723, 3.86227874, -0.96062268]).reshape(-1, 1, 1),
    np.array([0.0, 0.37109436, -0.35446052, -0.33986517, 0.36613699]).reshape(-1, 1, 1) * 1e-9,
    SAMPLE_TIME_S,
)


@dataclass(frozen=True, slots=True)
class PrintedLaw:
    """One law as it is printed."""

    #: input_gains, roll_gains: newest first; the latter in Pa/rad.
    input_gains: tuple[float, ...]
    roll_gains: tuple[float, ...]
    angle_gains: tuple[float, ...]  #: On the tank angle, Pa/rad; empty where it is not fed back.
    index: float  #: Printed performance index, Fig. 3.10.

    @property
    def measured(self) -> tuple[str, ...]:
        """Outputs that it sees, in the order of `law`."""
        return ("level_m", "roll_rad") if self.angle_gains else ("roll_rad",)

    def law(self, tank: Tank) -> PredictiveLaw:
        """The law on the level in metres, as everywhere in this project."""
        outputs = [np.array(self.roll_gains)]
        if self.angle_gains:
            outputs.insert(0, np.array(self.angle_gains) / (tank.width_m / 2))
        gains = np.stack(outputs, axis=-1)[:, None]
        inputs = np.array(self.input_gains)[:, None, None]
        return PredictiveLaw(inputs, gains, np.zeros((1, 1, len(outputs))), SAMPLE_TIME_S)


PRINTED: Final[Mapping[str, PrintedLaw]] = {
    GPC_ROLL: PrintedLaw(
        (-2.2029e-1, 2.2026, 8.2552e-2, -2.1745),
        (-6.5885e9, 1.8736e10, -1.7859e10, 5.7052e9),
        (),
        578,
    ),
    DPC_BOTH: PrintedLaw(
        (-5.3668e-1, -2.9047e-1), (-4.7209e8, 4.7456e8), (-6.6394e6, 4.0560e6), 500
    ),
    DPC_ROLL: PrintedLaw(
        (-1.5996e-1, 1.6676, -5.3846e-2, -1.7555),
        (-4.9422e9, 1.4438e10, -1.4101e10, 4.6059e9),
        (),
        499,
    ),
    GPC_BOTH: PrintedLaw(
        (-1.8500e-1, -9.5337e-2), (-7.0738e7, 7.1088e7), (-2.7080e6, 2.2912e6), 484
    ),
}


@dataclass(frozen=True, slots=True)
class Deviations:
    """Greatest relative deviations of designed from printed coefficients."""

    roll_only: float  #: Of the 16 coefficients of the laws that see roll alone.
    both: float  #: Of the 8 on inputs and roll of the laws that see the tank angle too.
    angle: float  #: Of the 4 on the tank angle.


def designed_laws(ship: RollShip, tank: Tank) -> dict[str, PredictiveLaw]:
    """The four laws with the horizons and weights of the source, for any ship and tank."""

    def arx(measured: tuple[str, ...], order: int) -> ARX:
        return ARX.from_state_space(held_model(ship, tank, measured), order)

    one, two = arx(PRINTED[GPC_ROLL].measured, 4), arx(PRINTED[GPC_BOTH].measured, 2)
    return {
        GPC_ROLL: design_gpc(one, 50, 50, output_weight=1e14),
        DPC_BOTH: design_dpc(two, 25, 27),
        DPC_ROLL: design_dpc(one, 50, 54),
        GPC_BOTH: design_gpc(two, 25, 25, output_weight=(0.0, 1e14)),
    }


def held_model(ship: RollShip, tank: Tank, measured: tuple[str, ...]) -> LinearModel:
    """Ship and tank sampled with a zero-order hold: u(k) acts over [k, k+1)."""
    pump = pump_model(ship, tank, measured)
    a, b = transition_and_step(pump.A, pump.B, SAMPLE_TIME_S)
    return pump._replace(A=a, B=b, dt=SAMPLE_TIME_S)


def deviations(ship: RollShip, tank: Tank, angle_unit: float = 1.0) -> Deviations:
    """How far the laws designed for a ship and tank are from the printed ones.

    Parameters
    ----------
    angle_unit : float
        Printed unit of the tank angle in radians: 1 if it is h / (L/2) as defined.
    """
    roll_only: list[float] = []
    both: list[float] = []
    angle: list[float] = []
    for name, law in designed_laws(ship, tank).items():
        printed, outputs = PRINTED[name], law.output_gains[:, 0]
        direct = both if printed.angle_gains else roll_only
        direct += _relative(law.input_gains[:, 0, 0], printed.input_gains)
        direct += _relative(outputs[:, -1], printed.roll_gains)
        if printed.angle_gains:
            angle += _relative(outputs[:, 0] * tank.width_m / 2 * angle_unit, printed.angle_gains)
    return Deviations(*(max(map(abs, part)) for part in (roll_only, both, angle)))


def printed_plant() -> LinearModel:
    """The continuous model, from pressure to roll, whose held samples `PRINTED_ARX` predicts.

    With a delay of one sample it is the plant that the printed roll laws stand before.
    """
    from scipy.linalg import logm

    a, b, c, _, _ = PRINTED_ARX.matrices()
    n, inputs = b.shape
    held = np.block([[a, b], [np.zeros((inputs, n)), np.eye(inputs)]])
    whole = logm(held).real / SAMPLE_TIME_S
    return LinearModel(whole[:n, :n], whole[:n, n:], c, np.zeros((1, 1)), 0.0)


def _relative(mine: FloatArray, printed: tuple[float, ...]) -> list[float]:
    return list((mine / np.array(printed) - 1).tolist())


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


def lqr_as_printed(ship: RollShip, tank: Tank) -> Entrant:
    """LQR with the printed weight on all four states: roll, tank angle, and their rates."""
    per_metre = (2 / tank.width_m) ** 2
    return _lqr(ship, tank, LQR_WEIGHT * np.diag([1.0, 1.0, per_metre, per_metre]))


def _lqr(ship: RollShip, tank: Tank, weight: FloatArray) -> Entrant:
    return Entrant(design_lqr(held_model(ship, tank, STATES), weight), STATES, 0.0)


def entrants(ship: RollShip, tank: Tank) -> dict[str, Entrant]:
    """PD and LQR designed for the ship, and the four predictive laws as printed.

    LQR has the printed weight on roll alone, as GPC has it: this gives the printed index.
    """
    found = {
        PD: Entrant(design_pd(ship, tank, PD_SAMPLE_S), PD_MEASURED, 0.0),
        LQR: _lqr(ship, tank, np.diag([LQR_WEIGHT, 0.0, 0.0, 0.0])),
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
