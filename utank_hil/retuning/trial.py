"""Comparison of a law on trial with the law before: roll and pressure over equal windows."""

import math
from typing import Final, NamedTuple

import numpy as np


class WindowStatistics(NamedTuple):
    """Roll and pressure over a window."""

    #: roll_rad, pressure_pa: standard deviations. A steady heel, the same with either law, would
    #: mask a change in roll.
    roll_rad: float
    pressure_pa: float
    #: Root mean square including the steady part, which costs power and may heel the ship.
    pressure_rms_pa: float
    #: Standard deviation of the roll that a passive tank would have left; 0 if unknown.
    passive_roll_rad: float = 0.0


NOISE_FLOOR: Final = WindowStatistics(1e-4, 100.0, 100.0)
"""Lower limit of baselines: a few quantization steps of the sensors."""


class MovingWindow:
    """Roll and pressure of the latest `length` samples, as running sums.

    `samples` counts from the start or the last `clear`.
    """

    def __init__(self, samples: int) -> None:
        self._rows = np.zeros((samples, 3))
        self.length = samples
        self.clear()

    def clear(self) -> None:
        """Discard all samples."""
        self.samples = 0
        self._roll = self._roll_square = 0.0
        self._pressure = self._pressure_square = 0.0
        self._passive = self._passive_square = 0.0

    def add(self, roll_rad: float, pressure_pa: float, passive_roll_rad: float = 0.0) -> None:
        """Append a sample; the oldest leaves a full window."""
        if not math.isfinite(passive_roll_rad):
            passive_roll_rad = 0.0
        row = self._rows[self.samples % len(self._rows)]
        if self.full:
            self._add_to_sums(float(row[0]), float(row[1]), float(row[2]), -1.0)
        row[0], row[1], row[2] = roll_rad, pressure_pa, passive_roll_rad
        self._add_to_sums(roll_rad, pressure_pa, passive_roll_rad, 1.0)
        self.samples += 1

    @property
    def heel_rad(self) -> float:
        """Mean roll of the samples in the window; zero if there are none."""
        return self._roll / max(1, min(self.samples, len(self._rows)))

    @property
    def full(self) -> bool:
        """Whether the window is full."""
        return self.samples >= len(self._rows)

    @property
    def statistics(self) -> WindowStatistics:
        """Statistics of the samples in the window; zero if there are none."""
        count = max(1, min(self.samples, len(self._rows)))
        return WindowStatistics(
            _deviation(self._roll, self._roll_square, count),
            _deviation(self._pressure, self._pressure_square, count),
            math.sqrt(max(0.0, self._pressure_square / count)),
            _deviation(self._passive, self._passive_square, count),
        )

    def _add_to_sums(
        self, roll_rad: float, pressure_pa: float, passive_rad: float, sign: float
    ) -> None:
        self._roll += sign * roll_rad
        self._roll_square += sign * roll_rad * roll_rad
        self._pressure += sign * pressure_pa
        self._pressure_square += sign * pressure_pa * pressure_pa
        self._passive += sign * passive_rad
        self._passive_square += sign * passive_rad * passive_rad


def worsening(
    before: WindowStatistics, after: WindowStatistics, roll_factor: float, effort_factor: float
) -> tuple[str, ...]:
    """Describe what is worse by more than the factors; empty if nothing is."""
    before = WindowStatistics(*map(max, before, NOISE_FLOOR))
    found = []
    if after.roll_rad > roll_factor * before.roll_rad:
        found.append(
            f"roll rose from {math.degrees(before.roll_rad):.2f} to "
            f"{math.degrees(after.roll_rad):.2f} degrees RMS about the heel on trial"
        )
    for name, was_pa, is_pa in (
        ("RMS about its mean", before.pressure_pa, after.pressure_pa),
        ("RMS", before.pressure_rms_pa, after.pressure_rms_pa),
    ):
        if is_pa > effort_factor * was_pa:
            found.append(
                f"pressure rose from {was_pa / 1e3:.1f} to {is_pa / 1e3:.1f} kPa {name} on trial"
            )
            break
    return tuple(found)


def _deviation(total: float, squares: float, count: int) -> float:
    """Return the standard deviation from sums; rounding may leave a variance just below zero."""
    mean = total / count
    return math.sqrt(max(0.0, squares / count - mean * mean))
