"""A closed loop of law, limiter and ship in waves, without bus and nodes.

`run_law` runs a controller on any ship that moves tick by tick. `LinearShip` is for long runs in
many seas: its motion is the known one with passive tank plus the response to the pump. Sensors,
limiter and drive run every tick, level gauges and level observer every `LEVEL_TICKS`, the
controller at its own sample time. Their order within a tick is that of the controller node.
"""

from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.tick import TICK_S
from utank_hil.control import CommandLimiter, Controller, DesignPlant, LevelObserver
from utank_hil.dynamics import STATES, RollShip, Tank
from utank_hil.dynamics.linear import state_matrices
from utank_hil.dynamics.sampling import transition_and_step
from utank_hil.sea import Harmonics

LEVEL_TICKS: Final = 2  #: Cycle of the message SENSOR_TANK, in ticks.
_LEVEL, _SPEED = STATES.index("level_m"), STATES.index("level_rate_m_s")


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """Standard deviations of white sensor noise; the level's is that of the two gauges' mean."""

    roll_rad: float = 2e-4
    roll_rate_rad_s: float = 5e-4
    level_m: float = 3.5e-3
    pressure_pa: float = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class LoopRun:
    """Signals of a run, one value per tick."""

    motion: FloatArray  #: shape (n, 4): `STATES`.
    #: pressure_pa, command_pa, wish_pa: shape (n,): actual pressure, limited command before delay
    #: and lag, and the controller's unlimited command.
    pressure_pa: FloatArray
    command_pa: FloatArray
    wish_pa: FloatArray


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


class ShipInWaves(Protocol):
    """A ship with tank and pump that moves tick by tick."""

    def truth(self) -> FloatArray:
        """`STATES` and the actual pressure; shape (5,)."""

    def sensed(self) -> FloatArray:
        """`truth` with the sensors' noise."""

    def advance(self, command_pa: float) -> None:
        """Move by one tick with the command that has reached the drive."""


class LinearShip:
    """A linear ship in waves whose motion with the tank passive is known.

    `wave_motion`, shape (n, 4), is from `passive_motion` with a step of `TICK_S`; `pump_gain` is
    the actual steady pressure per commanded pressure.
    """

    def __init__(
        self,
        plant: DesignPlant,
        wave_motion: FloatArray,
        *,
        pump_gain: float = 1.0,
        noise: SensorNoise | None = None,
        seed: int = 0,
    ) -> None:
        lag_s, n = plant.lag_s, len(STATES)
        a, b = state_matrices(plant.ship, plant.tank)
        lagged = np.block([[a, b[:, :1]], [np.zeros((1, n)), np.full((1, 1), -1 / lag_s)]])
        transition, step = transition_and_step(
            lagged, np.append(np.zeros(n), pump_gain / lag_s)[:, None], TICK_S
        )
        self._advance = np.hstack([transition, step])
        self._waves = np.column_stack([wave_motion, np.zeros(len(wave_motion))])
        self._shown = _noise(noise, len(wave_motion), seed) + self._waves
        self._by_pump = np.zeros(n + 2)  # motion and pressure due to the pump, then the command
        self._tick = 0

    def truth(self) -> FloatArray:
        """`STATES` and the actual pressure."""
        found: FloatArray = self._waves[self._tick] + self._by_pump[:-1]
        return found

    def sensed(self) -> FloatArray:
        """`truth` with the sensors' noise."""
        found: FloatArray = self._shown[self._tick] + self._by_pump[:-1]
        return found

    def advance(self, command_pa: float) -> None:
        """Move by one tick."""
        self._by_pump[-1] = command_pa
        self._by_pump[:-1] = self._advance.dot(self._by_pump)
        self._tick += 1


def run_law(
    ship: ShipInWaves,
    controller: Controller,
    measured: tuple[str, ...],
    plant: DesignPlant,
    ticks: int,
) -> LoopRun:
    """Run a controller on a ship, armed from the start.

    `measured` are the `STATES` that it measures, in its order; `plant` gives tank, limits and
    delay; the run lasts `ticks` of `TICK_S`. Raises `ValueError` if delay or sample time are not
    whole numbers of ticks.
    """
    delay_ticks = _ticks("delay_s", plant.delay_s)
    sample_ticks = _ticks("sample_time_s", controller.sample_time_s)
    columns = [STATES.index(name) for name in measured]
    observer = LevelObserver(plant.tank, LEVEL_TICKS * TICK_S)
    limiter = CommandLimiter(plant.limits, plant.tank, TICK_S)
    truth, wishes = np.empty((ticks, len(STATES) + 1)), np.empty(ticks)
    commands = [0.0] * delay_ticks
    applied, wish_pa = np.zeros(1), 0.0
    for k in range(ticks):
        truth[k] = ship.truth()
        if k % LEVEL_TICKS == 0 or k % sample_ticks == 0:
            seen = ship.sensed()
        if k % LEVEL_TICKS == 0:
            observer.update(float(seen[_LEVEL]), float(seen[-1]))
        if k % sample_ticks == 0:
            if k:
                applied[0] = limiter.mean_since_last_call()
                controller.applied(applied)
            seen[_SPEED] = observer.rate_m_s
            wish_pa = float(controller.step(seen[columns])[0])
        wishes[k] = wish_pa
        commands.append(limiter.limit(wish_pa, observer.level_m, observer.rate_m_s))
        ship.advance(commands[k])
    return LoopRun(truth[:, :-1], truth[:, -1], np.array(commands[delay_ticks:]), wishes)


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
    """Run a law on a `LinearShip`, for the length of its motion with passive tank."""
    ship = LinearShip(plant, wave_motion, pump_gain=pump_gain, noise=noise, seed=seed)
    return run_law(ship, controller, measured, plant, len(wave_motion))


def _noise(noise: SensorNoise | None, ticks: int, seed: int) -> FloatArray:
    """Noise of `STATES` and pressure; the level's rate is not measured and has none."""
    size = noise or SensorNoise()
    sizes = np.array([size.roll_rad, size.roll_rate_rad_s, size.level_m, 0.0, size.pressure_pa])
    drawn: FloatArray = np.random.default_rng(seed).standard_normal((ticks, len(sizes)))
    drawn *= sizes
    return drawn


def _ticks(name: str, time_s: float) -> int:
    ticks = round(time_s / TICK_S)
    if abs(ticks * TICK_S - time_s) > 1e-9:
        raise ValueError(f"{name} must be a whole number of ticks of {TICK_S} s, got {time_s}")
    return ticks
