"""Comparison of a law on trial with the law before: roll and pressure over equal windows."""

import math
from collections import deque
from typing import Final, NamedTuple


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
    """Sums of roll and pressure of the latest `length` samples; `samples` counts since `clear`."""

    def __init__(self, samples: int) -> None:
        self._length = samples
        self.clear()

    def clear(self) -> None:
        """Discard all samples."""
        self.samples = 0
        self._rows: deque[tuple[float, ...]] = deque(maxlen=self._length)
        self._sums = [0.0] * 6

    def add(self, roll_rad: float, pressure_pa: float, passive_roll_rad: float = 0.0) -> None:
        """Append a sample; the oldest leaves a full window."""
        values = roll_rad, pressure_pa, passive_roll_rad if math.isfinite(passive_roll_rad) else 0.0
        row = (*values, *(value * value for value in values))
        left = self._rows[0] if self.full else [0.0] * len(row)
        self._rows.append(row)
        self._sums = [
            total - old + new for total, old, new in zip(self._sums, left, row, strict=True)
        ]
        self.samples += 1

    @property
    def heel_rad(self) -> float:
        """Mean roll of the samples in the window; zero if there are none."""
        return self._sums[0] / max(1, len(self._rows))

    @property
    def full(self) -> bool:
        """Whether the window is full."""
        return len(self._rows) == self._length

    @property
    def statistics(self) -> WindowStatistics:
        """Statistics of the samples in the window; zero if there are none."""
        means = [total / max(1, len(self._rows)) for total in self._sums]
        # rounding may leave a variance just below zero
        roll, pressure, passive = (
            math.sqrt(max(0.0, square - mean * mean))
            for mean, square in zip(means[:3], means[3:], strict=True)
        )
        return WindowStatistics(roll, pressure, math.sqrt(max(0.0, means[4])), passive)


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
