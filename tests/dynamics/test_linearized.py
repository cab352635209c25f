"""Quadratic losses as linear ones of the same work, against quadrature and simulation."""

import math

import numpy as np
import pytest

from tools.thesis.simulate import WaveMoment, simulate
from utank_hil.analysis.loop.sea_response import at_its_motion, motion_in_sea
from utank_hil.control import DesignPlant
from utank_hil.dynamics import RollModel, RollShip, Tank
from utank_hil.dynamics.tank import IRREGULAR
from utank_hil.sea import EffectiveSlope, Sea, jonswap

TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, quadratic_loss=1.5)
SHIP = RollShip(1.9275e9, 4.81875e8, 2e7, quadratic_damping_nms2_rad2=8e8)


@pytest.mark.parametrize(("level_m", "ratio"), [(0.5, 0.021), (2.0, 0.085)])
def test_loss_of_the_first_ship_s_duct_is_that_of_a_swing(level_m, ratio):
    rate = TANK.natural_frequency_rad_s * level_m
    found = TANK.linearized(rate)
    assert found.damping_ratio == pytest.approx(ratio, abs=5e-4)
    assert found.quadratic_loss == 0
    angle = np.linspace(0, 2 * math.pi, 10_001)
    speed = rate * np.sin(angle)
    work = TANK.quadratic_loss_pa_per_m2_s2 * np.trapezoid(np.abs(speed) ** 3, angle)
    assert found.loss_pa_per_m_s * np.trapezoid(speed**2, angle) == pytest.approx(work, rel=1e-6)


def test_an_irregular_motion_loses_as_much_by_the_linear_losses():
    rate = np.random.default_rng(1).normal(size=1_000_000) * 0.3
    lost = TANK.quadratic_loss_pa_per_m2_s2 * np.mean(np.abs(rate) ** 3)
    found = TANK.linearized(0.3, IRREGULAR).loss_pa_per_m_s
    assert found * np.mean(rate**2) == pytest.approx(lost, rel=5e-3)
    power = SHIP.damping_nms_rad * np.mean(rate**2)
    power += SHIP.quadratic_damping_nms2_rad2 * np.mean(np.abs(rate) ** 3)
    linear = SHIP.linearized(0.3).damping_nms_rad
    assert linear * np.mean(rate**2) == pytest.approx(power, rel=5e-3)


@pytest.mark.parametrize("hs_m", [1.2, 4.7])
def test_motion_in_a_sea_is_that_of_the_nonlinear_equations(hs_m):
    sea = Sea.irregular(jonswap(hs_m, 12.0), seed=1, components=100)
    waves = sea.roll_moment(SHIP.stiffness_nm_rad, EffectiveSlope(0.7))
    plant = DesignPlant(SHIP, TANK)
    found = motion_in_sea(None, at_its_motion(None, plant, (), waves), (), waves)
    moment = WaveMoment(waves.amplitude, waves.frequency_rad_s, waves.phase_rad)
    run = simulate(RollModel(SHIP, TANK), 7200.0, step_s=0.1, wave=moment)
    roll, level = (run.state[run.time_s > 200, n].std() for n in (0, 2))
    assert found.roll_rms_rad == pytest.approx(roll, rel=0.05)
    assert found.level_rms_m == pytest.approx(level, rel=0.05)
    assert motion_in_sea(None, plant, (), waves).level_rms_m > 1.15 * level
