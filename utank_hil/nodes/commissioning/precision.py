"""How well pulses tell the scales of gauges and roll by noisy sensors, and how many it takes.

Noise in what is to explain the pressure makes least squares find too little of it, and more pulses
do not help. So what the files say of the motion by the command stands in for one side
(instrumental variables): it has no noise, and a wrong file makes the answer less sharp, not wrong.
"""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control.interface import DesignPlant
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.safety.monitors.noise import DerivativeFilter

SCALE: Final = 0.06
"""Of pressure, and of levels by it: at sea the monitors bear 10 % of either, not 15 (the storm)."""
ROLL_SCALE: Final = 0.3
"""Tolerances, as shares."""
CORNER: Final = 1.5
"""Of the filters, as a share of the tank's frequency: the scales' deviations are least by it."""
DEVIATIONS: Final = 4.0
"""Of a scale that its tolerance is to hold; zeros and the files' errors take a part of it."""

Record = Mapping[str, FloatArray]
"""Columns of equal length by name, one row every sample time."""


def filtered(column: FloatArray, plant: DesignPlant, sample_time_s: float) -> FloatArray:
    """A signal's second derivative, first derivative and value, low-pass filtered, shape (3, n)."""
    signal = DerivativeFilter(CORNER * plant.tank.natural_frequency_rad_s, sample_time_s)
    return np.array([(signal.update(x), signal.rate, signal.value) for x in column.tolist()]).T


def push_of(roll: FloatArray, plant: DesignPlant) -> FloatArray:
    """The push of a filtered roll on the water, as pressure over density."""
    mass, _, stiffness = coupled_matrices(plant.ship, plant.tank)
    push = -(mass[1, 0] * roll[0] + stiffness[1, 0] * roll[2])
    return np.asarray(push / (plant.tank.density_kg_m3 * plant.tank.reservoir_area_m2))


def columns_of(level: FloatArray, push: FloatArray) -> FloatArray:
    """What explains a pressure: a filtered level, less the roll's push, and friction, (5, n)."""
    return np.vstack([level, -push, np.abs(level[1]) * level[1]])


def instruments(command_pa: FloatArray, plant: DesignPlant, sample_time_s: float) -> FloatArray:
    """What the files say of the columns that explain a pressure, and of the roll, shape (8, n)."""
    model = plant.sampled(("level_m", "roll_rad"), sample_time_s)
    state, outputs = np.zeros(len(model.A)), []
    for asked in command_pa.tolist():
        outputs.append(model.C @ state)
        state = model.A @ state + model.B[:, 0] * asked
    level, roll = (filtered(each, plant, sample_time_s) for each in np.array(outputs).T)
    return np.vstack([columns_of(level, push_of(roll, plant)), roll])


def deviations(command_pa: FloatArray, plant: DesignPlant, sample_time_s: float) -> FloatArray:
    """Deviations of a gauge's scale and of the roll's by noise of 1 m and 1 Pa a row, (2, 2)."""
    weights = np.linalg.pinv(instruments(command_pa, plant, sample_time_s)[:5])[:, 2:4].T
    impulse = np.zeros(len(command_pa))
    impulse[0] = 1.0
    bend, rate, value = filtered(impulse, plant, sample_time_s)
    tank = plant.tank
    inertia_m = 2 * GRAVITY_M_S2 / tank.natural_frequency_rad_s**2
    loss = tank.loss_pa_per_m_s / tank.density_kg_m3
    level = inertia_m * bend + loss * rate + 2 * GRAVITY_M_S2 * value
    found = [
        [np.linalg.norm(np.convolve(row[::-1], answer)[: len(row)]) for row in weights]
        for answer in (level, value / tank.density_kg_m3)
    ]
    return np.array(found).T / [[2 * GRAVITY_M_S2], [1.0]]


def noise_of(column: FloatArray) -> float:
    """The noise of a row, whatever moves slowly: by second differences."""
    return float(np.diff(column, n=2).std()) / math.sqrt(6)


def times_needed(rest: Record, of_noise: FloatArray) -> float:
    """How many times pulses with such `deviations` tell the scales by the noise at rest."""
    gauges = max(noise_of(rest["port_level_m"]), noise_of(rest["starboard_level_m"]))
    found = np.hypot(*(of_noise * [gauges, noise_of(rest["pressure_pa"])]).T)
    return float(np.max(DEVIATIONS * found / [SCALE, ROLL_SCALE])) ** 2
