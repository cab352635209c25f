"""The pulses that an identification gives, made once before the loop begins."""

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.control import PumpLimits, pump_model
from utank_hil.dynamics.sampling import sample
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
from utank_hil.runtime.retuning.settings import RetuningSettings


def make_pulses(
    settings: RetuningSettings,
    limits: PumpLimits,
    ship: RollShip,
    tank: Tank,
    sample_time_s: float,
    delay_s: float,
    lag_s: float,
) -> FloatArray:
    """Random pulses within pressure and rate, and within roll and level on the given ship.

    Roll and level are those that the pulses alone cause in still water. The level limit of `limits`
    applies to the sum of waves, law and pulses, at every command; this is only its first guard.

    Returns
    -------
    ndarray, shape (N,)
        Pressure in Pa.
    """
    from utank_hil.identification import random_pulses  # scipy.optimize: not for every start

    within = PumpLimits(
        pressure_pa=min(settings.pulse_pa, limits.pressure_pa), rate_pa_s=limits.rate_pa_s
    )
    pulses = random_pulses(
        settings.identification_s, within, settings.seed, settings.pulse_hold_s, sample_time_s
    )
    plant = sample(pump_model(ship, tank, ("roll_rad", "level_m")), sample_time_s, delay_s, lag_s)
    state = np.zeros(len(plant.A))
    largest = np.zeros(2)
    for pressure_pa in pulses:
        largest = np.maximum(largest, np.abs(plant.C @ state + plant.D[:, 0] * pressure_pa))
        state = plant.A @ state + plant.B[:, 0] * pressure_pa
    room = np.array([settings.added_roll_rad, limits.level_m]) / np.maximum(largest, 1e-300)
    return pulses * min(1.0, float(room.min()))
