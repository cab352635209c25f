import math

import pytest
from moving_ship import THRESHOLDS, MovingShip

from utank_hil.nodes.commissioning.checks import RATE_ZERO_DEG_S
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.motion import RollAgainstRate

STEP_S = 0.05
FAULT_S = 120.0


def found_after(fault, until_s: float = 60.0, roll_deg: float = 0.5) -> dict[Finding, float]:
    """When each finding came first, after a fault that changes (roll, rate, turned) in place."""
    ship, monitor = MovingShip(math.radians(roll_deg)), RollAgainstRate(THRESHOLDS)
    first: dict[Finding, float] = {}
    for k in range(round((FAULT_S + until_s) / STEP_S)):
        t = k * STEP_S
        sample = [ship.roll_rad(t), ship.rate_rad_s(t), ship.turned_rad(t, STEP_S)]
        if t >= FAULT_S:
            sample = fault(t - FAULT_S, *sample)
        found = monitor.update(*sample, STEP_S)
        for finding in Finding:
            if found & finding:
                first.setdefault(finding, t - FAULT_S)
    return first


def test_a_ship_that_rolls_in_health_is_left_alone() -> None:
    for roll_deg in (0.0, 0.5, 8.0):
        assert not found_after(lambda _, *sample: sample, 600.0, roll_deg)


@pytest.mark.parametrize("share", [-1.0, 0.4, 1.0])
def test_a_bias_of_the_gyroscope_that_passes_a_commissioning_is_learned(share: float) -> None:
    bias_rad_s = share * math.radians(RATE_ZERO_DEG_S)
    monitor, ship = RollAgainstRate(THRESHOLDS), MovingShip()
    late = 0
    for k in range(12_000):
        t = k * STEP_S
        turned = ship.turned_rad(t, STEP_S) + bias_rad_s * STEP_S
        rate_rad_s = ship.rate_rad_s(t) + bias_rad_s
        found = monitor.update(ship.roll_rad(t), rate_rad_s, turned, STEP_S)
        assert not found & Finding.MOTION_SIGN
        late |= found if t > 240 else 0
    assert not late


@pytest.mark.parametrize("trim_deg", [0.0, 0.5])
def test_a_gyroscope_fixed_to_a_trimmed_ship_is_drift_in_a_turn(trim_deg: float) -> None:
    """As sensor.md says of a turn of 1 degree a second: the rate is not that about her axis."""
    off_rad_s = math.radians(1.0) * math.tan(math.radians(trim_deg))

    def about_the_axis(
        _: float, roll_rad: float, rate_rad_s: float, turned_rad: float
    ) -> list[float]:
        return [roll_rad, rate_rad_s - off_rad_s, turned_rad - off_rad_s * STEP_S]

    first = found_after(about_the_axis)
    if trim_deg:
        assert 8 < first[Finding.DRIFT] < 15
        assert 45 < first[Finding.DRIFT_LASTS] < 55
    else:
        assert not first


def found_with(rates: list[float], wrong: range) -> list[int]:
    """Of a ship that rolls at these rates, of which some are measured with the wrong sign."""
    noise, monitor, roll_rad, found = MovingShip(0.0, 0.0), RollAgainstRate(THRESHOLDS), 0.0, []
    for k, rate_rad_s in enumerate(rates):
        roll_rad += rate_rad_s * STEP_S
        measured_rad_s = -rate_rad_s if k in wrong else rate_rad_s
        at_s = k * STEP_S
        sample = roll_rad + noise.roll_rad(at_s), measured_rad_s + noise.rate_rad_s(at_s)
        found.append(monitor.update(*sample, measured_rad_s * STEP_S, STEP_S))
    return found


def test_a_sign_that_goes_wrong_as_a_fast_roll_slows_down_is_found_at_once() -> None:
    """What was right a moment before does not outweigh the little that is wrong now."""
    rates = [min(0.03, max(0.25 - 0.001 * k, -0.004)) for k in range(400)]
    found = found_with(rates, range(240, 400))
    assert not any(found[:240])
    assert found[250] & Finding.MOTION_SIGN


def test_a_tenth_of_a_second_of_contradiction_is_no_wrong_sign() -> None:
    for begin in range(200, 206):
        found = found_with([0.03] * 300, range(begin, begin + 2))
        assert not any(each & Finding.MOTION_SIGN for each in found)
        found = found_with([0.03] * 300, range(begin, begin + 8))
        assert any(each & Finding.MOTION_SIGN for each in found)


@pytest.mark.parametrize("flipped", ["roll", "rate"])
@pytest.mark.parametrize("shift_s", [0.0, 1.3, 2.6, 3.9])
def test_sign_of_roll_or_rate_alone_is_found(flipped: str, shift_s: float) -> None:
    """The first begins 0.44 s before a turning point: around it there is little to tell by."""

    def flip(t, roll, rate, turned):
        if t < shift_s:
            return [roll, rate, turned]
        return [-roll, rate, turned] if flipped == "roll" else [roll, -rate, -turned]

    found = found_after(flip, roll_deg=1.0)
    assert found[Finding.DRIFT] - shift_s <= 0.8
    assert found[Finding.MOTION_SIGN] - shift_s <= (1.3 if shift_s == 0.0 else 0.8)


@pytest.mark.parametrize("phase", range(11))
def test_noise_that_begins_while_the_rate_stands_still_is_no_stuck_signal(phase: int) -> None:
    """At a turning point of the rate, which stays there within its band for two seconds."""
    noise, monitor = MovingShip(0.0, 0.0), RollAgainstRate(THRESHOLDS)
    roll_rad, times = 0.1 * phase, 1.0
    for k in range(60):
        if k == 20 + phase:
            times = 10.0
        roll_rad += 0.01 * STEP_S
        sample = [roll_rad + times * noise.roll_rad(0.0), 0.01 + times * noise.rate_rad_s(0.0)]
        found = monitor.update(*sample, 0.01 * STEP_S, STEP_S)
        assert not found & (Finding.ROLL_STUCK | Finding.RATE_STUCK)


def test_sign_of_both_is_not_told_here() -> None:
    def flip(_, *sample):
        return [-value for value in sample]

    assert Finding.MOTION_SIGN not in found_after(flip)


def test_stuck_roll_is_found_within_three_seconds() -> None:
    at = MovingShip(noise=False).roll_rad(FAULT_S)
    found = found_after(lambda _, roll, rate, turned: [at, rate, turned])
    assert found[Finding.ROLL_STUCK] <= 3.0


def test_stuck_rate_is_found_within_a_second_of_a_large_roll_and_two_of_a_small_one() -> None:
    for roll_deg, limit_s in ((2.0, 1.0), (0.5, 2.0)):
        at = MovingShip(math.radians(roll_deg), noise=False).rate_rad_s(FAULT_S)
        found = found_after(lambda _, roll, *__, a=at: [roll, a, a * STEP_S], roll_deg=roll_deg)
        assert found[Finding.RATE_STUCK] <= limit_s


@pytest.mark.parametrize(("rad_min", "drift_s", "lasts_s"), [(0.1, 5.0, 30.0), (0.01, 30.0, 60.0)])
def test_drift_degrades_then_ends(rad_min: float, drift_s: float, lasts_s: float) -> None:
    found = found_after(lambda t, roll, *rest: [roll + rad_min / 60 * t, *rest])
    assert found[Finding.DRIFT] <= drift_s
    assert found[Finding.DRIFT_LASTS] <= lasts_s
    assert Finding.MOTION_SIGN not in found


def test_what_has_gone_is_forgotten_in_half_a_minute() -> None:
    monitor, ship = RollAgainstRate(THRESHOLDS), MovingShip()
    found = []
    for k in range(2400):
        t = k * STEP_S
        sign = -1 if 60 <= t < 70 else 1
        found.append(
            monitor.update(sign * ship.roll_rad(t), 0.01, ship.turned_rad(t, STEP_S), STEP_S)
        )
    assert found[1210]
    assert not any(found[round(102 / STEP_S) :])


def drift_found(bias_rad_s, seconds: float, silent: range = range(0)) -> list[bool]:
    """Whether DRIFT is found and lasts, each second, with a bias that is a function of time."""
    monitor, ship = RollAgainstRate(THRESHOLDS), MovingShip()
    found = []
    for k in range(round(seconds / STEP_S)):
        t = k * STEP_S
        if round(t) not in silent:
            rate_rad_s = ship.rate_rad_s(t) + bias_rad_s(t)
            turned_rad = ship.turned_rad(t, STEP_S) + bias_rad_s(t) * STEP_S
            now = monitor.update(ship.roll_rad(t), rate_rad_s, turned_rad, STEP_S)
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
    growth_rad_s2: float, silent: range, zero_deg_s: float
) -> None:
    zero_rad_s = math.radians(zero_deg_s)
    found = drift_found(
        lambda t: zero_rad_s + (growth_rad_s2 * t if t < 600 else 0.0), 1000, silent
    )
    assert all(found[400:600])
    assert not any(found[940:])


@pytest.mark.parametrize("growth_rad_s2", [1e-5, 2e-6])
def test_a_slow_drift_that_goes_on_is_found_all_the_time(growth_rad_s2: float) -> None:
    assert all(drift_found(lambda t: growth_rad_s2 * t, 1800)[400:])


def test_restart_takes_no_gap_for_a_move() -> None:
    monitor = RollAgainstRate(THRESHOLDS)
    monitor.update(0.0, 0.0, 0.0, STEP_S)
    monitor.restart()
    assert not monitor.update(0.3, 0.0, 0.0, STEP_S)
    assert not monitor.update(0.3, 0.0, 0.0, STEP_S)


@pytest.mark.parametrize("late_s", [0.3, 0.6, 1.0, 5.0, 40.0])
def test_a_tick_that_comes_late_is_no_error(late_s: float) -> None:
    """It may be longer than the memory of the sums, whose weights must not get negative."""
    monitor, time_s = RollAgainstRate(THRESHOLDS), 0.0
    for k in range(200):
        step_s = late_s if k % 20 == 19 else 0.05
        roll_rad, before_rad = (0.05 * math.sin(0.6 * t) for t in (time_s + step_s, time_s))
        time_s += step_s
        monitor.update(
            roll_rad, 0.03 * math.cos(0.6 * time_s), roll_rad - before_rad + 0.01, step_s
        )
        assert monitor.noise.power >= 0.0
