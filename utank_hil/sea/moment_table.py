"""Roll moment of a wave from a table, as of a strip or panel program.

A CSV file has the columns ``omega_rad_s, heading_deg, moment_nm_per_m, phase_deg``: for each pair
of wave frequency (earth frame) and heading (0 following, 90 from port to starboard, 180 head) the
moment on roll, positive to starboard, per metre of wave amplitude, and its lead on the wave's crest
at the centre of gravity. Headings of -180 to 0 may be left out, because the ship is symmetric.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.elementary import phasors
from utank_hil.base.text_files import read_number_table, unread

COLUMNS: Final = ("omega_rad_s", "heading_deg", "moment_nm_per_m", "phase_deg")


@dataclass(frozen=True, slots=True, eq=False)
class MomentTable:
    """Roll moment per wave amplitude, interpolated linearly in frequency and heading."""

    omega_rad_s: FloatArray  #: shape (F,): frequencies, increasing.
    heading_rad: FloatArray  #: shape (H,): headings, increasing from 0 to pi.
    #: shape (F, H): moment: real part in phase with the crest, argument positive for a lead.
    moment_nm_per_m: ComplexArray

    @classmethod
    def read(cls, file: Path) -> "MomentTable":
        """Read a table; ValueError unless a complete grid of headings from 0 to 180 degrees."""
        try:
            columns = read_number_table(file)
        except OSError as error:
            raise ValueError(unread(error)) from error
        if set(columns) != set(COLUMNS):
            has = ", ".join(columns)
            raise ValueError(f"{file} needs the columns {', '.join(COLUMNS)}, has {has}")
        values = np.column_stack([columns[name] for name in COLUMNS])
        omega, heading = np.unique(values[:, 0]), np.unique(values[:, 1])
        if not np.isfinite(values).all() or len(omega) < 2 or omega[0] <= 0:
            raise ValueError(f"{file}: needs finite values, two or more frequencies above zero")
        if len(values) != len(omega) * len(heading) or heading[0] != 0 or heading[-1] != 180:
            raise ValueError(
                f"{file}: needs each frequency with each heading once, headings from 0 to 180, got "
                f"{len(values)} rows for {len(omega)} frequencies and {len(heading)} headings from "
                f"{heading[0]:g} to {heading[-1]:g}"
            )
        grid = values[np.lexsort((values[:, 1], values[:, 0]))].reshape(len(omega), -1, 4)
        moment = phasors(grid[..., 2], np.radians(grid[..., 3]))
        return cls(omega, np.radians(heading), moment)

    def moment(self, omega_rad_s: FloatArray, heading_rad: FloatArray) -> ComplexArray:
        """Moment in N m per m of amplitude, shape (N,); zero outside of the table's frequencies."""
        relative = np.pi - np.mod(np.pi - heading_rad, 2 * np.pi)  # This maps to (-pi, pi].
        row, across = _between(self.omega_rad_s, omega_rad_s)
        column, along = _between(self.heading_rad, np.abs(relative))
        m = self.moment_nm_per_m
        low = (1 - along) * m[row, column] + along * m[row, column + 1]
        high = (1 - along) * m[row + 1, column] + along * m[row + 1, column + 1]
        inside = (omega_rad_s >= self.omega_rad_s[0]) & (omega_rad_s <= self.omega_rad_s[-1])
        side = np.where(relative < 0, -1.0, 1.0)  # The wave is the same from the other side.
        result: ComplexArray = np.where(inside, side * ((1 - across) * low + across * high), 0)
        return result


def _between(grid: FloatArray, at: FloatArray) -> tuple[npt.NDArray[np.intp], FloatArray]:
    """Return the index of the grid point below each value, and the fraction to the next point."""
    index = np.clip(np.searchsorted(grid, at, side="right") - 1, 0, len(grid) - 2)
    return index, (at - grid[index]) / (grid[index + 1] - grid[index])
