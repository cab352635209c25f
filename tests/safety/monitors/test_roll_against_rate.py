import math

import pytest
from moving_ship import FINDINGS, THRESHOLDS, MovingShip

from utank_hil.nodes.commissioning.checks import RATE_ZERO_DEG_S
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.motion import RollAgainstRate

STEP_S = 0.05
FAULT_S = 120.0


def found_after(fault, until_s=60.0, roll_deg=0.5):
    """When each finding came first, after a fault that changes (roll, turned)."""
    ship, monitor = MovingShip(math.radians(roll_deg)), RollAgainstRate(THRESHOLDS)
    first: dict[int, float] = {}
    for k in range(round((FAULT_S + until_s) / STEP_S)):
        t = k * STEP_S
        sample = [ship.roll_rad(t), ship.turned_rad(t, STEP_S)]
        if t >= FAULT_S:
            sample = fault(t - FAULT_S, *sample)
        found = monitor.update(*sample, STEP_S)
        for finding in FINDINGS:
            if found & finding:
                first.setdefault(finding, t - FAULT_S)
    return first


def test_a_ship_that_rolls_in_health_is_left_alone():
    for roll_deg in (0.0, 0.5, 8.0):
        assert not found_after(lambda _, *sample: sample, 150.0, roll_deg)


@pytest.mark.parametrize("share", [-1.0, 0.4, 1.0])
def test_a_bias_of_the_gyroscope_that_passes_a_commissioning_is_learned(share):
    bias_rad_s = share * math.radians(RATE_ZERO_DEG_S)
    monitor, ship = RollAgainstRate(THRESHOLDS), MovingShip()
    late = 0
    for k in range(12_000):
        t = k * STEP_S
        turned = ship.turned_rad(t, STEP_S) + bias_rad_s * STEP_S
        found = monitor.update(ship.roll_rad(t), turned, STEP_S)
        late |= found if t > 240 else 0
    assert not late


@pytest.mark.parametrize("trim_deg", [0.0, 0.5])
def test_a_gyroscope_fixed_to_a_trimmed_ship_is_drift_in_a_turn(trim_deg):
    """As sensor.md says of a turn of 1 degree a second: the rate is not that about her axis."""
    off_rad_s = math.radians(1.0) * math.tan(math.radians(trim_deg))

    def about_the_axis(_, roll_rad, turned_rad):
        return [roll_rad, turned_rad - off_rad_s * STEP_S]

    first = found_after(about_the_axis)
    if trim_deg:
        assert 7 < first[Finding.DRIFT] < 15
        assert 45 < first[Finding.DRIFT_LASTS] < 55
    else:
        assert not first


@pytest.mark.parametrize("flipped", ["roll", "rate"])
@pytest.mark.parametrize("shift_s", [0.0, 1.3, 2.6, 3.9])
def test_sign_of_roll_or_rate_alone_is_found(flipped, shift_s):
    """The first begins 0.44 s before a turning point: around it there is little to tell by."""

    def flip(t, roll, turned):
        if t < shift_s:
            return [roll, turned]
        return [-roll, turned] if flipped == "roll" else [roll, -turned]

    found = found_after(flip, roll_deg=1.0)
    assert found[Finding.DRIFT] - shift_s <= 0.8
    assert found[Finding.DRIFT_LASTS] - shift_s <= 2.2


@pytest.mark.parametrize(("roll_deg", "limit_s"), [(2.0, 2.2), (0.5, 4.0)])
def test_a_roll_or_a_rate_that_stands_still_is_found(roll_deg, limit_s):
    ship = MovingShip(math.radians(roll_deg), noise=False)
    roll_rad, turned_rad = ship.roll_rad(FAULT_S), ship.rate_rad_s(FAULT_S) * STEP_S
    for still in (
        lambda _, roll, turned: [roll_rad, turned],
        lambda _, roll, turned: [roll, turned_rad],
    ):
        assert found_after(still, roll_deg=roll_deg)[Finding.DRIFT_LASTS] <= limit_s


@pytest.mark.parametrize(("rad_min", "drift_s", "lasts_s"), [(0.1, 5.0, 30.0), (0.01, 30.0, 60.0)])
def test_drift_degrades_then_ends(rad_min, drift_s, lasts_s):
    found = found_after(lambda t, roll, *rest: [roll + rad_min / 60 * t, *rest])
    assert found[Finding.DRIFT] <= drift_s
    assert found[Finding.DRIFT_LASTS] <= lasts_s


def test_what_has_gone_is_forgotten_in_half_a_minute():
    monitor, ship = RollAgainstRate(THRESHOLDS), MovingShip()
    found = []
    for k in range(2400):
        t = k * STEP_S
        sign = -1 if 60 <= t < 70 else 1
        found.append(monitor.update(sign * ship.roll_rad(t), ship.turned_rad(t, STEP_S), STEP_S))
    assert found[1210]
    assert not any(found[round(102 / STEP_S) :])


def drift_found(bias_rad_s, seconds, silent=range(0)):
    """Whether DRIFT is found and lasts, each second, with a bias that is a function of time."""
    monitor, ship = RollAgainstRate(THRESHOLDS), MovingShip()
    found = []
    for k in range(round(seconds / STEP_S)):
        t = k * STEP_S
        if round(t) not in silent:
            turned_rad = ship.turned_rad(t, STEP_S) + bias_rad_s(t) * STEP_S
            now = monitor.update(ship.roll_rad(t), turned_rad, STEP_S)
            if k % 20 == 0:
                found.append(bool(now & Finding.DRIFT and now & Finding.DRIFT_LASTS))
        elif k % 20 == 0:
            monitor.restart()
            found.append(found[-1])
    return found


@pytest.mark.parametrize("growth_rad_s2", [-5e-6, 2e-6, 5e-6])
@pytest.mark.parametrize("silent", [range(0), range(600, 660)])
@pytest.mark.parametrize("zero_deg_s", [0.0, 0.4 * RATE_ZERO_DEG_S])
def test_a_slow_drift_is_not_held_against_the_sensor_once_it_is_right(
    growth_rad_s2, silent, zero_deg_s
):
    zero_rad_s = math.radians(zero_deg_s)
    found = drift_found(
        lambda t: zero_rad_s + (growth_rad_s2 * t if t < 600 else 0.0), 1000, silent
    )
    assert all(found[400:600])
    assert not any(found[940:])


@pytest.mark.parametrize("growth_rad_s2", [1e-5, 2e-6])
def test_a_slow_drift_that_goes_on_is_found_all_the_time(growth_rad_s2):
    assert all(drift_found(lambda t: growth_rad_s2 * t, 1800)[400:])


def test_restart_takes_no_gap_for_a_move():
    monitor = RollAgainstRate(THRESHOLDS)
    monitor.update(0.0, 0.0, STEP_S)
    monitor.restart()
    assert not monitor.update(0.3, 0.0, STEP_S)
    assert not monitor.update(0.3, 0.0, STEP_S)


@pytest.mark.parametrize("late_s", [0.3, 0.6, 1.0, 5.0, 40.0])
def test_a_tick_that_comes_late_is_no_error(late_s):
    """It may be longer than the memory of the sums, whose weights must not get negative."""
    monitor, time_s = RollAgainstRate(THRESHOLDS), 0.0
    for k in range(200):
        step_s = late_s if k % 20 == 19 else 0.05
        roll_rad, before_rad = (0.05 * math.sin(0.6 * t) for t in (time_s + step_s, time_s))
        time_s += step_s
        monitor.update(roll_rad, roll_rad - before_rad + 0.01, step_s)
        assert monitor.noise.power >= 0.0
