"""The ship of a starter project: where its roll damping comes from, and what its law expects."""

import dataclasses
import math

import pytest
import yaml

from firmware_sim.starter import StarterShip, controller_file, make_starter, starter_sea
from utank_hil.analysis.loop.sea_response import at_its_motion, motion_in_sea
from utank_hil.analysis.tank_sizing import TankRoom
from utank_hil.assembly import build_law
from utank_hil.configuration import ControllerConfig
from utank_hil.control.constrained.law import ConstrainedLaw
from utank_hil.retuning.estimator import SHIP_PERIODS, EstimateSettings
from utank_hil.retuning.renewing import FIRST_EFFORT
from utank_hil.sea import EffectiveSlope, Sea, jonswap

MEASURED = ("roll_rad", "roll_rate_rad_s", "level_m")
SHIP = StarterShip("patrol", 63, 9.5, 1000, 0.9, 9.5, 3.2)


def test_damping_is_as_given_or_estimated_or_assumed() -> None:
    ratio, words = SHIP.damping
    # a 63 m vessel's regression with keels elsewhere: 0.015 at 3 degrees, 0.030 at 10
    assert 0.010 < ratio < 0.030
    assert "1.5 either way" in words
    given = dataclasses.replace(SHIP, roll_damping_ratio=0.07)
    assert given.damping == (0.07, "as given")
    unknown = dataclasses.replace(SHIP, draught_m=None)
    assert unknown.damping == (0.05, "assumed, --draught estimates it")


def test_radiation_of_a_hull_takes_the_place_of_the_estimate_s_waves() -> None:
    estimate, _ = SHIP.damping
    still, _ = dataclasses.replace(SHIP, radiated_ratio=0.0).damping
    assert still < estimate
    assert dataclasses.replace(SHIP, radiated_ratio=0.01).damping[0] == pytest.approx(still + 0.01)


@pytest.mark.parametrize(("draught_m", "named"), [(2.0, "beam per draught"), (9.0, "block")])
def test_a_form_beyond_the_regression_is_named_with_a_wider_factor(draught_m, named) -> None:
    words = dataclasses.replace(SHIP, draught_m=draught_m).damping[1]
    assert "2 either way" in words
    assert named in words


def test_a_starter_law_expects_no_sea_in_particular_and_is_renewed() -> None:
    """One for the starter's sea rolls this ship 1.25 times the passive roll in following waves."""
    ship = StarterShip("trawler", 75, 14, 3600, 0.9, 11.7)
    project = make_starter(ship, TankRoom.in_hull(75, 14))
    content = yaml.safe_load(project.texts["controller.yaml"])
    config = ControllerConfig.model_validate(content | {"vessel": project.vessel})
    assert config.renews
    law = build_law(config).linear
    assert isinstance(law, ConstrainedLaw)
    assert project.law.law is law  # whose margins are told
    whole = law.unlimited()
    half = dataclasses.replace(whole, gain=FIRST_EFFORT * whole.gain)

    def roll_over_passive(heading_deg: float, speed_m_s: float) -> float:
        stiffness, slope = config.plant.ship.stiffness_nm_rad, EffectiveSlope(0.7)
        heading_rad, waves = math.radians(heading_deg), jonswap(4.0, 11.0)
        sea = Sea.irregular(
            waves, 1, heading_rad=heading_rad, speed_m_s=speed_m_s, spreading=10, components=400
        )
        moment = sea.roll_moment(stiffness, slope)
        plant = at_its_motion(None, config.plant, MEASURED, moment)
        passive, active = (
            motion_in_sea(each, plant, MEASURED, moment).roll_rms_rad for each in (None, half)
        )
        return active / passive

    assert roll_over_passive(10.0, 8.0) < 1.1
    assert roll_over_passive(90.0, 0.0) < 0.75


@pytest.mark.parametrize(("roll_period_s", "written"), [(26.0, False), (27.0, True)])
def test_the_record_of_a_slow_ship_is_long_enough_to_tell_the_ship(roll_period_s, written) -> None:
    sea = starter_sea(300, roll_period_s)
    content = yaml.safe_load(controller_file("slow", roll_period_s, sea, {}))["sea_estimate"]
    assert ("record_s" in content) == written
    assert EstimateSettings(**content).record_s >= SHIP_PERIODS * roll_period_s
