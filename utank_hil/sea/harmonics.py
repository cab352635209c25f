"""A sum of sinusoids, the form of wave elevation, slope and moment."""

from dataclasses import dataclass

import numpy as np

from utank_hil.base.arrays import FloatArray

BLOCK = 1 << 19  # Number of cosines evaluated at a time in `at`: 4 MB.


@dataclass(frozen=True, slots=True, eq=False)
class Harmonics:
    """x(t) = sum of amplitude cos(frequency t + phase).

    All arrays have shape (N,). Amplitudes are in the unit of x and may be negative; frequencies are
    zero or more.
    """

    amplitude: FloatArray
    frequency_rad_s: FloatArray
    phase_rad: FloatArray

    @property
    def variance(self) -> float:
        """Variance, sum of amplitude^2 / 2."""
        return float(self.amplitude @ self.amplitude / 2)

    def at(self, time_s: FloatArray | float) -> FloatArray:
        """Evaluate at arbitrary times, a float or an array, by the direct sum."""
        times = np.asarray(time_s, dtype=float)
        flat = times.ravel()
        result = np.empty(flat.size)
        rows = max(1, BLOCK // max(1, self.amplitude.size))
        for start in range(0, flat.size, rows):
            angle = np.multiply.outer(flat[start : start + rows], self.frequency_rad_s)
            angle += self.phase_rad
            result[start : start + rows] = np.cos(angle, out=angle) @ self.amplitude
        return result.reshape(times.shape)

    def series(self, step_s: float, count: int) -> FloatArray:
        """Evaluate on the uniform grid ``step_s * arange(count)``.

        With t = T + s, T on a coarse and s on a fine grid, cos(w T + phase + w s) is expanded into
        two products. This takes sqrt(count) cosines per component and one matrix product. No error
        accumulates, so the result equals `at` to rounding error. ValueError is raised if `step_s`
        is not positive or `count` is negative.
        """
        if not step_s > 0 or count < 0:
            raise ValueError(f"series needs a positive step and count, got {step_s} and {count}")
        columns = max(1, int(np.sqrt(count)))
        rows = -(-count // columns)
        coarse = step_s * columns * np.arange(rows)
        fine = step_s * np.arange(columns)
        slow = np.multiply.outer(coarse, self.frequency_rad_s) + self.phase_rad
        fast = np.multiply.outer(self.frequency_rad_s, fine)
        left = np.hstack([self.amplitude * np.cos(slow), -self.amplitude * np.sin(slow)])
        right = np.vstack([np.cos(fast), np.sin(fast)])
        grid: FloatArray = left @ right
        return grid.ravel()[:count]
