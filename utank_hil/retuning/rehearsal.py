"""What a law would have done in recorded waves: the record replayed with another law.

What the pump did to the outputs is taken off the record with the ship's model; what is left came
from the waves. The loop is then closed anew on model and waves, through the limiter that stands
between law and pump: in a storm it decides more than the law does. The level it looks at follows
from the roll, measured or not: the water moves by the tank's own equation, the ship's motion being
its input.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.interface import LinearLaw
from utank_hil.control.limits import CommandLimiter
from utank_hil.dynamics.linear import STATES, coupled_matrices
from utank_hil.dynamics.sampling import LinearModel
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank

COMMANDS: Final = 10
"""In a sample time of 0.2 s: the limiter's brake on the level does not wait for the next sample."""
_WATER: Final = [STATES.index("level_m"), STATES.index("level_rate_m_s")]
_SETTLING_S: Final = 60.0  # in which the model forgets that it began at rest
_HIGHEST_RAD_S: Final = 2.5  # above it there are no waves, and differentiation finds noise


class Rehearsal(NamedTuple):
    """Root mean square over the record.

    Attributes
    ----------
    passive_rad : float
        Roll with the pump at zero.
    roll_rad : float
        Roll with the law.
    pressure_pa : float
        Pressure of the law, limited.
    """

    passive_rad: float
    roll_rad: float
    pressure_pa: float


class RecordedWaves:
    """The waves of a record, to rehearse laws in.

    Parameters
    ----------
    record : ndarray, shape (N, 1 + m)
        Command and outputs; gaps are NaN.
    plant : DesignPlant
        Of the record.
    measured : tuple of str
        The outputs by name, ``roll_rad`` among them.
    sample_time_s : float
        Of the record.
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
        self._plant = plant.sampled(STATES, sample_time_s / COMMANDS)
        slow = plant.sampled(STATES, sample_time_s)
        pushed = _response(slow, np.nan_to_num(record[:, 0]))[:, self._measured]
        waves = record[:, 1:] - pushed
        # through a gap the waves are taken as they were
        here = np.isfinite(waves).all(axis=1)
        last = np.maximum.accumulate(np.where(here, np.arange(len(waves)), 0))
        waves = np.nan_to_num(waves[last])
        self._waves = waves - waves.mean(axis=0)
        roll_rad = self._waves[:, self._roll]
        self._levels = tank_motion(plant.ship, plant.tank, roll_rad, sample_time_s, COMMANDS)
        self._first = min(round(_SETTLING_S / sample_time_s), len(record) // 2)

    def rehearse(self, law: LinearLaw) -> Rehearsal:
        """Let a law of one input meet the waves.

        Parameters
        ----------
        law : LinearLaw
            For the record's outputs at its sample time.
        """
        plant, controller = self._plant, law.controller()
        limiter = CommandLimiter(self._limits, self._tank, plant.dt)
        state = np.zeros(len(plant.A))
        sums = np.zeros(2)
        for k, (waves, levels) in enumerate(
            zip(self._waves, self._levels.reshape(len(self._waves), COMMANDS, 2), strict=True)
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
        return Rehearsal(
            float(np.sqrt(np.mean(self._waves[self._first :, self._roll] ** 2))),
            math.sqrt(roll_square),
            math.sqrt(pressure_square),
        )


def tank_motion(
    ship: RollShip, tank: Tank, roll_rad: FloatArray, sample_time_s: float, finer: int = 1
) -> FloatArray:
    """Level and its rate that a roll drives in the passive tank, shape (N finer, 2).

    The second row of the coupled equations, with the first's motion given, in the frequency domain;
    true after the tank's own swing has died away. Between the samples it is the band-limited
    interpolation.
    """
    mass, damping, stiffness = coupled_matrices(ship, tank)
    s = 2j * np.pi * np.fft.rfftfreq(len(roll_rad), sample_time_s)
    driven, own = (
        mass[1, column] * s**2 + damping[1, column] * s + stiffness[1, column] for column in (0, 1)
    )
    level = np.where(np.abs(s) < _HIGHEST_RAD_S, -driven / own * np.fft.rfft(roll_rad), 0.0)
    samples = finer * len(roll_rad)
    return np.column_stack([finer * np.fft.irfft(part, samples) for part in (level, s * level)])


def _response(plant: LinearModel, command: FloatArray) -> FloatArray:
    state = np.zeros(len(plant.A))
    outputs = np.empty((len(command), len(plant.C)))
    for k, value in enumerate(command):
        outputs[k] = plant.C @ state + plant.D[:, 0] * value
        state = plant.A @ state + plant.B[:, 0] * value
    return outputs
