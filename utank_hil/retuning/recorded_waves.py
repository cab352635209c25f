"""Simulation of a law in the waves of a record.

The pump's part of the outputs is computed with the ship's model and subtracted; the rest is due to
the waves. The loop is then closed on model and waves, with the limiter between law and pump, which
in a storm has more influence than the law. The limiter's level is always computed from the roll,
with the tank's equation of motion.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control import CommandLimiter, DesignPlant, LinearLaw
from utank_hil.dynamics import STATES, LinearModel, RollShip, Tank, coupled_matrices

SUBSTEPS: Final = 10
"""Limiter steps in a sample time of the law: the level barrier acts between samples as well."""
_WATER: Final = [STATES.index("level_m"), STATES.index("level_rate_m_s")]
_SETTLING_S: Final = 60.0  # The transient of the start at rest is left out of the RMS.
_HIGHEST_RAD_S: Final = 2.5  # Above this there are no waves, and differentiation amplifies noise.


class RmsResponse(NamedTuple):
    """Root mean squares of passive roll, roll with the law, and the law's limited pressure."""

    passive_roll_rad: float
    roll_rad: float
    pressure_pa: float


class RecordedWaves:
    """The wave-induced part of a record, as a disturbance to simulate laws with.

    `record`, shape (N, 1 + m), has command and outputs; gaps are NaN. `plant` is ship, tank, loop
    and limits at the time of the record; `measured` names the outputs, ``roll_rad`` among them.
    """

    def __init__(
        self,
        record: FloatArray,
        plant: DesignPlant,
        measured: tuple[str, ...],
        sample_time_s: float,
    ) -> None:
        self._limits, self._tank = plant.limits, plant.tank
        self._measured = [STATES.index(name) for name in measured]
        self._roll = measured.index("roll_rad")
        self._plant = plant.sampled(STATES, sample_time_s / SUBSTEPS)
        slow = plant.sampled(STATES, sample_time_s)
        pump_response = _response(slow, np.nan_to_num(record[:, 0]))[:, self._measured]
        waves = record[:, 1:] - pump_response
        # Gaps hold the last value.
        here = np.isfinite(waves).all(axis=1)
        last = np.maximum.accumulate(np.where(here, np.arange(len(waves)), 0))
        waves = np.nan_to_num(waves[last])
        self._waves = waves - waves.mean(axis=0)
        roll_rad = self._waves[:, self._roll]
        self._levels = tank_motion(plant.ship, plant.tank, roll_rad, sample_time_s, SUBSTEPS)
        self._first = min(round(_SETTLING_S / sample_time_s), len(record) // 2)

    def simulate(self, law: LinearLaw) -> RmsResponse:
        """Simulate the closed loop of a law for the record's outputs and sample time."""
        plant, controller = self._plant, law.controller()
        limiter = CommandLimiter(self._limits, self._tank, plant.dt)
        state = np.zeros(len(plant.A))
        sums = np.zeros(2)
        for k, (waves, levels) in enumerate(
            zip(self._waves, self._levels.reshape(len(self._waves), SUBSTEPS, 2), strict=True)
        ):
            applied = np.full(1, limiter.mean_since_last_call())
            y = (plant.C @ state + plant.D[:, 0] * limiter.command_pa)[self._measured] + waves
            controller.applied(applied)
            desired_pa = float(controller.step(y)[0])
            for level_m, rate_m_s in levels.tolist():
                command_pa = limiter.command_pa
                water = plant.C[_WATER] @ state + plant.D[_WATER, 0] * command_pa
                state = plant.A @ state + plant.B[:, 0] * command_pa
                limiter.limit(desired_pa, level_m + float(water[0]), rate_m_s + float(water[1]))
            if k >= self._first:
                sums += y[self._roll] ** 2, applied[0] ** 2
        samples = max(1, len(self._waves) - self._first)
        roll_square, pressure_square = (sums / samples).tolist()
        return RmsResponse(
            float(np.sqrt(np.mean(self._waves[self._first :, self._roll] ** 2))),
            math.sqrt(roll_square),
            math.sqrt(pressure_square),
        )


def tank_motion(
    ship: RollShip, tank: Tank, roll_rad: FloatArray, sample_time_s: float, substeps: int = 1
) -> FloatArray:
    """Level (m) and level rate (m/s) of the passive tank for a given roll, shape (N substeps, 2).

    The linear model's level equation is solved in the frequency domain: the steady-state response,
    without transient, band-limited between samples.
    """
    mass, damping, stiffness = coupled_matrices(ship, tank)
    s = 2j * np.pi * np.fft.rfftfreq(len(roll_rad), sample_time_s)
    coupling, level_dynamics = (
        mass[1, column] * s**2 + damping[1, column] * s + stiffness[1, column] for column in (0, 1)
    )
    level = np.where(
        np.abs(s) < _HIGHEST_RAD_S, -coupling / level_dynamics * np.fft.rfft(roll_rad), 0.0
    )
    samples = substeps * len(roll_rad)
    return np.column_stack([substeps * np.fft.irfft(part, samples) for part in (level, s * level)])


def _response(plant: LinearModel, command: FloatArray) -> FloatArray:
    state = np.zeros(len(plant.A))
    outputs = np.empty((len(command), len(plant.C)))
    for k, value in enumerate(command):
        outputs[k] = plant.C @ state + plant.D[:, 0] * value
        state = plant.A @ state + plant.B[:, 0] * value
    return outputs
