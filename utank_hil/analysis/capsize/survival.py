"""Who capsizes, when, and in what wave: sampled controllers on the nonlinear model, thesis 4.5.

The ship starts at rest and upright, the wave moment is M cos(w t) from the first instant on. The
controller is stepped with the true roll, roll rate, level and level rate; its pressure, brought
within the pump's limits, or the loss of its valve, acts at once and is held. For the ship with a
passive tank or none `utank_hil.analysis.capsize.threshold` does the same, many ships at a time.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.control.interface import Controller
from utank_hil.control.limits import CommandLimiter
from utank_hil.dynamics.nonlinear import RollModel
from utank_hil.dynamics.simulate import WaveMoment, whole_steps


class Survival(NamedTuple):
    """What became of a ship.

    Attributes
    ----------
    capsized_s : float
        Infinite if she did not.
    max_roll_rad, max_level_m : float
        Greatest at the controller's samples.
    max_command : float
        Greatest pressure in Pa, or greatest valve loss.
    strikes : int
        How often the water struck a limit of its level.
    """

    capsized_s: float
    max_roll_rad: float
    max_level_m: float
    max_command: float
    strikes: int


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

    Parameters
    ----------
    model : RollModel
    controller : Controller
        Measured: roll, roll rate, level, level rate; one command.
    wave : WaveMoment
        One sea, arrays of shape (m,).
    duration_s : float
        A whole number of the controller's samples.
    limiter : CommandLimiter, optional
        Between controller and pump, its period the controller's sample time; none for a pump
        without limits, or a valve.
    initial : ndarray, shape (4,), optional
        Upright and at rest if not given.
    valve : bool
        The command is a valve's loss (`semi_active`), not a pump's pressure.
    step_s : float
        Of the integration; the sample time is a whole number of these.
    capsize_rad : float
        Roll angle at which the run ends.
    each_step : callable, optional
        Told time, state and command at every sample.

    Returns
    -------
    Survival

    Raises
    ------
    ValueError
        If times are no whole numbers of each other.
    """
    from utank_hil.dynamics import kernels

    hold = whole_steps("sample time", controller.sample_time_s, step_s)
    samples = whole_steps("duration_s", duration_s, controller.sample_time_s)
    state = np.zeros(4) if initial is None else np.array(initial, dtype=np.float64)
    coefficients = np.array(model.coefficients)
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
            coefficients,
            1 / model.restoring.piece_rad,
            model.restoring.coefficients_nm,
            amplitude,
            frequency,
            phase,
            inputs[0],
            inputs[1],
            hold,
            capsize_rad,
            k * hold,
            hold,
            step_s,
            state,
            summary,
            impacts,
            nowhere,
            hold,
        )
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
    """Greatest wave moment amplitude survived, by bisection.

    The survivable amplitudes need not form one interval; bisection finds one of their borders.

    Parameters
    ----------
    survives : callable
        Whether the ship survives an amplitude.
    highest_nm : float
        Where the search starts.
    tolerance : float
        Width of the last bracket over the amplitude.

    Returns
    -------
    float
        Survived; infinite if `highest_nm` is.
    """
    if survives(highest_nm):
        return math.inf
    low, high = 0.0, highest_nm
    while high - low > tolerance * high:
        middle = (low + high) / 2
        low, high = (middle, high) if survives(middle) else (low, middle)
    return low
