"""A ship that rolls in a regular wave, her water and pump in steady state: computed by phasors."""

import cmath
import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.thresholds import MonitorThresholds, SensorFigures, thresholds_of

CONFIG = load_config(Path("configs/controllers/gpc.yaml"), ControllerConfig)
TANK = CONFIG.vessel.tank
SHIP = replace(CONFIG.vessel.ship, sway_of_slope=0.0)
THRESHOLDS: MonitorThresholds = thresholds_of(
    CONFIG.plant, CONFIG.safety.roll_limit_rad, SensorFigures()
)
HALF_DEGREE = math.radians(0.5)
FINDINGS = [bit for name, bit in vars(Finding).items() if name.isupper()]


class MovingShip:
    """Roll, its rate, level and pressure at any time, with the sensors' noise on demand."""

    def __init__(
        self, roll_rms_rad=HALF_DEGREE, pressure_rms_pa=10e3, frequency_rad_s=0.6, *, noise=True
    ):
        self.w = frequency_rad_s
        self.roll = math.sqrt(2) * roll_rms_rad + 0j
        self.pressure = math.sqrt(2) * pressure_rms_pa * cmath.exp(1.3j)
        tank, w = TANK, self.w
        push = 9.80665 * tank.width_m - tank.width_m * (tank.height_m + tank.lz_m) * w**2
        length = 2 * tank.height_m + tank.width_m * tank.reservoir_area_m2 / tank.duct_area_m2
        w0 = math.sqrt(2 * 9.80665 / length)
        answer = length * (w0**2 - w**2 + 2j * tank.damping_ratio * w0 * w)
        self.level = (self.pressure / 1000 + push * self.roll) / answer
        self._random = np.random.default_rng(1)
        self._noise = SensorFigures() if noise else None

    def _at(self, phasor, time_s, noise):
        clean = (phasor * cmath.exp(1j * self.w * time_s)).real
        return clean + noise * self._random.standard_normal() if self._noise else clean

    def roll_rad(self, t):
        return self._at(self.roll, t, 2e-4)

    def rate_rad_s(self, t):
        return self._at(1j * self.w * self.roll, t, 5e-4)

    def turned_rad(self, t, step_s):
        """Integral of the rate over the last step, as the samples of a sensor of 10 ms give it."""
        return self._at(self.roll, t, 5e-4 * math.sqrt(0.01 * step_s)) - self._at(
            self.roll, t - step_s, 0.0
        )

    def level_m(self, t):
        return self._at(self.level, t, 0.005 / math.sqrt(2))

    def pressure_pa(self, t):
        return self._at(self.pressure, t, 100.0)
