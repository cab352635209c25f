"""The estimator's work: what it tells of a record, and when it says that it can't."""

from dataclasses import replace

import numpy as np
import pytest
from rolling_ship import PLANT, SAMPLE_TIME_S, SHIP, loaded, motion_in, wave_moment_nm

from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import Verdict
from utank_hil.dynamics import RollShip
from utank_hil.retuning.estimate import EstimateRequest, ShipFigures
from utank_hil.retuning.renewal import EstimateTask, estimate
from utank_hil.sea import jonswap

TASK = EstimateTask(PLANT, SAMPLE_TIME_S, 0.5)
PERIOD_S = 2 * np.pi / SHIP.natural_frequency_rad_s
MOMENT_NM = wave_moment_nm(jonswap(4.0, 10.0), 1300.0, seed=3)


def request(motion: FloatArray, known: RollShip = SHIP) -> EstimateRequest:
    return EstimateRequest(ShipFigures.of(known), motion)


def test_ship_and_sea_are_told_while_the_pump_works():
    ship = loaded(14.4)
    found = estimate(request(motion_in(MOMENT_NM, ship)[500:]), TASK)
    assert (found.of_sea, found.of_ship) == (Verdict.GOOD, Verdict.GOOD)
    assert found.ship.roll_period_s == pytest.approx(14.4, rel=0.03)
    assert found.ship.stiffness_nm_rad == pytest.approx(ship.stiffness_nm_rad, rel=0.05)
    # the moment is that on the configured ship, and the height is given per this one's stiffness
    factor = SHIP.stiffness_nm_rad / ship.stiffness_nm_rad
    assert found.hs_m == pytest.approx(4.0 * factor, rel=0.15)
    assert found.tp_s == pytest.approx(10.0, rel=0.15)
    assert found.duration_s == pytest.approx(1200.0)


@pytest.mark.parametrize(("factor", "verdict"), [(1.3, Verdict.GOOD), (1.6, Verdict.UNCERTAIN)])
def test_a_ship_farther_off_than_loading_makes_her_is_not_told(factor: float, verdict: Verdict):
    motion, configured = motion_in(MOMENT_NM, loaded(14.4))[500:], loaded(14.4 / factor)
    task = replace(TASK, plant=replace(PLANT, ship=configured))
    found = estimate(request(motion, configured), task)
    assert (found.of_sea, found.of_ship) == (verdict, verdict)


@pytest.mark.parametrize(("factor", "verdict"), [(1.2, Verdict.GOOD), (1.6, Verdict.UNCERTAIN)])
def test_a_ship_with_more_inertia_than_any_loading_is_not_told(factor: float, verdict: Verdict):
    """Of 2.6 times the stiffness, a boat in following seas had a good GM of 1.9 m, not 0.7."""
    motion, ship = motion_in(MOMENT_NM, loaded(14.4))[500:], loaded(14.4)
    scaled = (ship.inertia_kg_m2 / factor, ship.stiffness_nm_rad / factor)
    configured = ship.with_figures(*scaled, ship.damping_nms_rad)
    task = replace(TASK, plant=replace(PLANT, ship=configured))
    assert estimate(request(motion, configured), task).of_ship is verdict


def test_a_ship_loaded_within_the_record_is_the_present_one():
    motion = motion_in(MOMENT_NM)
    loaded_m = motion_in(MOMENT_NM, loaded(14.4))
    half = len(motion) - 3150
    found = estimate(request(np.vstack([motion[500:half], loaded_m[half:]])), TASK)
    assert found.of_ship is Verdict.GOOD
    assert found.ship.roll_period_s == pytest.approx(14.4, rel=0.05)
    assert found.duration_s == pytest.approx(600.0, rel=0.1)


def test_with_a_passive_tank_the_waves_are_those_of_the_known_ship():
    ship = loaded(10.0)
    found = estimate(request(motion_in(MOMENT_NM, ship, 0.0)[500:], ship), TASK)
    assert (found.of_sea, found.of_ship) == (Verdict.GOOD, Verdict.UNCERTAIN)
    assert found.ship.roll_period_s == pytest.approx(10.0, rel=0.05)
    factor = SHIP.stiffness_nm_rad / ship.stiffness_nm_rad
    assert found.hs_m == pytest.approx(4.0 * factor, rel=0.15)


def test_with_a_passive_tank_and_another_ship_than_the_known_one_the_sea_is_uncertain():
    found = estimate(request(motion_in(MOMENT_NM, loaded(8.8), 0.0)[500:]), TASK)
    assert (found.of_sea, found.of_ship) == (Verdict.UNCERTAIN, Verdict.UNCERTAIN)


def test_fifteen_rolls_tell_the_waves_but_no_ship():
    """The ship is another, and what its motion seems to tell of it must not count yet."""
    motion, ship = motion_in(MOMENT_NM), loaded(14.4)
    short = motion[500 : 500 + round(15 * PERIOD_S / SAMPLE_TIME_S)]
    found = estimate(request(short), TASK)
    assert (found.of_sea, found.of_ship) == (Verdict.UNCERTAIN, Verdict.RECORD_SHORT)
    assert found.ship.roll_period_s == pytest.approx(PERIOD_S, rel=0.02)
    whole = estimate(request(motion[500:]), TASK)
    assert found.waves.rms_rad == pytest.approx(whole.waves.rms_rad, rel=0.3)
    other = motion_in(MOMENT_NM, ship)[500 : 500 + len(short)]
    assert estimate(request(other), TASK).of_ship is Verdict.RECORD_SHORT
    assert estimate(request(motion[500 : 400 + len(short)]), TASK).waves is None


def test_the_moment_of_swell_is_within_what_a_short_record_states():
    """Its wide bands make the moment of slow waves too great: 1.45 of the truth in the mean."""
    moment_nm = wave_moment_nm(jonswap(2.0, 18.0), 1300.0, seed=8001)
    motion = motion_in(moment_nm)[500:]
    short = motion[: round(15 * PERIOD_S / SAMPLE_TIME_S)]
    found, whole = (estimate(request(each), TASK) for each in (short, motion))
    assert whole.rms_deviation < 0.05
    apart = found.waves.rms_rad / whole.waves.rms_rad - 1
    assert 2 * whole.rms_deviation < apart < 2 * found.rms_deviation
    assert found.of_sea is Verdict.UNCERTAIN


def test_righting_levers_are_those_of_the_known_ship():
    """Straight levers say no more than the stiffness does."""
    ship = loaded(10.0)
    heel_rad = 0.1 * np.arange(8)
    weight_n = 1e8
    levers_m = tuple((SHIP.stiffness_nm_rad / weight_n * heel_rad).tolist())
    levered = replace(SHIP, displacement_n=weight_n, gz_step_rad=0.1, gz_m=levers_m)
    task = replace(TASK, plant=replace(PLANT, ship=levered))
    asked = request(motion_in(MOMENT_NM, ship, 0.0)[500:], ship)
    without, found = estimate(asked, TASK), estimate(asked, task)
    assert found.of_ship is Verdict.UNCERTAIN
    np.testing.assert_allclose(found.waves.density, without.waves.density, rtol=1e-3)


def test_lost_samples_are_no_harm_and_many_are_a_short_record():
    motion = motion_in(MOMENT_NM)[500:]
    whole = estimate(request(motion), TASK)
    lost = np.random.default_rng(1).random(len(motion)) < 0.03
    few = estimate(request(np.where(lost[:, None], np.nan, motion)), TASK)
    assert few.hs_m == pytest.approx(whole.hs_m, rel=0.02)
    lost = np.random.default_rng(1).random(len(motion)) < 0.1
    many = estimate(request(np.where(lost[:, None], np.nan, motion)), TASK)
    assert (many.of_sea, many.of_ship) == (Verdict.RECORD_SHORT, Verdict.RECORD_SHORT)


@pytest.mark.evidence("motion3-3")
@pytest.mark.parametrize(
    ("motion", "verdict"),
    [
        (np.full((6000, 3), np.nan), Verdict.RECORD_SHORT),
        (motion_in(MOMENT_NM)[:800], Verdict.RECORD_SHORT),
        (np.zeros((6000, 3)), Verdict.MOTION_SMALL),
        (
            np.random.default_rng(1).standard_normal((3200, 3)) * [2e-4, 5e-4, 3.5e-3],
            Verdict.MOTION_SMALL,
        ),
    ],
)
def test_what_tells_nothing_is_named(motion: FloatArray, verdict: Verdict):
    found = estimate(request(motion), TASK)
    assert (found.of_sea, found.of_ship, found.waves) == (verdict, verdict, None)


@pytest.mark.parametrize(("tp_s", "told"), [(18.0, True), (32.0, False)])
def test_no_height_is_told_of_waves_longer_than_any_swell(tp_s: float, *, told: bool):
    found = estimate(request(motion_in(wave_moment_nm(jonswap(4.0, tp_s), 900.0, 3))[500:]), TASK)
    assert found.waves is not None
    assert np.isfinite([found.hs_m, found.tp_s]).tolist() == [told, told]
    assert found.waves.rms_rad > 0
