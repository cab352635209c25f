import numpy as np
from rolling_ship import SHIP, TANK

from tools.thesis.damping import simulated_response
from tools.thesis.harmonic import harmonic_response
from utank_hil.dynamics import RollModel, RollShip, Tank

FREQUENCY = np.array([0.3, 0.45, 0.5, 0.7])


def test_small_waves_give_the_closed_form():
    found = simulated_response(RollModel(SHIP, TANK), FREQUENCY, 1e3)
    closed = harmonic_response(SHIP, TANK, FREQUENCY, wave_moment_nm=1.0)
    np.testing.assert_allclose(
        found.roll_rad_per_nm, closed.roll_rad * np.exp(1j * closed.roll_phase_rad), rtol=1e-4
    )
    np.testing.assert_allclose(
        found.level_m_per_nm, closed.level_m * np.exp(1j * closed.tank_phase_rad), rtol=1e-4
    )


def test_capsizing_frequencies_are_marked():
    ship = RollShip(1.468e6, 5.06e5, 3e3, restoring_odd_nm=(-1.588e6,))
    found = simulated_response(
        RollModel(ship, Tank(5, 2, 2, 0.19, damping_ratio=0.1)), np.array([0.6, 3.0]), 2.5e5
    )
    assert np.isnan(found.roll_rad_per_nm[0])
    assert np.isfinite(found.roll_rad_per_nm[1])
