from dataclasses import replace

import numpy as np
import pytest

from tools.thesis.ships import stimulate_on_still_water, tuned_tank
from utank_hil.dynamics import RollModel, RollShip, Tank

SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.81875e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.16, headroom_m=4.0)


def test_tuned_tank_has_the_ship_s_frequency():
    tank = tuned_tank(SHIP, TANK)
    assert tank.natural_frequency_rad_s == pytest.approx(0.5, rel=1e-12)
    with pytest.raises(ValueError, match="lower it"):
        tuned_tank(SHIP, replace(TANK, height_m=60.0))


def test_figure_2_8_three_degrees_then_a_tenfold_fall_in_four_to_five_cycles():
    model = RollModel(SHIP, tuned_tank(SHIP, TANK))
    outcome = stimulate_on_still_water(model, 10.6e3, 0.5)
    assert np.degrees(outcome.stimulated_rad) == pytest.approx(3.0, abs=0.15)
    assert 4.0 <= outcome.cycles_to_tenth <= 5.0
    # the water leads by a quarter while it drives the ship ...
    assert np.degrees(outcome.level_lead_rad) == pytest.approx(90, abs=15)
    time, level = outcome.run.time_s, np.abs(outcome.run.state[:, 2])

    def highest(start, stop):
        return level[(time > start) & (time <= stop)].max()

    # ... drops considerably at the stop, and then rises when the ship drives it
    driving = highest(128, 141)
    assert highest(144, 150) < 0.6 * driving
    assert highest(150, 175) > 1.1 * driving


def test_a_pump_that_never_stops_is_refused():
    with pytest.raises(ValueError, match="off_s"):
        stimulate_on_still_water(RollModel(SHIP, TANK), 1e4, 0.5, off_s=400.0)
