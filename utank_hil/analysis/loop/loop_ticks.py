"""The ticks of `loop_simulation`, in plain floats: compiled where the tick is.

No row of the ship's motion is an array before a block of them is done.
"""

from typing import Final, Protocol, TypeAlias

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control.interface import Controller
from utank_hil.control.level_observer import LevelObserver
from utank_hil.control.limiter import CommandLimiter

LEVEL_TICKS: Final = 2  #: Cycle of the message SENSOR_TANK, in ticks.
_BLOCK: Final = 256  # signals that are Python's own numbers at a time

Signals: TypeAlias = tuple[float, float, float, float, float]
"""Roll, its rate, level, its rate (`STATES`), and the pump's actual pressure."""
_Row: TypeAlias = tuple[float, float, float, float, float, float]


class MovedShip(Protocol):
    """A ship as `run_ticks` moves it."""

    def sensed(self) -> Signals:
        """Signals of this tick with the sensors' noise; called at the ticks of `sensed_at`."""

    def truth(self) -> Signals:
        """Signals of this tick as they are kept."""

    def advance(self, command_pa: float) -> None:
        """Move by one tick with a pump that is commanded this pressure."""


class LinearShip:
    """A linear ship in waves, as what it moves beyond a known motion with the tank passive.

    `step` takes the signals due to the pump, and the command, to those of the next tick, shape
    (5, 6). `passive` are the signals with the pump at rest and the sensors' noise, shape (n, 5), at
    the ticks at which they are sensed; `truth` are those due to the pump alone.
    """

    def __init__(self, step: FloatArray, passive: FloatArray) -> None:
        self._roll_row: _Row = tuple(step[0].tolist())
        self._roll_rate_row: _Row = tuple(step[1].tolist())
        self._level_row: _Row = tuple(step[2].tolist())
        self._level_rate_row: _Row = tuple(step[3].tolist())
        self._pressure_row: _Row = tuple(step[4].tolist())
        self._roll = self._roll_rate = self._level = self._level_rate = self._pressure = 0.0
        self._passive = passive
        self._next = self._end = 0  # place in the block, and its end
        self._begun = 0
        self._block: list[float] = []

    def _read_block(self) -> None:
        part = self._passive[self._begun : self._begun + _BLOCK]
        self._begun += _BLOCK
        self._block = part.ravel().tolist()
        self._next, self._end = 0, len(self._block)

    def sensed(self) -> Signals:
        """Signals of this tick with the sensors' noise; call in the order of `passive`."""
        if self._next == self._end:
            self._read_block()
        block, place = self._block, self._next
        self._next = place + 5
        return (
            block[place] + self._roll,
            block[place + 1] + self._roll_rate,
            block[place + 2] + self._level,
            block[place + 3] + self._level_rate,
            block[place + 4] + self._pressure,
        )

    def truth(self) -> Signals:
        """Signals of this tick that are due to the pump."""
        return (self._roll, self._roll_rate, self._level, self._level_rate, self._pressure)

    def advance(self, command_pa: float) -> None:
        """Move by one tick."""
        now: Signals = (self._roll, self._roll_rate, self._level, self._level_rate, self._pressure)
        self._roll = _product(self._roll_row, now, command_pa)
        self._roll_rate = _product(self._roll_rate_row, now, command_pa)
        self._level = _product(self._level_row, now, command_pa)
        self._level_rate = _product(self._level_rate_row, now, command_pa)
        self._pressure = _product(self._pressure_row, now, command_pa)


def _product(row: _Row, now: Signals, command_pa: float) -> float:
    return (
        row[0] * now[0]
        + row[1] * now[1]
        + row[2] * now[2]
        + row[3] * now[3]
        + row[4] * now[4]
        + row[5] * command_pa
    )


def sensed_at(sample_ticks: int, ticks: int) -> list[int]:
    """Ticks at which `run_ticks` senses: those of the level gauges and of the law's samples."""
    return [k for k in range(ticks) if k % LEVEL_TICKS == 0 or k % sample_ticks == 0]


def run_ticks(
    ship: MovedShip,
    controller: Controller,
    columns: list[int],
    observer: LevelObserver,
    limiter: CommandLimiter,
    delay_ticks: int,
    sample_ticks: int,
    ticks: int,
    every: int,
) -> tuple[list[Signals], list[float]]:
    """Run a controller on a ship; return the truth and its limited commands.

    They are of each `every`-th tick; commands before delay and lag. `columns` are the places in
    `Signals` of what the controller measures. The order within a tick is that of the controller
    node.
    """
    truth: list[Signals] = []
    commands: list[float] = []
    late = [0.0] * (delay_ticks + 1)
    newest = 0  # place in it
    # ticks until the next of each; compiled, a division takes longer than these
    until_level = until_sample = until_kept = 0
    wish_pa = 0.0
    seen: Signals = (0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(ticks):
        if until_level == 0 or until_sample == 0:
            seen = ship.sensed()
        if until_level == 0:
            until_level = LEVEL_TICKS
            observer.update(seen[2], seen[4])
        if until_sample == 0:
            until_sample = sample_ticks
            if k:
                controller.applied(np.array([limiter.mean_since_last_call()]))
            measured = [seen[0], seen[1], seen[2], observer.rate_m_s]
            wish_pa = float(controller.step(np.array([measured[each] for each in columns]))[0])
        command_pa = limiter.limit(wish_pa, observer.level_m, observer.rate_m_s)
        if until_kept == 0:
            until_kept = every
            truth.append(ship.truth())
            commands.append(command_pa)
        until_level, until_sample, until_kept = until_level - 1, until_sample - 1, until_kept - 1
        late[newest] = command_pa
        newest = 0 if newest == delay_ticks else newest + 1
        ship.advance(late[newest])
    return truth, commands
