"""Plant model of a predictor with a wave forecast: ship and tank, drive, waves and heel.

The waves are white noise through the shaping filter of a `SeaModel`, with a moment that is linear
between two samples. A heel (wind, cargo, turning) is a slowly varying moment.
"""

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.sea_model import SeaModel
from utank_hil.dynamics.linear import STATES, state_matrices
from utank_hil.dynamics.sampling import LinearModel, noise_covariance


def sea_plant(
    sea: SeaModel,
    plant: DesignPlant,
    *,
    sample_time_s: float,
    pressure_noise_pa_rt_s: float = 0.0,
    slope_noise_rad_rt_s: float = 0.0,
    heel_std_rad: float = 0.0,
    heel_time_s: float = 1.0,
) -> tuple[LinearModel, FloatArray]:
    """Sampled model of ship, tank, drive, waves and a slowly varying heeling moment.

    Parameters
    ----------
    pressure_noise_pa_rt_s : float
        Root of the two-sided density of a white pressure disturbance, which stands for model
        errors.
    slope_noise_rad_rt_s : float
        Root of the two-sided density of a white roll moment, per roll stiffness.
    heel_std_rad, heel_time_s : float
        Standard deviation and time constant of the heeling moment, per roll stiffness.

    Returns
    -------
    model : LinearModel
        From the pump's command to `STATES`. States: `STATES` (less the direct effect of the
        command), lag and past commands, waves, and last the heel.
    process_covariance : ndarray, shape (n, n)
    """
    a, b = state_matrices(plant.ship, plant.tank)
    pressure, slope = b[:, :1], b[:, 1:] * plant.ship.stiffness_nm_rad
    count = len(STATES)
    pump = plant.sampled(STATES, sample_time_s)
    before, after = _straight_line_effect(a, slope, sample_time_s)
    waves = sea.shaping_filter(sample_time_s)
    keep = np.exp(-sample_time_s / heel_time_s)

    inner, n = len(pump.A), len(pump.A) + len(waves.A) + 1
    sea_states, heel = slice(inner, n - 1), n - 1
    whole = np.zeros((n, n))
    whole[:inner, :inner] = pump.A
    whole[sea_states, sea_states] = waves.A
    whole[heel, heel] = keep
    whole[:count, sea_states] = before @ waves.C + after @ waves.C @ waves.A
    whole[:count, heel] = (before + after * keep)[:, 0]
    noise = np.zeros((n, 2))
    noise[sea_states, :1] = waves.B
    noise[:count, :1] = after @ waves.C @ waves.B
    noise[heel, 1] = heel_std_rad * np.sqrt(1 - keep**2)
    noise[:count, 1] = after[:, 0] * noise[heel, 1]
    covariance = noise @ noise.T
    white = np.hstack([pressure * pressure_noise_pa_rt_s, slope * slope_noise_rad_rt_s])
    covariance[:count, :count] += noise_covariance(a, white, sample_time_s)
    rest = np.zeros((n - inner, 1))
    model = LinearModel(
        whole,
        np.vstack([pump.B, rest]),
        np.hstack([pump.C, np.zeros((count, n - inner))]),
        pump.D,
        sample_time_s,
    )
    return model, covariance


def _straight_line_effect(
    a: FloatArray, b: FloatArray, time_s: float
) -> tuple[FloatArray, FloatArray]:
    """Effect of the first and the last value of a linearly varying input, after a time."""
    from scipy.linalg import expm

    n = len(a)
    block = np.zeros((n + 2, n + 2))
    block[:n, :n], block[:n, n : n + 1] = a * time_s, b * time_s
    block[n, n + 1] = 1.0
    whole = expm(block)
    after = whole[:n, n + 1 :]
    return whole[:n, n : n + 1] - after, after
