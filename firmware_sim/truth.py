"""Truth: the plant's state, recorded beside the controller's telemetry."""

from collections.abc import Iterable
from typing import Final

import numpy as np

from firmware_sim.plant import Plant
from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import Frame


class MemoryLog:
    """Keeps up to `rows` rows of a run, of `width` columns each, in memory."""

    def __init__(self, width: int, rows: int) -> None:
        self._kept = np.empty((rows, width))
        self._written = 0

    def write(self, row: FloatArray) -> None:
        """Append a copy of one row, shape (width,); rows beyond the capacity are dropped."""
        if self._written < len(self._kept):
            self._kept[self._written] = row
            self._written += 1

    @property
    def rows(self) -> FloatArray:
        """The rows so far, shape (n, width)."""
        return self._kept[: self._written]


TRUTH: Final = (
    "time_s",
    "true_roll_rad",
    "true_level_m",
    "true_pressure_pa",
    "true_shaft_power_w",
    "wave_moment_nm",
)


def true_values(plant: Plant) -> tuple[float, float, float, float, float]:
    """Values of `TRUTH` but the time."""
    return (
        plant.roll_rad, plant.level_m, plant.pressure_pa, plant.pump_power_w, plant.wave_moment_nm,
    )  # fmt: skip


class TruthRecorder:
    """Recorder of the plant on a fixed time grid: a node without frames."""

    name = "truth"

    def __init__(self, plant: Plant, log: MemoryLog, period_ns: int) -> None:
        self.period_ns = period_ns
        self.hears: frozenset[int] = frozenset()
        self._plant = plant
        self._log = log
        self._row = np.zeros(len(TRUTH))
        self.start_ns = -1  #: Time of the first row; -1 before it.
        self.pump_speed_rad_s = 0.0  #: Greatest speed of the pump's rotor in a row.

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Ignore the frame: the truth is not on the bus."""

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Record one row."""
        if self.start_ns < 0:
            self.start_ns = now_ns
        plant = self._plant
        plant.advance(now_ns)
        self._row[:] = ((now_ns - self.start_ns) * 1e-9, *true_values(plant))
        self._log.write(self._row)
        self.pump_speed_rad_s = max(self.pump_speed_rad_s, abs(plant.pump_speed_rad_s))
        return ()
