"""Response amplitude operator of the nonlinear model, by simulation in regular waves."""

import math
from typing import NamedTuple

import numpy as np

from tools.thesis.batch import simulate_batch
from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.dynamics import RollModel, WaveMoment

SETTLE_PERIODS = 60  # wave periods before the analysed one
SAMPLES = 256  # integration steps per wave period


class ResponseAmplitude(NamedTuple):
    """First harmonic of the steady oscillation per wave moment."""

    #: roll_rad_per_nm, level_m_per_nm: shape (n,): complex amplitude relative to the wave moment;
    #: NaN where the ship capsized.
    roll_rad_per_nm: ComplexArray
    level_m_per_nm: ComplexArray


def simulated_response(
    model: RollModel, frequency_rad_s: FloatArray, amplitude_nm: float
) -> ResponseAmplitude:
    """Simulate each frequency to the steady state, and take the first harmonic."""
    first = np.empty((2, len(frequency_rad_s)), dtype=np.complex128)
    angle = math.tau * np.arange(SAMPLES) / SAMPLES
    weights = np.exp(-1j * angle) * 2 / SAMPLES / amplitude_nm
    for n, frequency in enumerate(frequency_rad_s):
        step_s = math.tau / frequency / SAMPLES
        result = simulate_batch(
            model,
            (SETTLE_PERIODS + 1) * SAMPLES * step_s,
            wave=WaveMoment([amplitude_nm], [frequency], [0.0]),
            step_s=step_s,
            record_every=1,
        )
        if np.isfinite(result.capsized_s[0]):
            first[:, n] = np.nan
        else:
            steady = result.history[0, -SAMPLES:]
            first[:, n] = steady[:, [0, 2]].T @ weights
    return ResponseAmplitude(first[0], first[1])
