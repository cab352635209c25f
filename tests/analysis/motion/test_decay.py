import numpy as np
import pytest

from tools.thesis.capsize.threshold import without_tank
from utank_hil.analysis.motion.decay import roll_decay
from utank_hil.dynamics import RollModel, RollShip, Tank, simulate

TANK = Tank(17.1, 4.88, 17.11, 6.22)


def decay(ship, start_rad):
    run = simulate(without_tank(RollModel(ship, TANK)), 200.0, (start_rad, 0, 0, 0))
    return roll_decay(run.time_s, run.state[:, 0], least_rad=0.01)


def test_linear_decay_gives_back_frequency_and_damping_ratio():
    ship = RollShip(2e9, 2e9 * 0.25, 2 * 0.02 * 0.5 * 2e9)
    found = decay(ship, 0.2)
    assert found.period_s == pytest.approx(2 * np.pi / (0.5 * np.sqrt(1 - 0.02**2)), rel=1e-4)
    assert found.damping_ratio == pytest.approx(0.02, rel=2e-3)
    assert abs(found.quadratic_per_rad) < 1e-3


def test_quadratic_decay_gives_back_both_parts():
    ship = RollShip(2e9, 2e9 * 0.25, 2 * 0.01 * 0.5 * 2e9, 0.2 * 2e9)
    found = decay(ship, 0.2)
    assert found.damping_ratio == pytest.approx(0.01, rel=0.03)
    assert found.quadratic_per_rad == pytest.approx(0.2, rel=0.03)


def test_too_short_a_record_is_refused():
    time = np.linspace(0, 10, 1001)
    with pytest.raises(ValueError, match="four peaks"):
        roll_decay(time, np.cos(0.5 * time))
