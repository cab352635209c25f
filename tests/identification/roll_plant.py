"""The thesis's first ship and tank, sampled, and records of it for the tests."""

from dataclasses import dataclass

import control
import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control.interface import PumpLimits
from utank_hil.dynamics import RollShip, Tank, coupled_model
from utank_hil.identification import era, random_pulses

SAMPLE_TIME_S = 0.2
INERTIA_KG_M2 = 1.9275e9
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.1)
FAST_PUMP = PumpLimits(pressure_pa=5e4, rate_pa_s=5e5)
SLOW_PUMP = PumpLimits(pressure_pa=5e4, rate_pa_s=5e4)
BAND_RAD_S = np.linspace(0.2, 1.2, 101)


@dataclass(frozen=True)
class Plant:
    """Discrete model from (pressure, wave moment) to (roll, level)."""

    a: FloatArray
    b: FloatArray
    c: FloatArray

    def respond(self, pressure_pa, moment_nm):
        """Roll and level, shape (N, 2), from rest."""
        state = np.zeros(len(self.a))
        y = np.empty((len(pressure_pa), len(self.c)))
        for k, inputs in enumerate(np.column_stack([pressure_pa, moment_nm])):
            y[k] = self.c @ state
            state = self.a @ state + self.b @ inputs
        return y

    def markov(self, count):
        """Markov parameters from the pressure, shape (count, 2, 1), by definition."""
        values = [np.zeros((len(self.c), 1))]
        power = self.b[:, :1]
        for _ in range(count - 1):
            values.append(self.c @ power)
            power = self.a @ power
        return np.array(values)

    def poles_rad_s(self):
        """Poles in the upper half plane, by rising frequency."""
        poles = np.log(np.linalg.eigvals(self.a)) / SAMPLE_TIME_S
        upper = poles[poles.imag > 0]
        return upper[np.argsort(np.abs(upper))]

    def state_space(self):
        """From the pressure only."""
        return control.ss(self.a, self.b[:, :1], self.c, np.zeros((2, 1)), SAMPLE_TIME_S)


def plant(period_s=2 * np.pi / 0.5):
    """Ship of a roll period, with her tank."""
    stiffness = INERTIA_KG_M2 * (2 * np.pi / period_s) ** 2
    full = coupled_model(RollShip(INERTIA_KG_M2, stiffness, 4.87e7), TANK)
    sampled = control.c2d(control.ss(full.A, full.B, full.C[[0, 2]], np.zeros((2, 2))), 0.2)
    return Plant(np.asarray(sampled.A), np.asarray(sampled.B), np.asarray(sampled.C))


def pulses(seed, limits=FAST_PUMP, duration_s=500.0):
    return random_pulses(duration_s, limits, seed, sample_time_s=SAMPLE_TIME_S)


def noisy(y, level, seed):
    """With white noise of a part of each output's spread."""
    noise = np.random.default_rng(seed).standard_normal(y.shape)
    return y + level * np.std(y, axis=0) * noise


def jonswap_moment(samples, seed, moment_nm=2e7):
    """Irregular wave moment of a given root mean square, peak period 9 s."""
    rng = np.random.default_rng(seed)
    omega = np.linspace(0.25, 2.0, 400)
    peak = 2 * np.pi / 9.0
    width = np.where(omega < peak, 0.07, 0.09)
    shape = omega**-5.0 * np.exp(-1.25 * (peak / omega) ** 4)
    shape *= 3.3 ** np.exp(-(((omega - peak) / (width * peak)) ** 2) / 2)
    phases = rng.uniform(0, 2 * np.pi, len(omega))
    time_s = np.arange(samples) * SAMPLE_TIME_S
    waves = np.cos(np.outer(time_s, omega) + phases) @ np.sqrt(shape)
    return moment_nm * waves / np.sqrt(np.sum(shape) / 2)


def realized(result, order=None):
    """State-space model of an identification."""
    return era(result.markov, order, sample_time_s=result.arx.sample_time_s)


def frequency_response(system, omega=BAND_RAD_S):
    """Shape (len(omega), m, r), from the matrices."""
    a, b, c, d = (np.asarray(part) for part in (system.A, system.B, system.C, system.D))
    return np.array(
        [
            c @ np.linalg.solve(np.exp(1j * w * SAMPLE_TIME_S) * np.eye(len(a)) - a, b) + d
            for w in omega
        ]
    )


def response_error(system, truth):
    """Relative error of the frequency response over the band, of each output."""
    right = frequency_response(truth.state_space())
    wrong = frequency_response(system) - right
    return np.linalg.norm(wrong, axis=(0, 2)) / np.linalg.norm(right, axis=(0, 2))
