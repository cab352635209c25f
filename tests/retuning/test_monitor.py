"""A ship that differs from her law's, by the motion's estimate."""

import math
from dataclasses import replace

import pytest

from utank_hil.canbus import Verdict
from utank_hil.retuning import MotionEstimate, ShipFigures
from utank_hil.retuning.estimate import ChangeMonitor

DESIGNED = ShipFigures(4.8e8, 1.9e9, 4.8e7)
FOUND = replace(DESIGNED, stiffness_deviation=0.02, period_deviation=0.01)


def told(ship: ShipFigures | None, verdict: Verdict = Verdict.GOOD) -> float:
    monitor = ChangeMonitor(DESIGNED)
    for _ in range(2):
        monitor.watch(MotionEstimate(Verdict.GOOD, verdict, ship))
    return monitor.change


@pytest.mark.parametrize("factor", [0.75, 1.5])
def test_change_is_the_factor_of_the_period_in_either_direction(factor: float) -> None:
    ship = replace(FOUND, stiffness_nm_rad=factor * FOUND.stiffness_nm_rad)
    period = ship.roll_period_s / DESIGNED.roll_period_s
    assert period == pytest.approx(1 / math.sqrt(factor))
    assert told(ship) == pytest.approx(max(period, 1 / period))


def test_a_heavier_ship_of_the_same_period_is_another_ship() -> None:
    heavier = replace(
        FOUND,
        stiffness_nm_rad=1.3 * FOUND.stiffness_nm_rad,
        inertia_kg_m2=1.3 * FOUND.inertia_kg_m2,
    )
    assert told(heavier) == pytest.approx(math.sqrt(1.3))


def test_a_difference_within_its_error_is_none() -> None:
    near = replace(FOUND, stiffness_nm_rad=1.04 * FOUND.stiffness_nm_rad)
    assert told(near) == 1.0
    assert told(replace(near, stiffness_deviation=0.004, period_deviation=0.002)) > 1.015


@pytest.mark.parametrize("verdict", [each for each in Verdict if each is not Verdict.GOOD])
def test_what_can_not_be_told_is_no_change(verdict: Verdict) -> None:
    assert told(replace(FOUND, stiffness_nm_rad=9e8), verdict) == 1.0
    assert told(None) == 1.0


def test_one_estimate_alone_is_no_change() -> None:
    monitor = ChangeMonitor(DESIGNED)
    for factor, expected in ((1.5, False), (0.6, False), (1.5, False), (1.5, True), (0.6, True)):
        ship = replace(FOUND, stiffness_nm_rad=factor * FOUND.stiffness_nm_rad)
        monitor.watch(MotionEstimate(Verdict.GOOD, Verdict.GOOD, ship))
        assert (monitor.change > 1) == expected


@pytest.mark.parametrize("how", ["estimates are outdated", "restart"])
def test_a_change_is_forgotten(how: str) -> None:
    monitor = ChangeMonitor(DESIGNED)
    estimate = MotionEstimate(Verdict.GOOD, Verdict.GOOD, replace(FOUND, stiffness_nm_rad=9e8))
    monitor.watch(estimate)
    monitor.watch(estimate)
    assert monitor.change > 1.3
    if how == "restart":  # the present ship is then the law's own
        monitor.restart()
    else:
        monitor.watch(MotionEstimate(Verdict.OUTDATED, Verdict.OUTDATED))
    assert monitor.change == 1.0
    monitor.watch(estimate)
    assert monitor.change == 1.0


EXTREMES = (5e-324, 1e-300, 1e-30, 1e-6, 1.0, 1e30)


@pytest.mark.parametrize("inertia_kg_m2", EXTREMES)
@pytest.mark.parametrize("stiffness_nm_rad", EXTREMES)
def test_a_ship_that_an_answer_may_carry_costs_no_tick(
    stiffness_nm_rad: float, inertia_kg_m2: float
) -> None:
    try:
        ship = ShipFigures(stiffness_nm_rad, inertia_kg_m2, 0.0)
    except ValueError:
        return  # refused where the answer is read
    assert 0.0 < ship.roll_period_s < math.inf
    assert 1.0 < told(ship) < math.inf
