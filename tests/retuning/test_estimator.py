"""The loop's end of the estimates: when it asks, what it shows, and when that is old."""

from dataclasses import replace

import numpy as np
import pytest
from retuning_toys import SHIP, ToyRetuner

from utank_hil.canbus import Verdict
from utank_hil.dynamics import RollShip, Tank
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.retuning import EstimateSettings, Estimator, MotionEstimate, Refusal, ShipFigures
from utank_hil.retuning.estimator import OUTDATED, SAMPLE_TIME_S, metacentric_height_m
from utank_hil.sea import SlopeSpectrum

OMEGA = np.linspace(0.2, 2.0, 50)
WAVES = SlopeSpectrum(OMEGA, np.exp(-OMEGA))
GOOD = MotionEstimate(Verdict.GOOD, Verdict.GOOD, SHIP, WAVES, 0.05, 3.2, 9.1, 1200.0)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.1)
WEIGHT_N = 1e8
CONFIGURED = RollShip(4.05e8, 1e9, 5e7, displacement_n=WEIGHT_N)  # 15 rolls in a minute
SETTINGS = EstimateSettings(every_s=60.0, record_s=300.0)


class Motion:
    """Feeds an estimator with a rolling ship."""

    def __init__(self, desk: ToyRetuner, least_gm_m: float | None = None) -> None:
        self.desk = desk
        self.estimator = Estimator(SETTINGS, desk, CONFIGURED, TANK, least_gm_m)
        self.count = 0
        self.came: list[tuple[float, MotionEstimate]] = []

    def run(self, duration_s: float, *, fresh: bool = True) -> None:
        for _ in range(round(duration_s / SAMPLE_TIME_S)):
            time_s = self.count * SAMPLE_TIME_S
            motion = (0.1 * time_s, 0.2, 0.3)
            found = self.estimator.sample(round(time_s * 1e9), motion, fresh=fresh)
            if found is not None:
                self.came.append((time_s, found))
            self.count += 1


def test_it_asks_once_an_interval_for_the_latest_record_and_shows_what_came():
    motion = Motion(ToyRetuner(GOOD, looks=5))
    motion.run(50.0)
    assert motion.desk.records == []
    motion.run(400.0)
    times_s = [time_s for time_s, _ in motion.came]
    assert times_s == pytest.approx([61.2, *(120.2 + 60 * k for k in range(6))], abs=0.5)
    first, last = motion.desk.records[0], motion.desk.records[-1]
    assert first.record.shape == (301, 3)
    assert last.record.shape == (1500, 3)
    assert first.ship == ShipFigures(1e9, 4.05e8, 5e7)
    assert first.record[-1].tolist() == pytest.approx([6.0, 0.2, 0.3])
    figures = motion.estimator.figures
    assert (figures.sea.verdict, figures.ship.verdict) == (Verdict.GOOD, Verdict.GOOD)
    assert figures.sea[1:5] == (3.2, 9.1, WAVES.rms_rad, 0.05)
    assert figures.ship[1] == pytest.approx(SHIP.roll_period_s)
    assert "roll period 8.89" in figures.words()[1]


def test_the_ship_that_was_told_is_the_known_one_of_the_next_request():
    heavier = replace(SHIP, inertia_kg_m2=3e9)
    motion = Motion(ToyRetuner(replace(GOOD, ship=heavier)))
    motion.run(125.0)
    assert motion.desk.records[1].ship == heavier
    motion.desk.reply = replace(GOOD, of_ship=Verdict.UNCERTAIN)
    motion.run(120.0)
    assert motion.desk.records[3].ship == heavier
    assert motion.estimator.figures.ship.verdict is Verdict.UNCERTAIN
    # what is shown of the ship is what was told last, with its age
    assert motion.estimator.figures.ship.roll_period_s == pytest.approx(heavier.roll_period_s)
    assert motion.estimator.figures.ship.age_s > 100


def test_what_is_not_new_is_a_gap():
    motion = Motion(ToyRetuner(GOOD))
    motion.run(30.0)
    motion.run(31.0, fresh=False)
    record = motion.desk.records[0].record
    assert np.isnan(record[160:]).all()
    assert np.isfinite(record[:139]).all()


def test_without_another_estimate_nothing_is_known_after_three_intervals_but_its_age():
    motion = Motion(ToyRetuner(GOOD), least_gm_m=9.0)
    motion.run(61.0)
    figures = motion.estimator.figures
    assert figures.sea.age_s == pytest.approx(0.8, abs=0.3)
    motion.estimator.take_news()
    motion.desk.alive = False
    motion.run(60.0 * OUTDATED - 5)
    assert (figures.sea.verdict, figures.gm_low) == (Verdict.GOOD, False)
    motion.run(10.0)
    assert (figures.sea.verdict, figures.ship.verdict) == (Verdict.OUTDATED, Verdict.OUTDATED)
    assert np.isnan([*figures.sea[1:5], *figures.ship[1:5]]).all()
    assert figures.sea.age_s == figures.ship.age_s == pytest.approx(185.8, abs=0.3)
    assert figures.gm_low  # nobody watches it any more
    assert "the last estimate is 180 s old" in motion.estimator.take_news()[-1]
    # whoever works with estimates hears of it once
    assert [(found.of_sea, found.ship) for _, found in motion.came[1:]] == [
        (Verdict.OUTDATED, None)
    ]
    motion.desk.alive = True
    motion.run(62.0)
    assert (figures.ship.verdict, figures.gm_low) == (Verdict.GOOD, False)
    assert figures.ship.gm_m == pytest.approx(metacentric_height_m(CONFIGURED, TANK, 1e9))


@pytest.mark.parametrize("reply", [None, Refusal(("the retuner failed",))])
def test_estimates_that_never_come_are_outdated_too(reply: Refusal | None):
    motion = Motion(ToyRetuner(reply), least_gm_m=9.0)
    motion.run(60.0 * OUTDATED - 1)
    assert motion.estimator.figures.ship.verdict is Verdict.RECORD_SHORT
    motion.run(2.0)
    figures = motion.estimator.figures
    assert (figures.sea.verdict, figures.ship.verdict, figures.gm_low) == (
        *2 * (Verdict.OUTDATED,),
        True,
    )
    assert "there was none" in motion.estimator.take_news()[-1]


def test_without_a_limit_on_gm_nobody_is_warned_that_it_is_not_known():
    motion = Motion(ToyRetuner(None))
    motion.run(60.0 * OUTDATED + 1)
    assert motion.estimator.figures.ship.verdict is Verdict.OUTDATED
    assert not motion.estimator.figures.gm_low


def test_an_answer_that_comes_when_it_would_be_outdated_is_none():
    motion = Motion(ToyRetuner(GOOD, looks=round(200 / SAMPLE_TIME_S)))
    motion.run(260.3)
    assert motion.desk.looks < 0
    assert [found.of_sea for _, found in motion.came] == [Verdict.OUTDATED]
    motion.run(1.0)
    assert [found.of_sea for _, found in motion.came] == [Verdict.OUTDATED, Verdict.GOOD]


def test_a_ship_that_was_not_identified_for_an_hour_is_not_shown_but_a_warning_stays():
    motion = Motion(ToyRetuner(GOOD), least_gm_m=9.3)
    motion.run(61.0)
    figures = motion.estimator.figures
    motion.desk.reply = replace(GOOD, of_ship=Verdict.UNCERTAIN)
    motion.run(3590.0)
    assert figures.ship.gm_m > 9
    motion.run(20.0)
    assert (figures.sea.verdict, figures.ship.verdict) == (Verdict.GOOD, Verdict.UNCERTAIN)
    assert np.isnan(figures.ship[1:5]).all()
    assert figures.ship.age_s == pytest.approx(3610.8, abs=0.5)
    assert figures.gm_low  # no ship was identified that has more
    assert any("roll period and GM" in each for each in motion.estimator.take_news())


def test_a_failure_changes_nothing_and_is_asked_again():
    motion = Motion(ToyRetuner(Refusal(("the retuner was killed",))))
    motion.run(125.0)
    assert motion.came == []
    assert len(motion.desk.records) == 2
    assert motion.estimator.figures.sea.verdict is Verdict.RECORD_SHORT


def test_why_no_estimates_come_is_known_from_the_first_failure_until_one_comes():
    motion = Motion(ToyRetuner(GOOD))
    motion.run(61.0)
    assert motion.estimator.trouble == ""
    motion.desk.reply = Refusal(("the retuner was killed", "by signal 9"))
    motion.run(60.0)
    assert motion.estimator.trouble == "the retuner was killed; by signal 9"
    motion.desk.reply = Refusal(("another reason",))
    motion.run(60.0)
    assert motion.estimator.trouble.startswith("the retuner was killed")
    motion.desk.reply = GOOD
    motion.run(60.0)
    assert motion.estimator.trouble == ""


@pytest.mark.parametrize("answered_before", [True, False])
def test_a_process_that_says_nothing_is_in_trouble_when_its_estimates_are_outdated(
    answered_before: bool,
):
    motion = Motion(ToyRetuner(GOOD))
    if answered_before:
        motion.run(61.0)
    motion.desk.alive = False
    motion.run(60.0 * OUTDATED - 1)
    assert motion.estimator.trouble == ""
    motion.run(2.0)
    assert motion.estimator.trouble.startswith("nothing was heard for 180 s")
    motion.desk.alive = True
    motion.run(62.0)
    assert motion.estimator.trouble == ""


def test_metacentric_height_is_that_of_free_water_and_total_weight():
    # a tank is a free surface of two reservoirs: its water shifts until the levels are level
    solid = replace(CONFIGURED, stiffness_nm_rad=1e9)
    angle = 1e-3
    water_kg = 1000 * (
        2 * TANK.height_m * TANK.reservoir_area_m2 + TANK.duct_area_m2 * TANK.width_m
    )
    level_m = angle * TANK.width_m / 2
    shifted_kgm = 1000 * TANK.reservoir_area_m2 * level_m * TANK.width_m
    # the water's own weight above the centre of gravity: reservoirs at half height, duct below
    lever_kgm = (
        2 * 1000 * TANK.height_m * TANK.reservoir_area_m2 * (TANK.height_m / 2 - TANK.lz_m)
        - 1000 * TANK.duct_area_m2 * TANK.width_m * TANK.lz_m
    )
    moment = 1e9 * angle - GRAVITY_M_S2 * (shifted_kgm + lever_kgm * angle)
    expected = moment / angle / (WEIGHT_N + GRAVITY_M_S2 * water_kg)
    assert metacentric_height_m(solid, TANK, 1e9) == pytest.approx(expected, rel=0.02)
    assert np.isnan(metacentric_height_m(replace(solid, displacement_n=0.0), TANK, 1e9))


@pytest.mark.parametrize(("least_m", "low"), [(None, False), (9.0, False), (9.3, True)])
def test_stability_is_low_when_the_interval_reaches_below_the_limit(
    least_m: float | None, low: bool
):
    motion = Motion(ToyRetuner(GOOD), least_m)
    motion.run(61.0)
    figures = motion.estimator.figures
    assert figures.ship.gm_m == pytest.approx(metacentric_height_m(CONFIGURED, TANK, 1e9))
    assert figures.ship.gm_deviation_m == pytest.approx(0.02 * 1e9 / WEIGHT_N, rel=0.1)
    assert figures.gm_low is low
