"""The predictive laws that the thesis prints in section 3.8, and the same laws designed here.

Two misprints are put right: u(k-2) of DPC (roll, level) reads -2.9047e-2, and the roll gains of GPC
(roll, level) read e8. The "h" that is fed back is a tank angle h / (L/2). The laws have no delay
besides the sample: u(k) is made of y(k-1) and acts over [k, k+1).

The sixteen roll gains come from one ARX(4) model, `PRINTED_ARX`, which is not that of the printed
ship: its reservoirs' area, 17.11 m^2, looks like the width, 17.1 m (docs/control.md).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from utank_hil.analysis.loop.closed_loop import closed_loop_response
from utank_hil.base.arrays import FloatArray
from utank_hil.control.arx import ARX
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.interface import LinearLaw
from utank_hil.control.optimal_tank import ship_ratios
from utank_hil.control.predictive.gains import design_dpc, design_gpc
from utank_hil.control.predictive.law import PredictiveLaw
from utank_hil.dynamics.linear import STATES, pump_model
from utank_hil.dynamics.sampling import LinearModel, transition_and_step
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank

SAMPLE_TIME_S: Final = 0.2
FREQUENCY_RATIOS: Final = np.linspace(0.01, 2.0, 2000)  #: The source does not say how far it went.
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


def performance_index(law: LinearLaw, plant: DesignPlant, measured: tuple[str, ...]) -> float:
    """Yardstick of Fig. 3.10 in rad/Pa: roll taken from the passive tank per pressure.

    ::

        J = int | |phi_OL(q)| - |phi_CL(q)| | / |u_CL(q)| dq,    q = wave / roll frequency

    phi_OL with the passive tank and phi_CL, u_CL with the law, all per wave moment. The difference
    is one of amplitudes: that of the complex answers is the same for every law, since
    phi_CL - phi_OL is what the pressure u_CL does to the ship.

    Parameters
    ----------
    plant : DesignPlant
        The thesis has a lag of 0 and, since its u(k) is made of y(k-1), a delay of one sample.
    measured : tuple of str
        Names of the outputs that the law sees, in its order.
    """
    w = FREQUENCY_RATIOS * ship_ratios(plant.ship, plant.tank)[1]
    row = STATES.index("roll_rad")
    passive, _ = closed_loop_response(None, plant, measured, w)
    active, pressure = closed_loop_response(law, plant, measured, w)
    gain = np.abs(np.abs(passive[:, row]) - np.abs(active[:, row])) / np.abs(pressure)
    return float(np.sum((gain[1:] + gain[:-1]) / 2 * np.diff(FREQUENCY_RATIOS)))


def source_index(
    law: PredictiveLaw, ship: RollShip, tank: Tank, measured: tuple[str, ...]
) -> float:
    """Performance index in the source's timing: a sample of delay and no lag; rad/Pa."""
    return performance_index(law, DesignPlant(ship, tank, SAMPLE_TIME_S, 0.0), measured)


def _relative(mine: FloatArray, printed: tuple[float, ...]) -> list[float]:
    return list((mine / np.array(printed) - 1).tolist())
