import math
from dataclasses import replace

import numpy as np
import pytest
from moving_ship import CONFIG, FINDINGS, SHIP, TANK, THRESHOLDS, MovingShip

from utank_hil.control import DesignPlant, PumpLimits
from utank_hil.dynamics import RollShip, Tank
from utank_hil.dynamics.linear import state_matrices
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.level_stuck import LevelStuck
from utank_hil.safety.monitors.tank_equation import TankEquation, roll_push_at_natural_frequency
from utank_hil.safety.monitors.thresholds import SensorFigures, thresholds_of

STEP_S = 0.1
FAULT_S = 60.0
T = THRESHOLDS.tank_period_s


def found_after(ship, fault, until_s=60.0):
    equation = TankEquation(SHIP, TANK, THRESHOLDS, STEP_S)
    stuck = LevelStuck(SHIP, TANK, THRESHOLDS, STEP_S)
    first: dict[int, float] = {}
    for k in range(round((FAULT_S + until_s) / STEP_S)):
        t = k * STEP_S
        sample = [ship.roll_rad(t), ship.level_m(t), ship.pressure_pa(t)]
        if t >= FAULT_S:
            sample = fault(t, *sample)
        found = equation.update(*sample)
        found |= stuck.update(*sample, equation.slope_push)
        for finding in FINDINGS:
            if found & finding:
                first.setdefault(finding, t - FAULT_S)
    return first


@pytest.mark.parametrize("roll_deg", [0.0, 0.5, 5.0])
@pytest.mark.parametrize("pressure_pa", [0.0, 10e3, 35e3])
@pytest.mark.parametrize("frequency_rad_s", [0.45, 0.6, 1.0])
def test_water_that_obeys_its_equation_is_left_alone(roll_deg, pressure_pa, frequency_rad_s):
    ship = MovingShip(math.radians(roll_deg), pressure_pa, frequency_rad_s)
    assert not found_after(ship, lambda _, *sample: sample, 120.0)


def test_water_at_rest_under_a_steady_heel_and_pressure_is_not_stuck():
    """A heel pushes less than a roll of its amplitude: the water does not swing with it."""
    stuck = LevelStuck(SHIP, TANK, THRESHOLDS, STEP_S)
    heel_rad, pressure_pa = 0.1, 20e3
    level_m = (heel_rad * 9.80665 * TANK.width_m + pressure_pa / 1000) / (2 * 9.80665)
    found = [stuck.update(heel_rad * min(k / 600, 1), 0.01 * k, 0.0, 0.0) for k in range(600)]
    found += [stuck.update(heel_rad, level_m, pressure_pa, 0.0) for _ in range(600)]
    assert not any(found)


BOAT = RollShip(42e3 / 1.97**2, 42e3, 2 * 0.06 * 42e3 / 1.97)
BOATS_TANK = Tank(2.016, 0.4392, 0.1297, 0.06215, lz_m=0.28, damping_ratio=0.1, headroom_m=0.4392)
BOATS_LIMITS = PumpLimits(pressure_pa=3505.0, rate_pa_s=7e3, level_m=0.35)


def found_on_a_boat(roll_rms_rad, *, sign=1.0, minutes=10.0, noise_m=0.005):
    """What is found of a boat of 8 m in waves about her roll period, by noisy gauges."""
    plant = DesignPlant(BOAT, BOATS_TANK, limits=BOATS_LIMITS)
    thresholds = thresholds_of(plant, 0.35, SensorFigures(level_noise_m=noise_m))
    equation = TankEquation(BOAT, BOATS_TANK, thresholds, STEP_S)
    random = np.random.default_rng(1)
    a, b = state_matrices(BOAT, BOATS_TANK)
    w = BOATS_TANK.natural_frequency_rad_s * random.uniform(0.7, 1.3, 40)
    moved = np.linalg.solve(
        1j * w[:, None, None] * np.eye(4) - a, np.broadcast_to(b[:, 1:], (40, 4, 1))
    )[:, [0, 2], 0]
    moved = moved * np.exp(2j * np.pi * random.uniform(size=(40, 1)))
    t = STEP_S * np.arange(round(600 * minutes))
    motion = (np.exp(1j * np.multiply.outer(t, w)) @ moved).real
    motion *= roll_rms_rad / motion[:, 0].std()
    motion *= [sign, 1.0]
    motion += random.normal(size=motion.shape) * [2e-4, noise_m / math.sqrt(2)]
    found = 0
    for roll_rad, level_m in motion.tolist():
        found |= equation.update(roll_rad, level_m, 0.0)
    return found


@pytest.mark.parametrize("roll_deg", [0.0, 0.15, 0.25, 0.4, 0.7, 1.2])
def test_a_boat_is_sound_whatever_the_noise_of_its_gauges_looks_like(roll_deg):
    """Noise of 5 mm in a tank of 0.44 m: it looks like pushes on the water."""
    assert found_on_a_boat(math.radians(roll_deg)) == 0


@pytest.mark.parametrize(("roll_deg", "noise_m"), [(1.2, 0.005), (0.4, 0.001)])
def test_a_boat_that_rolls_tells_a_wrong_sign(roll_deg, noise_m):
    found = found_on_a_boat(math.radians(roll_deg), sign=-1.0, minutes=1.0, noise_m=noise_m)
    assert found & Finding.WATER_SIGN


ZEROS = (math.radians(0.3), 0.044, 870.0)
"""Each pushes the water as much as all zeros together may."""


@pytest.mark.parametrize("roll_deg", [0.3, 0.5, 1.0, 3.0])
@pytest.mark.parametrize("pressure_pa", [0.0, 6e3, 30e3])
@pytest.mark.parametrize("frequency_rad_s", [0.45, 0.6])
@pytest.mark.parametrize("sensor", [0, 1, 2])
@pytest.mark.parametrize("way", [-1, 1])
def test_zeros_of_the_sensors_are_no_wrong_sign_no_delay_and_nothing_stuck(
    roll_deg, pressure_pa, frequency_rad_s, sensor, way
):
    ship = MovingShip(math.radians(roll_deg), pressure_pa, frequency_rad_s)
    equation = TankEquation(SHIP, TANK, THRESHOLDS, STEP_S)
    stuck = LevelStuck(SHIP, TANK, THRESHOLDS, STEP_S)
    for k in range(900):
        sample = [each(k * STEP_S) for each in (ship.roll_rad, ship.level_m, ship.pressure_pa)]
        sample[sensor] += way * ZEROS[sensor]
        assert not equation.update(*sample)
        assert not stuck.update(*sample, equation.slope_push)


@pytest.mark.parametrize("times", [0.9, 3.0, 10.0])
def test_what_holds_the_water_still_says_nothing_of_a_roll_that_stands_still(times):
    """It may be a turn, of 0.3 to 3 degrees of heel."""
    equation = TankEquation(SHIP, TANK, THRESHOLDS, STEP_S)
    level_m = times * THRESHOLDS.zero_push_m2_s2 / (2 * 9.80665)
    assert not any(equation.update(0.0, level_m, 0.0) for _ in range(900))


def test_level_gain_is_one_and_the_delay_is_the_delay():
    exact = replace(THRESHOLDS, zero_push_m2_s2=0.0, steady_push_m2_s2=0.0)
    ship, equation = MovingShip(math.radians(1.0)), TankEquation(SHIP, TANK, exact, STEP_S)
    late_s = 0.4
    for k in range(1000):
        t = k * STEP_S
        equation.update(ship.roll_rad(t), ship.level_m(t), ship.pressure_pa(t))
    assert equation.doubt < 0.1
    assert equation.level_gain == pytest.approx(1, abs=0.02)
    assert equation.late_s == pytest.approx(0, abs=0.1)
    for k in range(1000, 2000):
        t = k * STEP_S
        equation.update(ship.roll_rad(t - late_s), ship.level_m(t), ship.pressure_pa(t))
    assert equation.late_s == pytest.approx(late_s, abs=0.1)


@pytest.mark.parametrize("pressure_pa", [0.0, 10e3])
def test_sign_of_the_motion_sensor_is_found_in_one_roll_period_of_half_a_degree(pressure_pa):
    ship = MovingShip(math.radians(0.5), pressure_pa)
    found = found_after(ship, lambda _, roll, level, pressure: (-roll, level, pressure))
    assert found[Finding.WATER_SIGN] <= T


def test_too_little_roll_tells_nothing_and_says_nothing():
    ship = MovingShip(math.radians(0.1), 0.0)
    assert not found_after(ship, lambda _, roll, *rest: (-roll, *rest))


def test_swapped_gauges_are_found_within_a_period():
    found = found_after(MovingShip(), lambda _, roll, level, pressure: (roll, -level, pressure))
    assert found[Finding.WATER_SIGN] <= T


def test_pressure_of_the_wrong_sign_is_found_within_a_period():
    found = found_after(MovingShip(), lambda _, roll, level, pressure: (roll, level, -pressure))
    assert found[Finding.PUMP_SIGN] <= T


@pytest.mark.parametrize("wrong", [Finding.WATER_SIGN, Finding.PUMP_SIGN])
def test_of_two_signs_that_may_be_wrong_the_one_that_explains_more_is_named(wrong):
    """A pump that pushes as the measured roll does: either sign explains the water, but for noise.

    The other one leaves 2 (p - x) more of it.
    """
    ship = MovingShip(math.radians(3.0), frequency_rad_s=0.5)
    x = TANK.width_m * (9.80665 - (TANK.height_m + TANK.lz_m) * ship.w**2) * ship.roll
    p = 1.03 * x
    length = 2 * TANK.height_m + TANK.width_m * TANK.reservoir_area_m2 / TANK.duct_area_m2
    w0 = math.sqrt(2 * 9.80665 / length)
    answer = length * (w0**2 - ship.w**2 + 2j * TANK.damping_ratio * w0 * ship.w)
    ship.pressure = 1000 * p
    ship.level = (p - x if wrong == Finding.WATER_SIGN else x - p) / answer
    equation = TankEquation(SHIP, TANK, THRESHOLDS, STEP_S)
    found = set()
    for k in range(400):
        t = k * STEP_S
        bits = equation.update(ship.roll_rad(t), ship.level_m(t), ship.pressure_pa(t))
        found.add(bits & (Finding.WATER_SIGN | Finding.PUMP_SIGN) if t > 20 else 0)
    assert found == {0, wrong}


def test_levels_that_stand_still_are_found_within_five_seconds():
    ship = MovingShip()
    for shift_s in (0.0, 1.0, 2.0, 3.0, 4.0):
        at = MovingShip(noise=False).level_m(FAULT_S + shift_s)

        def stick(t, roll, level, pressure, at=at, shift_s=shift_s):
            return roll, at if t >= FAULT_S + shift_s else level, pressure

        assert found_after(ship, stick)[Finding.LEVEL_STUCK] - shift_s <= 5.0


@pytest.mark.parametrize("shift_s", [0.0, 1.0, 2.5, 4.0, 6.0, 8.0])
def test_levels_that_stand_still_are_not_called_swapped(shift_s):
    """Whichever moment of a swing they stop at, under a pump that takes off half the roll's push.

    Levels that do not move have no sign.
    """
    ship = MovingShip(math.radians(2.0))
    push = TANK.width_m * (9.80665 - (TANK.height_m + TANK.lz_m) * ship.w**2) * ship.roll
    length = 2 * TANK.height_m + TANK.width_m * TANK.reservoir_area_m2 / TANK.duct_area_m2
    w0 = math.sqrt(2 * 9.80665 / length)
    ship.pressure = -0.5 * 1000 * push
    answer = length * (w0**2 - ship.w**2 + 2j * TANK.damping_ratio * w0 * ship.w)
    ship.level = 0.5 * push / answer
    at_m = ship.level_m(FAULT_S + shift_s)

    def stick(t, roll, level, pressure):
        return roll, at_m if t >= FAULT_S + shift_s else level, pressure

    found = found_after(ship, stick, 20.0)
    assert found[Finding.LEVEL_STUCK] - shift_s <= 3.0
    assert Finding.WATER_SIGN not in found


def test_levels_that_stand_still_are_not_called_a_delay():
    """Gauges that stop make the roll look late at first."""
    called = []
    for shift_s in (0.0, 2.5, 5.0, 7.5):
        for pressure_pa in (0.0, 5e3, 20e3):
            for frequency_rad_s in (0.45, 0.6, 0.75):
                ship = MovingShip(math.radians(2.0), pressure_pa, frequency_rad_s)
                at_m = ship.level_m(FAULT_S + shift_s)

                def stick(t, roll, level, pressure, at_m=at_m, shift_s=shift_s):
                    return roll, at_m if t >= FAULT_S + shift_s else level, pressure

                found = found_after(ship, stick, 20.0)
                assert Finding.LEVEL_STUCK in found
                called.append(Finding.MOTION_LATE in found)
    assert not any(called)


@pytest.mark.parametrize("stands_deg", [0.0, 1.4])
@pytest.mark.parametrize("pressure_pa", [0.0, 10e3])
def test_a_roll_that_stands_still_with_its_rate_is_told_by_the_water(pressure_pa, stands_deg):
    """Roll and rate agree then, and no sign is wrong: a dead sensor may go on sending zeros."""
    stands_rad = math.radians(stands_deg)
    ship = MovingShip(math.radians(1.0), pressure_pa)
    found = found_after(ship, lambda _, roll, *rest: (stands_rad, *rest))
    assert found[Finding.ROLL_STUCK] <= 1.25 * T
    calm = MovingShip(math.radians(0.2), pressure_pa)
    assert Finding.ROLL_STUCK not in found_after(calm, lambda _, roll, *rest: (0.0, *rest))


@pytest.mark.parametrize("shift_s", [0.0, 1.3, 5.2, 6.5])
def test_gauges_that_jump_say_nothing_of_the_motion_sensor(shift_s):
    ship = MovingShip(math.radians(2.0), 5e3)

    def swap(t, roll, level, pressure):
        return roll, -level if t >= FAULT_S + shift_s else level, pressure

    found = found_after(ship, swap, shift_s + T)
    assert found[Finding.WATER_SIGN] - shift_s <= 2.0
    assert Finding.MOTION_LATE not in found


def test_a_delay_of_half_a_second_is_found_and_of_a_36th_of_a_period_is_not():
    """The threshold is a 31st, 0.34 s."""
    ship = MovingShip(math.radians(2.0), 5e3)

    def late(delay_s):
        return lambda t, roll, level, pressure: (ship.roll_rad(t - delay_s), level, pressure)

    assert found_after(ship, late(2.0))[Finding.MOTION_LATE] <= 2 * T
    assert found_after(ship, late(0.5))[Finding.MOTION_LATE] <= 26.0
    assert not found_after(ship, late(0.3))


@pytest.mark.parametrize("pressure_pa", [0.0, 5e3])
@pytest.mark.parametrize("share", [0.31, 0.34])
def test_a_roll_late_by_a_third_of_a_period_is_not_called_reversed(share, pressure_pa):
    """Reversed it would explain the water better than as it is, and a quarter late better still."""
    ship = MovingShip(math.radians(2.0), pressure_pa)
    late = found_after(ship, lambda t, roll, *rest: (ship.roll_rad(t - share * T), *rest))
    assert late[Finding.MOTION_LATE] <= 0.75 * T
    assert Finding.WATER_SIGN not in late


def test_half_a_period_after_the_start_a_roll_of_a_degree_is_obeyed():
    """Until then a quarter of the pressure is left."""
    ship, equation = (
        MovingShip(math.radians(1.0), 0.0),
        TankEquation(SHIP, TANK, THRESHOLDS, STEP_S),
    )
    begun_s = 0.0
    for k in range(600):
        t = k * STEP_S
        equation.update(ship.roll_rad(t), ship.level_m(t), 0.0)
        if not equation.settled:
            begun_s = t
        assert equation.obeyed or t - begun_s < 0.5 * T


@pytest.mark.parametrize("pressure_pa", [0.0, 5e3])
@pytest.mark.parametrize("frequency_rad_s", [0.45, 0.75])
def test_a_reversed_roll_is_not_called_late_as_well(pressure_pa, frequency_rad_s):
    """A quarter of a period late it would explain the water better than now, reversed best."""
    ship = MovingShip(math.radians(2.0), pressure_pa, frequency_rad_s)
    found = found_after(ship, lambda _, roll, *rest: (-roll, *rest), 30.0)
    assert found[Finding.WATER_SIGN] <= T
    assert Finding.MOTION_LATE not in found


def test_water_that_obeyed_a_sensor_does_so_no_longer_once_that_is_wrong_or_says_too_little():
    ship = MovingShip(math.radians(1.0), 0.0)
    for wrong in (-1.0, 0.1):
        equation = TankEquation(SHIP, TANK, THRESHOLDS, STEP_S)
        for k in range(900):
            t = k * STEP_S
            now = wrong if t > 60 else 1.0
            equation.update(now * ship.roll_rad(t), abs(now) * ship.level_m(t), 0.0)
            if k == 600:
                assert equation.obeyed
        assert not equation.obeyed


@pytest.mark.parametrize("way", [-1, 1])
@pytest.mark.parametrize("heel_deg", [-0.4, 0.4])
def test_a_small_list_is_no_stuck_level_whatever_the_zeros(way, heel_deg):
    """Where the pump is weak the list alone were enough to be judged by; a turn looks like it."""
    plant = replace(CONFIG.plant, limits=replace(CONFIG.plant.limits, pressure_pa=2e3))
    thresholds = thresholds_of(plant, 0.35, SensorFigures())
    push = 9.80665 * TANK.width_m * math.radians(heel_deg)
    equation = TankEquation(SHIP, TANK, thresholds, STEP_S)
    for _ in range(900):
        level_m = (push + way * thresholds.steady_push_m2_s2) / (2 * 9.80665)
        assert not equation.update(math.radians(heel_deg), level_m, 0.0)
        assert math.isnan(equation.level_gain)


def test_a_delay_is_judged_after_a_whole_period_and_another_one_after_gauges_that_jumped():
    """In a part of a wave a heel looks like a delay, and so does a jump."""
    ship, equation = (
        MovingShip(math.radians(2.0), 5e3),
        TankEquation(SHIP, TANK, THRESHOLDS, STEP_S),
    )
    told_s = []
    for k in range(600):
        t = k * STEP_S
        jump_m = 1.0 if k == 400 else 0.0
        equation.update(ship.roll_rad(t), ship.level_m(t) + jump_m, ship.pressure_pa(t))
        if math.isfinite(equation.late_s):
            told_s.append(t)
    settled_s, jumped_s = 6 * T / (4 * math.pi), 40.0
    assert told_s[0] - settled_s == pytest.approx(T, abs=3 * STEP_S)
    assert min(t for t in told_s if t > jumped_s) - jumped_s == pytest.approx(T, abs=3 * STEP_S)


def test_no_delay_is_judged_by_little_more_than_the_least_push():
    """In calm seas the sensors' noise looked like one in the course of an hour."""
    w0 = TANK.natural_frequency_rad_s
    least_rad = THRESHOLDS.least_roll_push_m2_s2 / roll_push_at_natural_frequency(SHIP, TANK)
    for times, judged in ((2.8, False), (4.2, True)):  # the filters take a fifth
        ship, equation = (
            MovingShip(times * least_rad, 0.0, w0),
            TankEquation(SHIP, TANK, THRESHOLDS, STEP_S),
        )
        late = []
        for k in range(1200):
            t = k * STEP_S
            equation.update(ship.roll_rad(t), ship.level_m(t), ship.pressure_pa(t))
            late.append(equation.late_s)
        assert math.isfinite(late[-1]) is judged


def test_restart_forgets():
    ship, equation = MovingShip(), TankEquation(SHIP, TANK, THRESHOLDS, STEP_S)
    for k in range(600):
        t = k * STEP_S
        found = equation.update(-ship.roll_rad(t), ship.level_m(t), ship.pressure_pa(t))
    assert found
    equation.restart()
    assert math.isnan(equation.doubt)
    assert not equation.update(ship.roll_rad(0.0), ship.level_m(0.0), ship.pressure_pa(0.0))


@pytest.mark.parametrize("every", [2, 4, 5])
def test_samples_that_are_left_out_change_little(every):
    """Half a second is a twentieth of the period: the inputs run nearly straight."""
    exact = replace(THRESHOLDS, zero_push_m2_s2=0.0, steady_push_m2_s2=0.0)
    ship = MovingShip(math.radians(2.0), noise=False)
    whole, gaps = (TankEquation(SHIP, TANK, exact, STEP_S) for _ in range(2))
    for k in range(1, 1200):
        sample = (each(k * STEP_S) for each in (ship.roll_rad, ship.level_m, ship.pressure_pa))
        roll, level, pressure = sample
        whole.update(roll, level, pressure)
        if k % every == 0:
            gaps.update(roll, level, pressure, every)
    assert gaps.doubt == pytest.approx(whole.doubt, abs=0.02)
    assert gaps.level_gain == pytest.approx(whole.level_gain, abs=0.02)
    assert gaps.late_s == pytest.approx(whole.late_s, abs=0.02)


def test_inputs_run_straight_over_the_steps_that_are_left_out():
    apart, together = (TankEquation(SHIP, TANK, THRESHOLDS, STEP_S) for _ in range(2))
    for k in range(100):
        found = [apart.update(0.01 * k, 0.02 * k, 300.0 * k), 0]
        if k % 4 == 0:
            found[1] = together.update(0.01 * k, 0.02 * k, 300.0 * k, 4)
            assert found[0] == found[1]
            assert together.doubt == pytest.approx(apart.doubt, nan_ok=True)
            assert together._dd == pytest.approx(apart._dd)


@pytest.mark.parametrize("seconds", [0.0, 3.0, 30.0])
def test_it_has_settled_after_six_time_constants_and_after_a_gap_again(seconds):
    equation = TankEquation(SHIP, TANK, THRESHOLDS, STEP_S)
    settles_s = 6 * T / (4 * math.pi)
    assert not equation.settled
    for k in range(round(seconds / STEP_S)):
        equation.update(0.0, 0.0, 0.0)
        assert equation.settled is (k * STEP_S >= settles_s)
    # beyond 0.9 of the tank it is blind, and says so
    equation.update(0.0, 0.99 * TANK.level_limit_m, 0.0)
    equation.update(0.0, 0.99 * TANK.level_limit_m, 0.0)
    assert not equation.settled
    for _ in range(math.ceil(settles_s / STEP_S) + 2):
        equation.update(0.0, 0.0, 0.0)
    assert equation.settled
    equation.restart()
    assert not equation.settled


@pytest.mark.parametrize(
    ("fault", "obeyed"),
    [
        (lambda roll, level, pressure: (roll, level, pressure), True),
        (lambda roll, level, pressure: (-roll, level, pressure), False),
        (lambda roll, level, pressure: (roll, -level, pressure), False),
    ],
)
@pytest.mark.parametrize("roll_deg", [0.1, 0.25, 0.5, 1.0, 4.0])
@pytest.mark.parametrize("zero", range(-3, 4))
def test_no_zero_makes_a_wrong_sensor_look_obeyed(fault, obeyed, roll_deg, zero):
    ship = MovingShip(math.radians(roll_deg), 0.0, noise=False)
    equation = TankEquation(SHIP, TANK, THRESHOLDS, STEP_S)
    seen = []
    for k in range(600):
        sample = [each(k * STEP_S) for each in (ship.roll_rad, ship.level_m, ship.pressure_pa)]
        sample = list(fault(*sample))
        sample[abs(zero) % 3] += math.copysign(1, zero) * ZEROS[abs(zero) % 3] if zero else 0.0
        equation.update(*sample)
        seen.append(equation.obeyed)
    if not obeyed or roll_deg == 0.1:
        assert not any(seen)
    elif roll_deg >= 1.0:
        assert any(seen)


@pytest.mark.parametrize("frequency", [0.85, 1.0, 1.15])
def test_a_duct_that_loses_quadratically_is_no_late_motion_sensor(frequency):
    """Water of 1.5 m with a damping ratio of 0.3 there, pushed by the roll as its equation asks."""
    tank = replace(TANK, damping_ratio=0.02)
    w = frequency * tank.natural_frequency_rad_s
    one = replace(tank, quadratic_loss=1.0).linearized(1.5 * w).damping_ratio - 0.02
    tank = replace(tank, quadratic_loss=0.28 / one)
    equation = TankEquation(
        SHIP, tank, replace(THRESHOLDS, zero_push_m2_s2=0.0, steady_push_m2_s2=0.0), STEP_S
    )
    push = 9.80665 * tank.width_m - tank.width_m * (tank.height_m + tank.lz_m) * w**2
    loss, length_m = tank.linearized(1.5 * w).loss_pa_per_m_s / 1000, tank.effective_length_m
    for k in range(1200):
        h, rate = 1.5 * math.sin(w * k * STEP_S), 1.5 * w * math.cos(w * k * STEP_S)
        spring = (2 * 9.80665 - length_m * w**2) * h
        lost = loss * 0.02 / 0.3 * rate + tank.quadratic_loss_pa_per_m2_s2 / 1000 * abs(rate) * rate
        x = spring + loss * rate
        equation.update(x / push, h, 1000 * (spring + lost - x))
    assert equation.late_s == pytest.approx(0, abs=0.1)
    assert equation.level_gain == pytest.approx(1, abs=0.04)
