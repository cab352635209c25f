"""Records of the thesis's first ship, differently loaded, as the retuner gets them."""

from dataclasses import replace
from functools import cache

import numpy as np
from shipped_designs import DPC_ROLL_LEVEL, GPC_ROLL

from utank_hil.base.arrays import FloatArray
from utank_hil.control import DesignPlant, PumpLimits, pump_model
from utank_hil.dynamics import RollShip, Tank
from utank_hil.dynamics.linear import coupled_model
from utank_hil.dynamics.sampling import sample
from utank_hil.identification import random_pulses
from utank_hil.identification.ship_fit import ModelLimits
from utank_hil.retuning.redesign import LEAST_GAIN, RetuningTask

SAMPLE_TIME_S = 0.2
DELAY_S, LAG_S = 0.05, 0.1
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.1)
CONFIGURED = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.81875e7)


def ship_of(period_s: float) -> RollShip:
    """The configured ship with another stiffness."""
    stiffness = CONFIGURED.inertia_kg_m2 * (2 * np.pi / period_s) ** 2
    return replace(CONFIGURED, stiffness_nm_rad=stiffness)


def task_of(outputs: int, order: int) -> RetuningTask:
    design = DPC_ROLL_LEVEL if outputs == 2 else GPC_ROLL
    return RetuningTask(
        design,
        DesignPlant(CONFIGURED, TANK, DELAY_S, LAG_S),
        order,
        ModelLimits((6.0, 20.0)),
        LEAST_GAIN,
    )


@cache
def _record(period_s: float, seed: int, duration_s: float, wave_nm: float) -> FloatArray:
    ship, names = ship_of(period_s), ("roll_rad", "level_m")
    pump = sample(pump_model(ship, TANK, names), SAMPLE_TIME_S, DELAY_S, LAG_S)
    wave = sample(
        coupled_model(ship, TANK)[list(names), ["wave_moment_nm"]], SAMPLE_TIME_S, 0.0, 0.0
    )
    u = random_pulses(duration_s, PumpLimits(pressure_pa=20e3), seed, sample_time_s=SAMPLE_TIME_S)
    moment_nm = wave_nm * np.cos(0.6 * SAMPLE_TIME_S * np.arange(len(u)))
    record = np.zeros((len(u), 3))
    record[:, 0] = u
    for plant, inputs in ((pump, u), (wave, moment_nm)):
        state = np.zeros(len(plant.A))
        for k, value in enumerate(inputs):
            record[k, 1:] += plant.C @ state + plant.D[:, 0] * value
            state = plant.A @ state + plant.B[:, 0] * value
    noise = np.random.default_rng(seed).standard_normal((len(u), 2))
    record[:, 1:] += noise * [2e-4, 3.5e-3]
    return record


def record_of(
    outputs: int,
    period_s: float = 7.5,
    seed: int = 1,
    duration_s: float = 500.0,
    wave_nm: float = 2e7,
) -> FloatArray:
    """Random pulses under a regular wave of 0.6 rad/s."""
    return _record(period_s, seed, duration_s, wave_nm)[:, : 1 + outputs].copy()
