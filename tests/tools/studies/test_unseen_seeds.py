"""Figures of twenty seeds, and the ship and waves that a case's name stands for."""

import math

import pytest

from tools.studies.unseen_seeds import CLAIRVOYANT, FIRST_SEED, PASSIVE, case, row, sailed

TRAWLER = "trawler, 75 m"


def test_a_row_has_the_mean_its_interval_and_the_worst_window():
    runs = [
        {PASSIVE: [2.0, 2.0], CLAIRVOYANT: [1.0, 1.0], "GPC": [1.5, 1.6]},
        {PASSIVE: [4.0, 2.0], CLAIRVOYANT: [2.0, 1.0], "GPC": [2.0, 2.1]},
    ]
    found = row(runs)["GPC"]
    # below passive 0.25 and 0.5; Student's t of one degree of freedom is 12.706
    assert found["below_passive"]["mean"] == pytest.approx(0.375)
    half_width = 12.706 * (0.25 / math.sqrt(2.0)) / math.sqrt(2.0)
    assert found["below_passive"]["half_width"] == pytest.approx(half_width, rel=1e-3)
    assert found["share"]["mean"] == pytest.approx(0.75)
    assert found["greatest_window"] == pytest.approx(1.05)
    assert found["of_seed"] == FIRST_SEED + 1


def test_a_case_is_the_ship_of_the_file_as_it_is_loaded_in_waves_of_its_own():
    own, other = case(f"{TRAWLER}: beam, of the file"), case(f"{TRAWLER}: quartering, 45°, 6 m/s")
    assert (own.scenario.sea.heading_deg, own.scenario.sea.speed_m_s) == (90.0, 0.0)
    assert (other.scenario.sea.heading_deg, other.scenario.sea.speed_m_s) == (45.0, 6.0)
    slow = case(f"{TRAWLER}: ship at 1.3 of its period").scenario.vessel.ship
    ratio = own.config.vessel.ship.natural_frequency_rad_s / slow.natural_frequency_rad_s
    assert ratio == pytest.approx(1.3)


@pytest.mark.slow
def test_a_renewed_law_rolls_the_ship_less_than_the_first_and_more_than_the_bound():
    found = sailed("storm hour", 4001)
    rolls = [found[name][0] for name in (CLAIRVOYANT, "renewed", "first", PASSIVE)]
    assert rolls == sorted(rolls)
