"""Response amplitude operator of the nonlinear model, by simulation in regular waves."""

import math
from typing import NamedTuple

import numpy as np

from utank_hil.arrays import ComplexArray, FloatArray
from utank_hil.dynamics import RollModel, WaveMoment, simulate_batch


class ResponseAmplitude(NamedTuple):
    """First harmonic of the steady oscillation per wave moment.

    Attributes
    ----------
    roll_rad_per_nm, level_m_per_nm : ndarray of complex, shape (n,)
        Complex amplitude relative to the wave moment; NaN where the ship capsized.
    """

    roll_rad_per_nm: ComplexArray
    level_m_per_nm: ComplexArray


def simulated_response(
    model: RollModel,
    frequency_rad_s: FloatArray,
    amplitude_nm: float,
    *,
    settle_periods: int = 60,
    samples_per_period: int = 256,
) -> ResponseAmplitude:
    """Simulate each frequency to the steady state, and take the first harmonic.

    Parameters
    ----------
    model : RollModel
    frequency_rad_s : ndarray, shape (n,)
    amplitude_nm : float
    settle_periods : int
        Wave periods before the analysed one.
    samples_per_period : int
        Integration steps per wave period.
    """
    first = np.empty((2, len(frequency_rad_s)), dtype=np.complex128)
    angle = math.tau * np.arange(samples_per_period) / samples_per_period
    weights = np.exp(-1j * angle) * 2 / samples_per_period / amplitude_nm
    for n, frequency in enumerate(frequency_rad_s):
        step_s = math.tau / frequency / samples_per_period
        result = simulate_batch(
            model,
            (settle_periods + 1) * samples_per_period * step_s,
            wave=WaveMoment([amplitude_nm], [frequency], [0.0]),
            step_s=step_s,
            record_every=1,
        )
        if np.isfinite(result.capsized_s[0]):
            first[:, n] = np.nan
        else:
            steady = result.history[0, -samples_per_period:]
            first[:, n] = steady[:, [0, 2]].T @ weights
    return ResponseAmplitude(first[0], first[1])
