"""A controller on the linear ship, without bus and nodes: for long runs in many seas.

The ship's motion is that with the tank passive, known exactly, plus what the pump adds. Sensors,
limiter and drive run at the base tick of 10 ms, the level observer and the level gauges every
second tick, the controller at its own sample time, in the order of the controller node.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.control.interface import Controller
from utank_hil.control.level_observer import LevelObserver
from utank_hil.control.limits import CommandLimiter, PumpLimits
from utank_hil.dynamics.linear import STATES, state_matrices
from utank_hil.dynamics.sampling import transition_and_step
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
from utank_hil.sea import Harmonics

TICK_S = 0.01
_LEVEL, _SPEED = STATES.index("level_m"), STATES.index("level_rate_m_s")


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """Standard deviations of white noise on the sensors; of the two level gauges' mean.

    Attributes
    ----------
    roll_rad, roll_rate_rad_s, level_m, pressure_pa : float
    """

    roll_rad: float = 2e-4
    roll_rate_rad_s: float = 5e-4
    level_m: float = 3.5e-3
    pressure_pa: float = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class LoopRun:
    """What happened, every tick.

    Attributes
    ----------
    motion : ndarray, shape (n, 4)
        `STATES`.
    pressure_pa, command_pa : ndarray, shape (n,)
        Actual pressure, and the command before delay and lag.
    """

    motion: FloatArray
    pressure_pa: FloatArray
    command_pa: FloatArray


def passive_motion(
    ship: RollShip, tank: Tank, wave_moment: Harmonics, step_s: float, count: int
) -> FloatArray:
    """Motion of ship and passive tank from rest, exact whatever the step.

    Parameters
    ----------
    ship : RollShip
    tank : Tank
    wave_moment : Harmonics
        In N m.
    step_s : float
    count : int

    Returns
    -------
    ndarray, shape (count, 4)
        `STATES` at 0, step_s, 2 step_s, ...
    """
    a, b = state_matrices(ship, tank)
    wave = b[:, 1:]
    omega = wave_moment.frequency_rad_s
    resolvent = 1j * omega[:, None, None] * np.eye(len(a)) - a
    answer = np.linalg.solve(resolvent, wave.astype(complex)[None])[:, :, 0]
    answer = answer * (wave_moment.amplitude * np.exp(1j * wave_moment.phase_rad))[:, None]
    steady = np.column_stack(
        [
            Harmonics(np.abs(column), omega, np.angle(column)).series(step_s, count)
            for column in answer.T
        ]
    )
    # the free motion that makes it start at rest, in modes
    values, modes = np.linalg.eig(a)
    start = np.linalg.solve(modes, -steady[0].astype(complex))
    free = np.exp(np.outer(step_s * np.arange(count), values)) * start @ modes.T
    return np.asarray(steady + free.real)


def simulate_loop(
    ship: RollShip,
    tank: Tank,
    wave_motion: FloatArray,
    controller: Controller,
    measured: tuple[str, ...],
    limits: PumpLimits,
    *,
    delay_s: float = 0.05,
    lag_s: float = 0.1,
    noise: SensorNoise | None = None,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> LoopRun:
    """Run a controller, armed from the start.

    Parameters
    ----------
    ship : RollShip
    tank : Tank
    wave_motion : ndarray, shape (n, 4)
        From `passive_motion` with a step of `TICK_S`.
    controller : Controller
    measured : tuple of str
        Outputs that it sees, in its order.
    limits : PumpLimits
    delay_s : float
        From measurement to effect at the drive, a whole number of ticks.
    lag_s : float
        Of the drive.
    noise : SensorNoise, optional
    seed : int
        Of the noise.
    progress : callable, optional
        Told the finished share now and then.

    Raises
    ------
    ValueError
        If delay or sample time are no whole number of ticks.
    """
    delay_ticks = _ticks("delay_s", delay_s)
    sample_ticks = _ticks("sample_time_s", controller.sample_time_s)
    noise = noise or SensorNoise()
    a, b = state_matrices(ship, tank)
    pressure_effect = b[:, :1]
    n = len(STATES)
    lagged = np.block([[a, pressure_effect], [np.zeros((1, n)), np.full((1, 1), -1 / lag_s)]])
    transition, step = transition_and_step(
        lagged, np.append(np.zeros(n), 1 / lag_s)[:, None], TICK_S
    )
    effect = step[:, 0]
    size = np.array([noise.roll_rad, noise.roll_rate_rad_s, noise.level_m, 0.0, noise.pressure_pa])
    errors = np.random.default_rng(seed).standard_normal((len(wave_motion), n + 1)) * size
    columns = [STATES.index(name) for name in measured]
    observer = LevelObserver(tank, 2 * TICK_S)
    limiter = CommandLimiter(limits, tank, TICK_S)
    history = np.empty((len(wave_motion), n + 1))
    commands = np.zeros(len(wave_motion) + delay_ticks)
    state, seen, applied = np.zeros(n + 1), np.zeros(n + 1), np.zeros(1)
    wish_pa = 0.0
    for k, waves in enumerate(wave_motion):
        history[k] = state
        history[k, :n] += waves
        np.add(history[k], errors[k], out=seen)
        if k % 2 == 0:
            observer.update(float(seen[_LEVEL]), float(seen[n]))
        if k % sample_ticks == 0:
            if k:
                applied[0] = limiter.mean_since_last_call()
                controller.applied(applied)
            seen[_SPEED] = observer.rate_m_s
            wish_pa = float(controller.step(seen[columns])[0])
        commands[k + delay_ticks] = limiter.limit(wish_pa, observer.level_m, observer.rate_m_s)
        state = transition.dot(state)
        state += effect * commands[k]
        if progress is not None and k % 10_000 == 0:
            progress(k / len(wave_motion))
    return LoopRun(history[:, :n], history[:, n], commands[delay_ticks:])


def _ticks(name: str, time_s: float) -> int:
    ticks = round(time_s / TICK_S)
    if abs(ticks * TICK_S - time_s) > 1e-9:
        raise ValueError(f"{name} must be a whole number of ticks of {TICK_S} s, got {time_s}")
    return ticks
