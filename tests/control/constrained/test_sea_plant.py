"""The plant that foresees the waves: its roll is the roll in the spectrum."""

import numpy as np
import pytest
from rolling_ship import SHIP, TANK
from scipy.linalg import solve_discrete_lyapunov

from utank_hil.control.constrained.design import sea_plant
from utank_hil.control.interface import DesignPlant
from utank_hil.control.sea_model import SeaModel
from utank_hil.dynamics.linear import STATES, coupled_model, pump_model
from utank_hil.dynamics.sampling import sample, state_space_response
from utank_hil.sea import jonswap

SPECTRUM = jonswap(4.7, 10.0)
TS = 0.2


def plant_of(model: SeaModel, heel_std_rad: float = 0.0):
    return sea_plant(
        model,
        DesignPlant(SHIP, TANK),
        heel_std_rad=heel_std_rad,
        heel_time_s=1e4,
        sample_time_s=TS,
    )[:2]


def test_motion_of_the_passive_ship_in_the_model_is_that_in_the_spectrum():
    model = SeaModel(tuple(SPECTRUM.frequency_hz), tuple(SPECTRUM.density), order=16, floor=1e-4)
    plant, covariance = plant_of(model)
    spread = plant.C @ solve_discrete_lyapunov(plant.A, covariance) @ plant.C.T
    system = coupled_model(SHIP, TANK)
    omega = np.linspace(0.2, 6.0, 20_000)
    gain = np.abs(state_space_response(system, 1j * omega)[:, :, 1]) * SHIP.stiffness_nm_rad
    density = model.slope_density(omega)
    for name in ("roll_rad", "roll_rate_rad_s", "level_m"):
        row = STATES.index(name)
        expected = np.trapezoid(gain[:, row] ** 2 * density, omega)
        assert spread[row, row] == pytest.approx(expected, rel=0.08)


def test_from_command_to_motion_it_is_the_sampled_plant():
    model = SeaModel(tuple(SPECTRUM.frequency_hz), tuple(SPECTRUM.density))
    plant, _ = plant_of(model)
    expected = sample(pump_model(SHIP, TANK, STATES), TS, 0.05, 0.1)
    z = np.exp(1j * np.linspace(0.05, 3, 30))
    np.testing.assert_allclose(
        state_space_response(plant, z), state_space_response(expected, z), rtol=1e-8
    )


def test_heel_adds_its_own_variance_at_rest():
    model = SeaModel(tuple(SPECTRUM.frequency_hz), tuple(SPECTRUM.density))
    roll = STATES.index("roll_rad")
    found = []
    for heel in (0.0, 0.05):
        plant, covariance = plant_of(model, heel)
        spread = plant.C @ solve_discrete_lyapunov(plant.A, covariance) @ plant.C.T
        found.append(spread[roll, roll])
    system = coupled_model(SHIP, TANK)
    static = np.linalg.solve(system.A, -system.B[:, 1])[0] * SHIP.stiffness_nm_rad
    assert found[1] - found[0] == pytest.approx((0.05 * static) ** 2, rel=0.02)
