"""The water in a ship whose centre of gravity is accelerated sideways, against `tank_wrench`."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from roll_energy import PATTI, PATTI_TANK, THESIS_SHIP, THESIS_TANK

from utank_hil.dynamics.nonlinear import RollModel
from utank_hil.dynamics.wrench import tank_wrench

UNIT = st.floats(-1, 1)


@given(UNIT, UNIT, UNIT, UNIT, UNIT, UNIT, st.sampled_from([0, 1]))
def test_sway_moves_ship_and_water_by_the_exact_wrench(roll, rate, level, speed, sway, push, which):
    ship, tank = ((THESIS_SHIP, THESIS_TANK), (PATTI, PATTI_TANK))[which]
    level, sway_m_s2, pressure_pa = 0.9 * level * tank.height_m, 4.0 * sway, 3e4 * push
    model = RollModel(ship, tank)
    change = model.derivative(
        [roll, 0.3 * rate, level, speed], pressure_pa, 0.0, sway_m_s2=sway_m_s2
    )
    # the centre of gravity moves sideways alone, so its body components turn with the roll
    across = np.array([0.0, math.cos(roll), -math.sin(roll)])
    _, moment, residual = tank_wrench(
        tank, level, speed, change[3], np.zeros(3), [0.3 * rate, 0, 0], sway_m_s2 * across,
        [change[1], 0, 0], roll, 0.0,
    )  # fmt: skip
    righting = float(model.restoring.moment_nm(roll))
    assert ship.inertia_kg_m2 * change[1] == pytest.approx(
        moment[0] - righting, abs=1e-9 * (abs(righting) + abs(moment[0]) + 1)
    )
    loss_pa = (tank.loss_pa_per_m_s + tank.quadratic_loss_pa_per_m2_s2 * abs(speed)) * speed
    assert tank.density_kg_m3 * residual == pytest.approx(pressure_pa - loss_pa, abs=1e-3)


@pytest.mark.parametrize("slope_rad", [0.02, 0.3])
def test_water_in_a_ship_that_lies_along_a_long_wave_is_at_rest(slope_rad):
    model = RollModel(THESIS_SHIP, THESIS_TANK)
    held_nm = float(model.restoring.moment_nm(slope_rad))
    along = model.derivative(
        [slope_rad, 0.0, 0.0, 0.0], 0.0, held_nm, sway_m_s2=9.80665 * math.tan(slope_rad)
    )
    np.testing.assert_allclose(along, 0.0, atol=1e-12)
    # without sway it would run down to the lower side
    assert model.derivative([slope_rad, 0.0, 0.0, 0.0], 0.0, held_nm)[3] > 0.1 * slope_rad
