"""Records to identify the thesis's first ship from, and how wrong a model of her is.

500 s of random pulses of pressure, roll and level answered exactly, and on top of that a regular
wave or the measured storm, which rolls her as much as the pump does, and noise.
"""

from pathlib import Path
from typing import Any

import control
import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.limits import PumpLimits
from utank_hil.dynamics import RollShip, Tank, coupled_model
from utank_hil.identification import random_pulses
from utank_hil.sea import Sea, load_ndbc

SAMPLE_TIME_S = 0.2
FAST = PumpLimits(pressure_pa=50e3, rate_pa_s=500e3)
SLOW = PumpLimits(pressure_pa=50e3, rate_pa_s=50e3)
SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.87e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.1)
# a command acts from its sample on: one later than the loop's inputs, which are counted ahead
PLANT = DesignPlant(SHIP, TANK, delay_s=SAMPLE_TIME_S, lag_s=0.0)
MEASURED = ("roll_rad", "level_m")
BAND_RAD_S = np.linspace(0.2, 1.2, 101)
WAVE_RAD_S = 0.6
SEAS = Path(__file__).resolve().parents[2] / "configs" / "seas"

Matrices = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def sampled_plant() -> control.StateSpace:
    """Ship and tank: (pressure, wave moment) to (roll, level), sampled."""
    full = coupled_model(SHIP, TANK)
    chosen = control.ss(full.A, full.B, full.C[[0, 2]], np.zeros((2, 2)))
    return control.c2d(chosen, SAMPLE_TIME_S)


def respond(pressure_pa: FloatArray, moment_nm: FloatArray) -> FloatArray:
    """Roll and level from rest, shape (N, 2)."""
    inputs = np.vstack([pressure_pa, moment_nm])
    return np.asarray(control.forced_response(sampled_plant(), inputs=inputs).outputs.T)


def record(
    samples: int = 2500,
    noise: float = 0.01,
    limits: PumpLimits = FAST,
    sea: str = "calm",
    seed: int = 1,
) -> tuple[FloatArray, FloatArray]:
    """Pressure, shape (N,), and noisy outputs, shape (N, 2).

    Parameters
    ----------
    noise : float
        Standard deviation, as a part of each output's.
    sea : {"calm", "one wave", "storm"}
    """
    pressure = random_pulses(samples * SAMPLE_TIME_S, limits, seed, sample_time_s=SAMPLE_TIME_S)
    y = respond(pressure, np.zeros(samples))
    time_s = np.arange(samples) * SAMPLE_TIME_S
    if sea != "calm":
        if sea == "one wave":
            moment = np.cos(WAVE_RAD_S * time_s + seed)
        else:
            storm = load_ndbc(SEAS / "ndbc_41010_2019-02_spectral_density.txt")
            waves = Sea.irregular(storm.at("2019-02-10T05:40"), seed)
            moment = waves.roll_moment(SHIP.stiffness_nm_rad).at(
                np.asarray(time_s, dtype=np.float64)
            )
        wave = respond(np.zeros(samples), moment)
        y = y + wave * np.std(y[:, 0]) / np.std(wave[:, 0])
    return pressure, y + noise * np.std(y, axis=0) * np.random.default_rng(seed).standard_normal(
        y.shape
    )


def response(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> npt.NDArray[Any]:
    """Frequency response from the first input over `BAND_RAD_S`, complex, shape (101, m)."""
    turns = np.exp(1j * BAND_RAD_S * SAMPLE_TIME_S)
    values = [c @ np.linalg.solve(z * np.eye(len(a)) - a, b[:, :1]) + d[:, :1] for z in turns]
    return np.array(values)[:, :, 0]


def response_error(model: Matrices) -> FloatArray:
    """Relative error (2-norm) of the response of roll and of level, shape (2,)."""
    plant = sampled_plant()
    right = response(*(np.asarray(m) for m in (plant.A, plant.B, plant.C, plant.D)))
    wrong = response(*model) - right
    error: FloatArray = np.linalg.norm(wrong, axis=0) / np.linalg.norm(right, axis=0)
    return error


def without_mode(model: Matrices, frequency_rad_s: float) -> Matrices:
    """A model less the mode of that frequency that decays least, if it has one.

    That is what a regular wave leaves in a model that was given states for it. A mode counts when
    its frequency is that of the wave within one cycle of a record of 500 s.
    """
    a, b, c, d = model
    poles, vectors = np.linalg.eig(a)
    near = np.abs(np.abs(np.angle(poles)) / SAMPLE_TIME_S - frequency_rad_s) < 2 * np.pi / 500
    if not near.any():
        return model
    decay = np.where(near, np.abs(1 - np.abs(poles)), np.inf)
    wave = int(np.argmin(decay))
    pair = [wave, int(np.argmin(np.abs(poles - poles[wave].conj())))]
    kept = np.delete(np.arange(len(poles)), pair)
    shapes, shares = vectors[:, kept], np.linalg.inv(vectors)[kept]
    # a real basis of the modes that stay
    basis = np.linalg.svd(np.hstack([shapes.real, shapes.imag]))[0][:, : len(kept)]
    return basis.T @ a @ basis, basis.T @ (shapes @ shares).real @ b, c @ basis, d
