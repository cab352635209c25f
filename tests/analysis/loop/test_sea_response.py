"""Closed-form root mean squares, against a time simulation of the same loop in the same sea."""

import numpy as np
import pytest
from scipy.linalg import expm
from shipped_designs import GPC_ROLL

from utank_hil.analysis.loop.sea_response import motion_in_sea, roll_response_without_tank
from utank_hil.control import DesignPlant, PredictiveLaw
from utank_hil.dynamics import RollShip, Tank, coupled_model
from utank_hil.sea import Harmonics

SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.87e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10)
TS, DELAY_S, LAG_S, STEP_S = 0.2, 0.05, 0.1, 0.01
PLANT = DesignPlant(SHIP, TANK, DELAY_S, LAG_S)
# whole cycles in 400 s, so that a mean over it is exact
WAVES = Harmonics(
    np.array([2e6, 3e6, 1e6]), 2 * np.pi / 400 * np.array([29, 40, 63]), np.array([0.3, 2.0, 4.0])
)


def simulated_rms(law):
    """Roll, level and pressure RMS over the last 400 of 2800 s, exact between steps.

    The waves are oscillators of the model itself.
    """
    model, count = coupled_model(SHIP, TANK), len(WAVES.amplitude)
    chain = np.zeros((6 + 2 * count,) * 2)  # plant, actuator, command, cosine and sine of each wave
    chain[:4, :4], chain[:4, 4] = model.A, model.B[:, 0]
    chain[4, 4], chain[4, 5] = -1 / LAG_S, 1 / LAG_S
    state = np.zeros(len(chain))
    for n in range(count):
        i = 6 + 2 * n
        chain[:4, i] = model.B[:, 1]
        chain[i, i + 1], chain[i + 1, i] = -WAVES.frequency_rad_s[n], WAVES.frequency_rad_s[n]
        state[i : i + 2] = WAVES.amplitude[n] * np.array(
            [np.cos(WAVES.phase_rad[n]), np.sin(WAVES.phase_rad[n])]
        )
    advance = expm(chain * STEP_S)
    controller, late, rows, command = law.controller(), round(DELAY_S / STEP_S), [], 0.0
    for k in range(round(2800 / STEP_S)):
        if k % 20 == 0:
            command = controller.step(state[:1])[0]
        if k % 20 == late:
            state[5] = command
        if k * STEP_S >= 2400:
            rows.append(state[[0, 2, 4]])
        state = advance @ state
    return np.sqrt(np.mean(np.square(rows), axis=0))


@pytest.mark.slow
def test_closed_form_is_the_simulated_loop():
    law = GPC_ROLL.law(PLANT)
    motion = motion_in_sea(law, PLANT, ("roll_rad",), WAVES)
    roll, level, pressure = simulated_rms(law)
    assert motion.roll_rms_rad == pytest.approx(roll, rel=1e-3)
    assert motion.level_rms_m == pytest.approx(level, rel=1e-3)
    assert motion.pressure_rms_pa == pytest.approx(pressure, rel=3e-3)


def test_one_harmonic_on_the_passive_tank_is_its_amplitude_over_root_two():
    system, wave = coupled_model(SHIP, TANK), Harmonics(*(np.array([x]) for x in (4e6, 0.6, 1.0)))
    motion = motion_in_sea(None, PLANT, (), wave)
    answer = system(0.6j)[:, 1]
    assert motion.roll_rms_rad == pytest.approx(4e6 * abs(answer[0]) / np.sqrt(2))
    assert motion.level_rms_m == pytest.approx(4e6 * abs(answer[2]) / np.sqrt(2))
    assert motion.pressure_rms_pa == 0


def test_a_law_of_zero_gain_leaves_the_passive_tank():
    zero = PredictiveLaw(np.zeros((1, 1, 1)), np.zeros((1, 1, 1)), np.zeros((1, 1, 1)), TS)
    passive = motion_in_sea(None, PLANT, (), WAVES)
    assert motion_in_sea(zero, PLANT, ("roll_rad",), WAVES) == passive


def test_waves_faster_than_the_samples_meet_the_passive_tank():
    law = GPC_ROLL.law(PLANT)
    fast = Harmonics(*(np.array([x]) for x in (4e6, 1.01 * np.pi / TS, 0.0)))
    passive = motion_in_sea(None, PLANT, (), fast)
    assert motion_in_sea(law, PLANT, ("roll_rad",), fast) == passive


def test_ship_without_tank_is_the_roll_equation():
    w = np.array([0.2, 0.5, 1.5])
    roll = roll_response_without_tank(SHIP, w)
    moment = (
        SHIP.inertia_kg_m2 * -(w**2) + 1j * w * SHIP.damping_nms_rad + SHIP.stiffness_nm_rad
    ) * roll
    np.testing.assert_allclose(moment, 1, rtol=1e-12)
