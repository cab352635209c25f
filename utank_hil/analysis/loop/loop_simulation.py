"""A closed loop of law, limiter and ship in waves, without bus and nodes.

For long runs in many seas: the ship's motion is the known one with passive tank plus the response
to the pump. Sensors, limiter and drive run every tick, level gauges and level observer every
`LEVEL_TICKS`, the controller at its own sample time.
"""

from dataclasses import dataclass, replace

import numpy as np

from utank_hil.analysis.loop.loop_ticks import (
    LEVEL_TICKS,
    LinearShip,
    MovedShip,
    run_ticks,
    sensed_at,
)
from utank_hil.base.arrays import FloatArray
from utank_hil.base.tick import TICK_S
from utank_hil.control import CommandLimiter, Controller, DesignPlant, LevelObserver
from utank_hil.dynamics import STATES, RollShip, Tank
from utank_hil.dynamics.linear import state_matrices
from utank_hil.dynamics.sampling import transition_and_step
from utank_hil.sea import Harmonics


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """Standard deviations of white sensor noise; the level's is that of the two gauges' mean."""

    roll_rad: float = 2e-4
    roll_rate_rad_s: float = 5e-4
    level_m: float = 3.5e-3
    pressure_pa: float = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class LoopRun:
    """Signals of a run, one value per tick that was kept."""

    motion: FloatArray  #: shape (n, 4): `STATES`.
    #: pressure_pa, command_pa: shape (n,): actual pressure; limited command before delay and lag.
    pressure_pa: FloatArray
    command_pa: FloatArray


def passive_motion(
    ship: RollShip, tank: Tank, wave_moment: Harmonics, step_s: float, count: int
) -> FloatArray:
    """Motion of ship and passive tank from rest in a wave moment in N m, exact for any step.

    Returns `STATES` at 0, step_s, 2 step_s, ..., shape (count, 4).
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
    # The modes of the free motion make the sum start at rest.
    values, modes = np.linalg.eig(a)
    start = np.linalg.solve(modes, -steady[0].astype(complex))
    free = np.exp(np.outer(step_s * np.arange(count), values)) * start @ modes.T
    return np.asarray(steady + free.real)


def between(motion: FloatArray, step_s: float, ticks: int) -> FloatArray:
    """Motion at each tick, from that at each `ticks`-th one; shape (ticks (n - 1), 4).

    `motion`, shape (n, 4), is at multiples of `step_s`. Between them roll and level are cubics that
    have its values and rates: off by (w step_s)^4 / 384 of a wave's amplitude, 5e-8 at 1.3 rad/s.
    """
    from scipy.interpolate import CubicHermiteSpline  # A third of the start, for campaigns alone.

    times = step_s * np.arange(len(motion))
    found = np.empty((ticks * (len(motion) - 1), len(STATES)))
    inside = step_s / ticks * np.arange(len(found))
    for value, rate in ((0, 1), (2, 3)):
        curve = CubicHermiteSpline(times, motion[:, value], motion[:, rate])
        found[:, value], found[:, rate] = curve(inside), curve(inside, 1)
    return found


def simulate_loop(
    plant: DesignPlant,
    wave_motion: FloatArray,
    controller: Controller,
    measured: tuple[str, ...],
    *,
    pump_gain: float = 1.0,
    noise: SensorNoise | None = None,
    seed: int = 0,
    every: int = 1,
) -> LoopRun:
    """Run a law on a linear ship whose motion with the tank passive is known, for its length.

    The law is armed from the start. `wave_motion`, shape (n, 4), is from `passive_motion` with a
    step of `TICK_S`. `measured` are the `STATES` that the controller measures, in its order;
    `plant` gives tank, limits and delay; `pump_gain` is the actual steady pressure per commanded
    pressure. Each `every`-th tick is kept. Raises `ValueError` if delay or sample time are not
    whole numbers of ticks.
    """
    lag_s, n, ticks = plant.lag_s, len(STATES), len(wave_motion)
    a, b = state_matrices(plant.ship, plant.tank)
    lagged = np.block([[a, b[:, :1]], [np.zeros((1, n)), np.full((1, 1), -1 / lag_s)]])
    transition, step = transition_and_step(
        lagged, np.append(np.zeros(n), pump_gain / lag_s)[:, None], TICK_S
    )
    sensed, shown = sensed_noise(noise, ticks, seed, controller.sample_time_s)
    sensed[:, :n] += wave_motion[shown]
    ship = LinearShip(np.hstack([transition, step]), sensed)
    run = run_law(ship, plant, controller, measured, ticks, every)
    return replace(run, motion=run.motion + wave_motion[::every])


def run_law(
    ship: MovedShip,
    plant: DesignPlant,
    controller: Controller,
    measured: tuple[str, ...],
    ticks: int,
    every: int = 1,
) -> LoopRun:
    """Run a law, armed from the start, on a ship of which `plant` gives tank, limits and delay.

    The motion is what the ship gives as truth; see `simulate_loop` for the rest.
    """
    truth, commands = run_ticks(
        ship,
        controller,
        [STATES.index(name) for name in measured],
        LevelObserver(plant.tank, LEVEL_TICKS * TICK_S),
        CommandLimiter(plant.limits, plant.tank, TICK_S),
        _ticks("delay_s", plant.delay_s),
        _ticks("sample_time_s", controller.sample_time_s),
        ticks,
        every,
    )
    kept = np.array(truth)
    return LoopRun(kept[:, :-1], kept[:, -1], np.array(commands))


def sensed_noise(
    noise: SensorNoise | None, ticks: int, seed: int, sample_time_s: float
) -> tuple[FloatArray, list[int]]:
    """Noise of `Signals` where a loop senses, (n, 5), and its ticks; the level's rate has none."""
    shown = sensed_at(_ticks("sample_time_s", sample_time_s), ticks)
    size = noise or SensorNoise()
    sizes = np.array([size.roll_rad, size.roll_rate_rad_s, size.level_m, 0.0, size.pressure_pa])
    drawn: FloatArray = np.random.default_rng(seed).standard_normal((ticks, len(sizes)))[shown]
    return drawn * sizes, shown


def _ticks(name: str, time_s: float) -> int:
    ticks = round(time_s / TICK_S)
    if abs(ticks * TICK_S - time_s) > 1e-9:
        raise ValueError(f"{name} must be a whole number of ticks of {TICK_S} s, got {time_s}")
    return ticks
