"""What a law would have done in recorded waves: the record replayed with another law.

What the pump did to the outputs is taken off the record with the ship's model; what is left came
from the waves. The loop is then closed anew on model and waves.
"""

import math
from typing import NamedTuple

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.control.interface import LinearLaw
from utank_hil.dynamics.sampling import LinearModel

_SETTLING_S = 60.0  # in which the model forgets that it began at rest


class Rehearsal(NamedTuple):
    """Root mean square over the record.

    Attributes
    ----------
    passive_rad : float
        Roll with the pump at zero.
    roll_rad : float
        Roll with the law.
    pressure_pa : float
        Pressure of the law.
    """

    passive_rad: float
    roll_rad: float
    pressure_pa: float


def rehearse(
    law: LinearLaw, plant: LinearModel, record: FloatArray, roll: int, limit_pa: float
) -> Rehearsal:
    """Replay a record with a law.

    Parameters
    ----------
    law : LinearLaw
        One input.
    plant : LinearModel
        Sampled, from command to the record's outputs.
    record : ndarray, shape (N, 1 + m)
        Command and outputs; gaps are NaN.
    roll : int
        Index of the roll among the outputs.
    limit_pa : float
        Greatest pressure.
    """
    pushed = _response(plant, np.nan_to_num(record[:, 0]))
    waves = record[:, 1:] - pushed
    # through a gap the waves are taken as they were
    here = np.isfinite(waves).all(axis=1)
    last = np.maximum.accumulate(np.where(here, np.arange(len(waves)), 0))
    waves = np.nan_to_num(waves[last])
    waves = waves - waves.mean(axis=0)
    controller = law.controller()
    state = np.zeros(len(plant.A))
    command = 0.0
    first = min(round(_SETTLING_S / plant.dt), len(record) // 2)
    sums = np.zeros(2)
    for k, wave in enumerate(waves):
        y = plant.C @ state + plant.D[:, 0] * command + wave
        state = plant.A @ state + plant.B[:, 0] * command
        controller.applied(np.full(1, command))
        command = min(max(float(controller.step(y)[0]), -limit_pa), limit_pa)
        if k >= first:
            sums += y[roll] ** 2, command**2
    roll_square, pressure_square = (sums / max(1, len(waves) - first)).tolist()
    return Rehearsal(
        float(np.sqrt(np.mean(waves[first:, roll] ** 2))),
        math.sqrt(roll_square),
        math.sqrt(pressure_square),
    )


def _response(plant: LinearModel, command: FloatArray) -> FloatArray:
    state = np.zeros(len(plant.A))
    outputs = np.empty((len(command), len(plant.C)))
    for k, value in enumerate(command):
        outputs[k] = plant.C @ state + plant.D[:, 0] * value
        state = plant.A @ state + plant.B[:, 0] * value
    return outputs
