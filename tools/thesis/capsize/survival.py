"""Capsizing with sampled controllers on the nonlinear model, thesis 4.5.

The ship starts at rest and upright; the wave moment is M cos(w t) from t = 0 on. The controller
gets the true roll, roll rate, level and level rate. Its pressure, limited, or its valve loss acts
without delay and is held. `tools.thesis.capsize.threshold` does the same for batches of ships
with a passive tank or none.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control.interface import Controller
from utank_hil.control.limiter import CommandLimiter
from utank_hil.dynamics.nonlinear import RollModel
from utank_hil.dynamics.simulate import WaveMoment, whole_steps


class Survival(NamedTuple):
    """Result of a run."""

    capsized_s: float  #: Time of capsizing, infinite if the ship survives.
    #: max_roll_rad, max_level_m: maxima at the controller's samples.
    max_roll_rad: float
    max_level_m: float
    max_command: float  #: Largest pressure in Pa, or largest valve loss in Pa / (m/s)^2.
    strikes: int  #: Number of impacts at the limits of the level.


def controlled_run(
    model: RollModel,
    controller: Controller,
    wave: WaveMoment,
    duration_s: float,
    *,
    limiter: CommandLimiter | None = None,
    initial: FloatArray | None = None,
    valve: bool = False,
    step_s: float = 0.02,
    capsize_rad: float = math.pi / 2,
    each_step: Callable[[float, FloatArray, float], None] | None = None,
) -> Survival:
    """Run a controller on the nonlinear model.

    Raises `ValueError` if the duration is not a whole number of samples, or the sample time of
    steps.

    The controller sees roll, roll rate, level and level rate. Its command is a pressure, or with
    `valve` a valve's loss. A `limiter` has the controller's sample time as its period; without one
    the pump has no limits. The run begins upright and at rest unless `initial`, shape (4,), is
    given, and ends at `capsize_rad`. `each_step` takes time, state and command at every sample.
    """
    from utank_hil.dynamics import kernels

    hold = whole_steps("sample time", controller.sample_time_s, step_s)
    samples = whole_steps("duration_s", duration_s, controller.sample_time_s)
    state = np.zeros(4) if initial is None else np.array(initial, dtype=np.float64)
    packed = model.packed
    amplitude, frequency, phase = (np.ascontiguousarray(x, dtype=np.float64) for x in wave)
    summary = np.zeros(kernels.SUMMARY)
    summary[kernels.CAPSIZED_S] = np.inf
    inputs = np.zeros((2, 1))  # pressure, valve loss
    nowhere = np.empty((0, 4))
    impacts = np.empty((0, 5))
    max_command = 0.0
    for k in range(samples):
        command = float(controller.step(state.copy())[0])
        if limiter is not None:
            command = limiter.limit(command, float(state[2]), float(state[3]))
        inputs[int(valve), 0] = command
        controller.applied(inputs[int(valve)].copy())
        max_command = max(max_command, abs(command))
        if each_step is not None:
            each_step(k * controller.sample_time_s, state, command)
        kernels.advance(
            *packed, amplitude, frequency, phase, inputs[0], inputs[1], hold,
            capsize_rad, k * hold, hold, step_s, state, summary, impacts, nowhere, hold,
        )  # fmt: skip
        if math.isfinite(summary[kernels.CAPSIZED_S]):
            break
    return Survival(
        float(summary[kernels.CAPSIZED_S]),
        float(summary[kernels.MAX_ROLL]),
        float(summary[kernels.MAX_LEVEL]),
        max_command,
        int(summary[kernels.STRIKES]),
    )


def largest_survivable_wave(
    survives: Callable[[float], bool], highest_nm: float, tolerance: float = 0.01
) -> float:
    """Largest survived amplitude of the wave moment, by bisection.

    The survived amplitudes need not form one interval; bisection finds one of its ends.

    `survives` takes an amplitude in N m; `tolerance` is the relative width of the final bracket.
    The result is infinite if `highest_nm` is survived.
    """
    if survives(highest_nm):
        return math.inf
    low, high = 0.0, highest_nm
    while high - low > tolerance * high:
        middle = (low + high) / 2
        low, high = (middle, high) if survives(middle) else (low, middle)
    return low
