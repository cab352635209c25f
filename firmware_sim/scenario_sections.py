"""Sections of a scenario: errors of the sensors, limits of the drive, righting in waves."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.elementary import sines_cosines
from utank_hil.base.parameters import Checked, NotNegative, Positive, Problem, Range
from utank_hil.base.tick import TICK_NS
from utank_hil.configuration import Section
from utank_hil.sea.sea import wavenumber_rad_m


@dataclass(frozen=True, slots=True)
class SensorErrors(Checked, owner="sensors"):
    """Errors of the sensors; noise is white and Gaussian, given as standard deviation.

    Raises `ValueError` if a value is out of its range, or the delay is not a multiple of the cycle.
    """

    roll_noise_rad: NotNegative = 2e-4  #: Noise of the motion sensor.
    roll_rate_noise_rad_s: NotNegative = 5e-4  #: Noise of the motion sensor.
    #: Age of the motion sensor's sample when sent, a multiple of its 10 ms cycle; at most 1000, the
    #: longest delay that a law can be designed for.
    motion_delay_ms: Annotated[float, Range(least=0, most=1000)] = 20.0
    level_noise_m: NotNegative = 0.005  #: Noise of each level gauge.
    pressure_noise_pa: NotNegative = 100.0  #: Noise of the pressure sensor.
    #: Level above still water at which a reservoir's high-level switch closes.
    high_level_m: Positive = 4.6
    #: Constant error of the roll, such as that of a misaligned sensor; 0.2 at most.
    roll_bias_rad: Annotated[float, Range(least=-0.2, most=0.2)] = 0.0

    def _problems(self) -> list[Problem]:
        if self.motion_delay_ms * 1_000_000 % TICK_NS == 0:
            return []
        reason = f"must be a multiple of {TICK_NS / 1e6:g}, got {self.motion_delay_ms}"
        return [("motion_delay_ms", reason)]


@dataclass(frozen=True, slots=True)
class DriveLimits(Checked, owner="drive"):
    """Limits on commands, set in the drive and independent of the controller."""

    pressure_pa: Positive = 50e3  #: Largest set-point to either side.
    pressure_rate_pa_s: Positive = 250e3  #: Largest rate of the set-point away from zero.
    #: Longest command timeout that the drive accepts, at most 100: by then, according to the safety
    #: manual, the pressure of a dead controller is on its way to zero.
    longest_timeout_ms: Annotated[float, Range(above=0, most=100)] = 100.0
    #: Voltage of the direct-current bus that feeds the drive; 4 to 1000, the range of
    #: DRIVE_STATUS_2.
    bus_voltage_v: Annotated[float, Range(least=4, most=1000)] = 1000.0


class Forecasts(Section):
    """Forecasts of the waves by the vessel's preview station."""

    horizon_s: Annotated[float, Range(least=0.5, most=14)] = 5.0
    """Time ahead up to which it forecasts; more are not sent in the time for which they count."""
    error: Annotated[float, Range(least=0, most=10)] = 0.5
    """Standard deviation of its error over that of the wave moment; 0 for a perfect one."""


class RightingInWaves(Section):
    """Righting moment that changes as waves pass along: parametric roll, loss of stability.

    Each wave counts as the wave of the ship's length, its crest or trough amidships, that is
    nearest to it over the hull by least squares (Grim 1961)::

        a = 2 q sin q / (pi^2 - q^2),   q = k |cos(heading)| length / 2
    """

    length_m: Annotated[float, Range(above=0, most=600)]  #: Length of the waterline.
    share_per_m: Annotated[float, Range(least=-1, most=1)]
    """Change of the righting moment at every heel, as a share, for a wave of the ship's length and
    1 m of amplitude with its crest amidships; negative for most hulls."""

    def change_per_m(self, omega_rad_s: FloatArray, heading_rad: FloatArray) -> ComplexArray:
        """Change as a share per m of amplitude; its argument is the lead on the crest."""
        along = np.abs(sines_cosines(heading_rad)[1])
        q = wavenumber_rad_m(omega_rad_s) * along * self.length_m / 2
        rest = math.pi - q
        near = np.abs(rest) < 1e-6
        # 2 q sin q / ((pi - q) (pi + q)), which is 1 at q = pi
        shape = 2 * q * sines_cosines(rest)[0] / (np.where(near, 1.0, rest) * (math.pi + q))
        return np.asarray(self.share_per_m * np.where(near, 1.0, shape), dtype=np.complex128)
