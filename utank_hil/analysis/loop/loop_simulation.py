"""A controller on the linear ship, without bus and nodes: for long runs in many seas.

The ship's motion is that with the tank passive, known exactly, plus what the pump adds. Sensors,
limiter and drive run every tick, level gauges and level observer every `LEVEL_TICKS`, the
controller at its own sample time. Their order within a tick is that of the controller node.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.tick import TICK_S
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.interface import Controller
from utank_hil.control.level_observer import LevelObserver
from utank_hil.control.limiter import CommandLimiter
from utank_hil.dynamics.linear import STATES, state_matrices
from utank_hil.dynamics.sampling import transition_and_step
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
from utank_hil.sea import Harmonics

LEVEL_TICKS: Final = 2
"""Cycle of SENSOR_TANK, in ticks."""
_LEVEL, _SPEED = STATES.index("level_m"), STATES.index("level_rate_m_s")


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """Standard deviations of white noise on the sensors; of the two level gauges' mean."""

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
    pressure_pa, command_pa, wish_pa : ndarray, shape (n,)
        Actual pressure, the command before delay and lag, and what the controller asked for.
    """

    motion: FloatArray
    pressure_pa: FloatArray
    command_pa: FloatArray
    wish_pa: FloatArray


def passive_motion(
    ship: RollShip, tank: Tank, wave_moment: Harmonics, step_s: float, count: int
) -> FloatArray:
    """Motion of ship and passive tank from rest, exact whatever the step.

    Parameters
    ----------
    wave_moment : Harmonics
        In N m.

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
    plant: DesignPlant,
    wave_motion: FloatArray,
    controller: Controller,
    measured: tuple[str, ...],
    *,
    pump_gain: float = 1.0,
    noise: SensorNoise | None = None,
    seed: int = 0,
) -> LoopRun:
    """Run a controller, armed from the start.

    Parameters
    ----------
    plant : DesignPlant
        Its delay must be a whole number of ticks.
    wave_motion : ndarray, shape (n, 4)
        From `passive_motion` with a step of `TICK_S`.
    measured : tuple of str
        Outputs that it sees, in its order.
    pump_gain : float
        Pressure that a command of 1 Pa ends in.
    seed : int
        Of the noise.

    Raises
    ------
    ValueError
        If delay or sample time are no whole number of ticks.
    """
    delay_ticks = _ticks("delay_s", plant.delay_s)
    sample_ticks = _ticks("sample_time_s", controller.sample_time_s)
    noise = noise or SensorNoise()
    lag_s = plant.lag_s
    a, b = state_matrices(plant.ship, plant.tank)
    pressure_effect = b[:, :1]
    n = len(STATES)
    lagged = np.block([[a, pressure_effect], [np.zeros((1, n)), np.full((1, 1), -1 / lag_s)]])
    transition, step = transition_and_step(
        lagged, np.append(np.zeros(n), pump_gain / lag_s)[:, None], TICK_S
    )
    advance = np.hstack([transition, step])
    size = np.array([noise.roll_rad, noise.roll_rate_rad_s, noise.level_m, 0.0, noise.pressure_pa])
    count = len(wave_motion)
    # what the sensors show beyond the pump's own effect
    shown = np.random.default_rng(seed).standard_normal((count, n + 1)) * size
    shown[:, :n] += wave_motion
    level_shown, pressure_shown = shown[:, _LEVEL].tolist(), shown[:, n].tolist()
    columns = [STATES.index(name) for name in measured]
    observer = LevelObserver(plant.tank, LEVEL_TICKS * TICK_S)
    limiter = CommandLimiter(plant.limits, plant.tank, TICK_S)
    by_pump = np.empty((count, n + 1))  # motion and pressure that the pump makes
    wishes = np.empty(count)
    commands = [0.0] * delay_ticks
    memory, applied = np.zeros(n + 2), np.zeros(1)  # the pump's motion and pressure; the command
    wish_pa = 0.0
    for k in range(count):
        by_pump[k] = memory[: n + 1]
        if k % LEVEL_TICKS == 0:
            observer.update(
                level_shown[k] + float(memory[_LEVEL]), pressure_shown[k] + float(memory[n])
            )
        if k % sample_ticks == 0:
            if k:
                applied[0] = limiter.mean_since_last_call()
                controller.applied(applied)
            seen = shown[k] + by_pump[k]
            seen[_SPEED] = observer.rate_m_s
            wish_pa = float(controller.step(seen[columns])[0])
        wishes[k] = wish_pa
        commands.append(limiter.limit(wish_pa, observer.level_m, observer.rate_m_s))
        memory[n + 1] = commands[k]
        memory[: n + 1] = advance.dot(memory)
    return LoopRun(
        wave_motion + by_pump[:, :n], by_pump[:, n], np.array(commands[delay_ticks:]), wishes
    )


def _ticks(name: str, time_s: float) -> int:
    ticks = round(time_s / TICK_S)
    if abs(ticks * TICK_S - time_s) > 1e-9:
        raise ValueError(f"{name} must be a whole number of ticks of {TICK_S} s, got {time_s}")
    return ticks
