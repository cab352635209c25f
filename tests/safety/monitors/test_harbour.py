"""The monitor of heel removal: what it finds, and what cargo at a sound ship does not feign."""

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control.heel_removal import HeelingTank
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.harbour import LEAK_M, SEAT, HarbourWatch

CONFIG = load_config(Path("configs/controllers/heel_removal.yaml"), ControllerConfig)
TANK, VALVE = HeelingTank.of(CONFIG.plant), CONFIG.vessel.valve
THROTTLED = VALVE.opening(CONFIG.vessel.tank, TANK.throttle_loss)
PERIOD_S = 0.1
ROLL_S = TANK.roll_period_s


class Quay:
    """A watch, and a ship in balance whose heel is that of its cargo and its water."""

    def __init__(self, answers=1.0, roll_rad=0.0, design=CONFIG.law):
        self.watch = HarbourWatch(
            TANK, design, lambda opening: VALVE.loss(CONFIG.vessel.tank, opening), PERIOD_S
        )
        self.answers, self.roll_rad = answers, roll_rad
        self.level_m = self.cargo_rad = self.time_s = 0.0
        self.found = 0

    @property
    def heel_rad(self):
        return self.cargo_rad + self.answers * TANK.heel_per_m * self.level_m

    def run(self, seconds, *, rate_m_s=0.0, opening=0.0, pressure_pa=0.0, cargo_rad_s=0.0):
        """Go on with a valve at an opening, and return all that is found."""
        found, w0 = 0, 2 * math.pi / ROLL_S
        for _ in range(round(seconds / PERIOD_S)):
            self.time_s += PERIOD_S
            self.level_m += rate_m_s * PERIOD_S
            self.cargo_rad += cargo_rad_s * PERIOD_S
            wave = w0 * self.time_s
            motion = SimpleNamespace(
                roll_rad=self.heel_rad + self.roll_rad * math.sin(wave),
                roll_rate_rad_s=self.roll_rad * w0 * math.cos(wave),
            )
            measured = SimpleNamespace(
                level_m=self.level_m, valve_opening=opening, pressure_pa=pressure_pa
            )
            found |= self.watch.update(motion, measured, 1)
        self.found |= found
        return found

    def pump(self, level_m, periods=5.2, **more):
        """Move the water to a level as the law does, then hold it for some roll periods."""
        way = math.copysign(1.0, level_m - self.level_m)
        found = 0
        while way * (level_m - self.level_m) > 0:
            pressure = TANK.balance_pa(self.level_m, self.heel_rad) + way * TANK.flow_pa
            found |= self.run(
                1.0, rate_m_s=way * TANK.flow_m_s, opening=THROTTLED, pressure_pa=pressure, **more
            )
        return found | self.run(periods * ROLL_S, **more)


def test_sound_pumpings_in_a_swell_are_left_alone():
    quay = Quay(roll_rad=0.008)
    quay.cargo_rad = 0.01
    quay.run(70)
    for level_m in (-0.9, -1.4, 0.3):
        quay.pump(level_m)
    assert quay.found & ~Finding.TANK_USED_UP == 0


@pytest.mark.parametrize("answers", [0.4, 1.8])
def test_a_ship_of_another_stiffness_still_answers(answers):
    quay = Quay(answers)
    quay.run(70)
    for level_m in (-0.5, -1.0, -1.5):
        quay.pump(level_m)
    assert quay.found & (Finding.HEEL_UNANSWERED | Finding.HEEL_OVERDONE) == 0


@pytest.mark.parametrize(
    ("answers", "told"),
    [(0.3, Finding.HEEL_UNANSWERED), (0.0, Finding.HEEL_UNANSWERED),
     (-1.0, Finding.HEEL_UNANSWERED), (2.2, Finding.HEEL_OVERDONE), (4.0, Finding.HEEL_OVERDONE)],
)  # fmt: skip
def test_a_heel_that_does_not_answer_as_it_should_is_found_at_the_second_pumping(answers, told):
    quay = Quay(answers)
    quay.run(70)
    for level_m in (-0.5, -1.0), (-0.5, 0.0):  # what was found begins anew
        assert quay.pump(level_m[0], periods=9.0) == 0
        assert quay.pump(level_m[1], periods=9.0) == told


def test_pumpings_that_follow_one_another_sooner_than_the_heel_settles_are_judged_as_well():
    quay = Quay(answers=0.0)
    quay.run(70)
    found = [quay.pump(level_m, periods=4.0) for level_m in (-0.5, -1.0, -1.5)]
    assert found == [0, 0, Finding.HEEL_UNANSWERED]  # of each as the next one begins


@pytest.mark.parametrize("wrong", [0.0, 4.0])
def test_a_right_answer_between_two_wrong_ones_and_pumpings_of_a_tenth_of_a_degree_end_nothing(
    wrong,
):
    quay = Quay(wrong)
    quay.run(70)
    for n in range(4):
        quay.answers = (wrong, 1.0)[n % 2]
        quay.cargo_rad -= (quay.answers - (wrong, 1.0)[n % 2 - 1]) * TANK.heel_per_m * quay.level_m
        quay.run(70)
        quay.pump(-0.5 * (n % 2 + 1))
    assert quay.found == 0
    small = Quay(wrong)
    small.run(70)
    for n in range(4):
        small.pump(-0.2 * (n % 2))  # less than 0.0017 rad
    assert small.found == 0


@pytest.mark.parametrize("roll_rad", [0.0, 0.008])
def test_cargo_that_comes_as_fast_as_the_pump_takes_its_heel_away_is_no_missing_answer(roll_rad):
    quay = Quay(roll_rad=roll_rad)
    rate_rad_s = 0.5 * TANK.heel_per_m / (0.5 / TANK.flow_m_s + 5.2 * ROLL_S)
    quay.run(80, cargo_rad_s=rate_rad_s)
    for level_m in (-0.5, -1.0, -1.5):
        quay.pump(level_m, cargo_rad_s=rate_rad_s)
    assert quay.found == 0
    aground = Quay(answers=0.0, roll_rad=roll_rad)
    aground.run(80)
    for level_m in (-0.5, -1.0):
        aground.pump(level_m)
    assert aground.found == Finding.HEEL_UNANSWERED


def test_cargo_that_goes_where_the_pump_takes_its_heel_away_is_not_too_much_of_an_answer():
    quay = Quay()
    rate_rad_s = -1.5 * TANK.heel_per_m * 0.5 / (0.5 / TANK.flow_m_s + 5.2 * ROLL_S)
    quay.run(80, cargo_rad_s=rate_rad_s)
    for level_m in (-0.5, -1.0, -1.5):
        quay.pump(level_m, cargo_rad_s=rate_rad_s)
    assert quay.found == 0


def test_one_load_that_swings_out_while_water_is_moved_is_no_missing_answer():
    quay = Quay()
    quay.run(70)
    quay.cargo_rad += 1.2 * 0.5 * TANK.heel_per_m
    quay.pump(-0.5)
    quay.pump(-1.0)
    assert quay.found == 0


@pytest.mark.parametrize(
    ("rate", "told"),
    [(1.0, 0), (0.5, 0), (0.36, 0), (2.0, 0), (2.8, 0), (0.0, Finding.LEVEL_STUCK),
     (0.3, Finding.LEVEL_STUCK), (-0.3, Finding.LEVEL_STUCK), (-0.36, Finding.WATER_SIGN),
     (-1.0, Finding.WATER_SIGN), (3.3, Finding.VALVE_PASSES), (4.0, Finding.VALVE_PASSES)],
)  # fmt: skip
@pytest.mark.parametrize("shut_s", [0.5, 5.0])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_water_that_does_not_creep_as_it_is_pressed_is_found_within_three_seconds(
    rate, told, shut_s, way
):
    quay = Quay()
    quay.run(shut_s)
    found = 0
    for _ in range(25):
        balance_pa = TANK.balance_pa(quay.level_m, quay.heel_rad)
        found |= quay.run(
            0.1,
            rate_m_s=way * rate * TANK.flow_m_s,
            opening=THROTTLED,
            pressure_pa=balance_pa + way * TANK.flow_pa,
        )
    assert found == told


def test_water_goes_through_an_open_valve_ten_times_as_fast_as_through_the_throttle_at_most():
    opening = next(
        each
        for each in np.linspace(0.5, 1, 5001)
        if VALVE.loss(CONFIG.vessel.tank, each) < 1e-3 * TANK.throttle_loss
    )
    for times, told in ((10.0, 0), (4.5, 0), (2.8, Finding.LEVEL_STUCK)):
        quay = Quay()
        quay.run(5)
        found = 0
        for _ in range(20):
            balance_pa = TANK.balance_pa(quay.level_m, quay.heel_rad)
            rate_m_s = 0.2 * times * TANK.flow_m_s
            pressure_pa = balance_pa + 0.04 * TANK.flow_pa
            found |= quay.run(0.1, rate_m_s=rate_m_s, opening=opening, pressure_pa=pressure_pa)
        assert found == told


def test_what_moves_while_the_valve_seats_is_no_leak_and_after_three_seconds_is_one():
    quay = Quay()
    assert quay.run(2.8, rate_m_s=0.1) == 0
    assert quay.run(30) == 0
    quay = Quay()
    quay.run(3.1)
    assert quay.run(2.0, rate_m_s=0.2) == Finding.VALVE_PASSES


def test_a_valve_on_its_seat_counts_as_shut():
    quay = Quay()
    quay.run(5, opening=SEAT)
    quay.run(1.0, rate_m_s=0.1, opening=SEAT)
    assert quay.run(5.0, opening=SEAT) == Finding.VALVE_PASSES
    quay = Quay()
    quay.run(5, opening=1.3 * SEAT)
    assert quay.run(1.0, rate_m_s=0.1, opening=1.3 * SEAT) == 0
    assert quay.run(5.0, opening=1.3 * SEAT) == 0


def test_a_level_that_jumps_passes_a_low_pass_of_three_seconds():
    quay = Quay()
    quay.run(20)
    quay.level_m += 0.06  # 0.05 of it after 3 s ln 6 = 5.4 s
    assert quay.run(5.0) == 0
    assert quay.run(1.0) == Finding.VALVE_PASSES


@pytest.mark.parametrize(("rate_m_h", "told"), [(0.25, 0), (0.35, Finding.VALVE_PASSES)])
def test_the_mean_of_ten_minutes_follows_up_to_0_3_m_an_hour(rate_m_h, told):
    quay = Quay()
    quay.run(20)
    assert quay.run(5400, rate_m_s=rate_m_h / 3600) == told


@pytest.mark.parametrize("opening", [THROTTLED, 1.0])
def test_water_that_is_met_behind_an_open_valve_says_nothing_at_first(opening):
    quay = Quay()
    quay.level_m = -2.0
    pressure_pa = TANK.balance_pa(-2.0, quay.heel_rad) - 10.0
    assert quay.run(0.5, opening=opening, pressure_pa=pressure_pa) == 0
    assert quay.run(30) == 0


def test_a_leak_is_found_before_a_tenth_of_a_metre_and_a_drift_of_a_gauge_is_not():
    quay = Quay()
    quay.run(20)
    leak = quay.run(2 * LEAK_M / 0.002, rate_m_s=-0.002)
    assert leak == Finding.VALVE_PASSES
    slow = Quay()
    slow.run(20)
    assert slow.run(3600, rate_m_s=0.1 / 3600) == 0


@pytest.mark.parametrize(("degrees", "told"), [(0.8, 0), (1.3, Finding.NOT_IN_HARBOUR)])
def test_a_ship_that_rolls_is_at_sea(degrees, told):
    rms = math.degrees(CONFIG.law.most_roll_rad)
    quay = Quay(roll_rad=math.radians(degrees) * math.sqrt(2) * rms)
    assert quay.run(120) == told


def test_a_ship_that_rolls_twice_as_much_is_at_sea_after_a_third_of_the_minute_of_its_memory():
    quay = Quay(roll_rad=2 * math.sqrt(2) * CONFIG.law.most_roll_rad)
    found_s = next(k * PERIOD_S for k in range(1200) if quay.run(PERIOD_S))
    assert found_s == pytest.approx(60 * math.log(4 / 3), abs=0.25 * ROLL_S)


def test_what_was_told_ends_so_that_it_can_be_reset():
    quay = Quay()
    quay.run(5)
    quay.run(3, rate_m_s=0.0, opening=THROTTLED, pressure_pa=TANK.flow_pa)
    assert quay.run(9.5) == Finding.LEVEL_STUCK
    assert quay.run(5) == 0


def test_what_was_told_lasts_ten_seconds():
    quay = Quay()
    quay.run(5)
    pressed = {"opening": THROTTLED, "pressure_pa": TANK.flow_pa}
    while not quay.run(PERIOD_S, **pressed):
        pass
    told = [quay.run(PERIOD_S) for _ in range(120)]
    assert 98 <= told.count(Finding.LEVEL_STUCK) <= 101


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("target_rad", [0.0, 0.02])
def test_a_tank_that_is_used_up_is_told_while_the_heel_is_left(side, target_rad):
    quay = Quay(design=replace(CONFIG.law, target_rad=side * target_rad))
    quay.cargo_rad = side * (0.03 + target_rad)
    quay.run(70)
    quay.pump(-side * 0.91 * TANK.most_m)
    assert quay.run(1) == 0
    quay.pump(-side * 0.97 * TANK.most_m)
    assert quay.run(1) == Finding.TANK_USED_UP
    quay.cargo_rad = side * target_rad - TANK.heel_per_m * quay.level_m
    quay.run(100)
    assert quay.run(1) == 0
    assert np.isclose(quay.heel_rad, side * target_rad)
