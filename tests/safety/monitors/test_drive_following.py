"""The drive's bounds to the pascal and to the update."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from moving_ship import THRESHOLDS

from utank_hil.safety.monitors.drive import DriveFollowing, Saturation
from utank_hil.safety.monitors.finding import Finding

LIMIT_PA = 3000.0
FREE_PA_M = 500.0
BOUNDS = replace(
    THRESHOLDS, pressure_error_pa=LIMIT_PA, free_rotor_pa_m=FREE_PA_M, pressure_limit_pa=100.0
)
LAGS = Finding.DRIVE_LAGS
LOST = Finding.DRIVE_LAGS | Finding.DRIVE_LOST
REVERSED = Finding.PUMP_SIGN


def drive(command_pa, period_s):
    """A drive without a lag that has followed a command for two seconds."""
    monitor = DriveFollowing(0.0, BOUNDS, period_s)
    for k in range(round(2.0 / period_s) + 1):
        at_pa = command_pa if k else 0.0
        assert not update(monitor, command_pa, at_pa)
    return monitor


def update(
    monitor, command_pa, pressure_pa, level_m=0.0, rate_m_s=0.0, *, enabled=True, limited=""
):
    return monitor.update(
        command_pa, pressure_pa, level_m, rate_m_s,
        enabled=enabled, limited=limited != "", at_speed=limited == "speed",
    )  # fmt: skip


@pytest.mark.parametrize("changes_s", [0.05, 0.1, 0.3, 0.45])
@pytest.mark.parametrize("commanded_pa", [0.0, 6000.0])
def test_an_enable_that_chatters_excuses_no_pressure_that_stays(changes_s, commanded_pa):
    monitor, found = DriveFollowing(0.0, BOUNDS, 0.05), 0
    for k in range(100):
        enabled = int(k * 0.05 / changes_s + 1e-9) % 2 == 0
        found |= update(monitor, commanded_pa, -6000.0, enabled=enabled)
    assert found & LOST == LOST


@pytest.mark.parametrize(("off", "begun"), [(8, 4), (7, 2), (0, 2)])
def test_the_third_hasty_change_begins_nothing_anew(off, begun):
    """Half a second off and the change to on is none of them; updates from that change on."""
    monitor = DriveFollowing(0.0, BOUNDS, 0.0625)
    for _ in range(off):
        update(monitor, 0.0, 0.0, enabled=False)
    found = [update(monitor, 0.0, -6000.0, enabled=k // 2 % 2 == 0) for k in range(20)]
    # half a second from the last change that begins anew, and over 0.17 s behind
    first = begun + 7 + 2
    assert found[:first] == [0] * first
    assert found[first] == LAGS


def test_of_an_enable_that_chatters_no_pressure_is_expected_while_it_is_off():
    monitor = DriveFollowing(0.0, BOUNDS, 0.0625)
    found = [update(monitor, 6000.0, 6000.0, enabled=k // 2 % 2 == 0) for k in range(40)]
    assert LAGS in found


def test_a_drive_switched_on_and_off_again_is_excused():
    monitor = drive(0.0, 0.05)
    for enabled in (False, True, False):
        for _ in range(5):
            assert not update(monitor, 6000.0, -6000.0, enabled=enabled)


@given(st.floats(-4e4, 4e4), st.floats(0.01, 1.0), st.floats(0.01, 0.2), st.integers(1, 50))
def test_the_model_is_a_lag_one_step_behind_the_command(command_pa, lag_s, period_s, steps):
    monitor = DriveFollowing(lag_s, BOUNDS, period_s)
    assert (monitor.expected_pa, monitor.late_pa) == (0.0, 0.0)
    for k in range(steps):
        update(monitor, command_pa, 0.0)
        expected_pa = command_pa * (1 - math.exp(-k * period_s / lag_s))
        assert monitor.expected_pa == pytest.approx(expected_pa, abs=1e-6)
    update(monitor, command_pa, 0.0, enabled=False)
    assert monitor.expected_pa == 0.0


def test_without_a_lag_it_is_the_command_before():
    monitor, before = DriveFollowing(0.0, BOUNDS, 0.05), 0.0
    for command_pa in (5e3, -7e3, 1e3):
        update(monitor, command_pa, 0.0)
        assert monitor.expected_pa == before
        before = command_pa


@pytest.mark.parametrize("way", [-1, 1])
@pytest.mark.parametrize(
    ("expected_pa", "pressure_pa", "along_m_s", "limited", "found", "late_pa"),
    [
        # behind, ahead, at the bound and beyond it
        (6000, 3000, 0, "", 0, 3000),
        (6000, 2999, 0, "", LOST, 3001),
        (6000, 9000, 0, "", 0, 3000),
        (6000, 9001, 0, "", LOST, 3001),
        # a third of the bound the other way is reversed, if the bound itself is to be seen
        (6000, -1000, 0, "", LOST, 7000),
        (6000, -1001, 0, "", LOST | REVERSED, 7001),
        (3001, -1001, 0, "", LOST | REVERSED, 4002),
        (3000, -1001, 0, "", LOST, 4001),
        # water that outruns the rotor explains it, of a drive that says that it is at its speed
        (6000, -4000, 0.1, "", LOST | REVERSED, 10000),
        (6000, -4000, 0.1, "power", LOST | REVERSED, 10000),
        (6000, -4000, 0, "speed", LOST | REVERSED, 10000),
        (6000, -4000, -0.1, "speed", LOST | REVERSED, 10000),
        (6000, -4000, 0.1, "speed", 0, 0),
        (1, -4000, 0.1, "speed", 0, 0),
        # which may stay behind, up to the bound the other way, and not run ahead
        (6000, 0, 0, "power", 0, 0),
        (6000, -2999, 0, "power", 0, 0),
        (6000, -3000, 0, "power", LOST | REVERSED, 9000),
        (6000, 5000, 0, "power", 0, 0),
        (6000, 8999, 0, "power", 0, 0),
        (6000, 9000, 0, "power", 0, 3000),
        (6000, 9001, 0, "power", LOST, 3001),
        (6000, 9001, 0.1, "power", LOST, 3001),
        # with none expected both ways are the same
        (0, 3000, 0, "", 0, 3000),
        (0, 3001, 0, "", LOST, 3001),
        (0, 3001, 0.1, "power", LOST, 3001),
        (0, 2000, 0, "power", 0, 0),
    ],
)
def test_what_is_found_of_a_pressure_that_stays(
    way, expected_pa, pressure_pa, along_m_s, limited, found, late_pa
):
    monitor = drive(way * expected_pa, 0.05)
    for _ in range(12):
        last = update(
            monitor, way * expected_pa, way * pressure_pa, 0.0, way * along_m_s, limited=limited
        )
    assert last == found
    assert monitor.late_pa == late_pa


@pytest.mark.parametrize(
    ("period_s", "found"),
    [
        (0.17, [REVERSED, LAGS | REVERSED, LOST | REVERSED]),
        (0.4, [LAGS | REVERSED, LOST | REVERSED]),
        (0.12, [0, LAGS | REVERSED]),
        (0.07, [0, REVERSED, LAGS | REVERSED]),
        (0.045, [0, 0, REVERSED, LAGS | REVERSED, *[LAGS | REVERSED] * 4, LOST | REVERSED]),
    ],
)
def test_each_comes_after_its_time_and_anew_after_every_good_sample(period_s, found):
    monitor = drive(6000, period_s)
    for _ in range(2):
        assert [update(monitor, 6000, -6000) for _ in found] == found
        assert update(monitor, 6000, math.nan) == found[-1]
        assert update(monitor, 6000, 6000) == 0
    # what lags is reversed only as long as it is the other way
    assert [update(monitor, 6000, -6000) for _ in found] == found
    assert update(monitor, 6000, 0) & REVERSED == 0
    assert update(monitor, 6000, -6000) & REVERSED == found[0] & REVERSED


def test_what_the_water_explained_is_not_counted_once_it_does_not():
    monitor = drive(6000, 0.05)
    for _ in range(10):
        assert update(monitor, 6000, -4000, 0.0, 0.1, limited="speed") == 0
    found = [update(monitor, 6000, -4000, limited="speed") for _ in range(3)]
    assert found == [0, 0, REVERSED]


@pytest.mark.parametrize(("period_s", "judged"), [(0.25, 2), (0.45, 2), (0.6, 1), (0.0625, 8)])
def test_a_drive_is_judged_half_a_second_after_each_change(period_s, judged):
    monitor = DriveFollowing(0.0, replace(BOUNDS, pressure_error_pa=1.0), period_s)
    for enabled in (True, False, True, False):
        late_pa = []
        for _ in range(judged + 10):
            found = update(monitor, 0.0, 5.0, enabled=enabled)
            late_pa.append(monitor.late_pa)
            assert not found or len(late_pa) >= judged
        assert found == LOST
        assert late_pa == [0.0] * (judged - 1) + [5.0] * 11


@pytest.mark.parametrize("level_m", [-2.0, 0.0, 2.0])
def test_a_rotor_that_turns_freely_is_allowed_more_for_each_metre_of_level(level_m):
    most_pa = LIMIT_PA + FREE_PA_M * abs(level_m)
    for pressure_pa, found in ((most_pa, 0), (most_pa + 1, LOST), (-most_pa, 0)):
        monitor = DriveFollowing(0.0, BOUNDS, 0.25)
        last = [update(monitor, 0.0, pressure_pa, level_m, enabled=False) for _ in range(6)][-1]
        assert last == found
        monitor = DriveFollowing(0.0, BOUNDS, 0.25)
        last = [update(monitor, 0.0, pressure_pa, level_m) for _ in range(6)][-1]
        assert last == (LOST if abs(pressure_pa) > LIMIT_PA else 0)


def first_saturated(command_pa, drive_limited, from_update=0, saturation=None):
    """In which update of half a second it is found first."""
    monitor = saturation or Saturation(BOUNDS)
    for k in range(from_update, from_update + 80):
        if monitor.update(command_pa(k), drive_limited=drive_limited(k), elapsed_s=0.5):
            return k
    return None


@pytest.mark.parametrize("way", [-1, 1])
def test_a_command_at_its_limit_is_saturated_after_ten_seconds(way):
    """Counted from the update after the first: 20 are ten seconds, and one is more."""
    for share, first in ((0.979, None), (0.98, 21), (1.1, 21)):
        assert first_saturated(lambda _, s=share: 100 * s * way, lambda _: False) == first
    # from one limit to the other it begins anew, and where it has left its limit
    assert first_saturated(lambda k: 100.0 * way * (-1 if k < 15 else 1), lambda _: False) == 36
    assert first_saturated(lambda k: way * (0.0 if k == 15 else 100.0), lambda _: False) == 36
    assert first_saturated(lambda k: 100.0 * way * (-1) ** (k // 20), lambda _: False) is None


@pytest.mark.parametrize("share", [0.5, 0.1])
@pytest.mark.parametrize(("left", "still"), [(0.9, True), (-0.9, False), (0.898, False)])
def test_once_found_less_than_the_degraded_pressure_ends_it(share, left, still):
    left_pa = left * share * 100.0
    saturation = Saturation(replace(BOUNDS, degraded_share=share))
    assert first_saturated(lambda _: 100.0, lambda _: False, saturation=saturation)
    found = saturation.update(left_pa, drive_limited=False, elapsed_s=0.5)
    assert found == (Finding.SATURATED if still else 0)
    if not still:
        assert first_saturated(lambda _: 50.0, lambda _: False, saturation=saturation) is None


def test_a_drive_at_its_own_limit_is_saturated_after_ten_seconds_whatever_the_command():
    def swings(k):
        return 1.0 if k % 2 else -1.0

    assert first_saturated(swings, lambda _: True) == 20
    assert first_saturated(swings, lambda k: k != 15) == 36
    # and with the command at its limit before or after it, that is one time
    assert first_saturated(lambda k: 1.0 if k < 15 else 100.0, lambda k: k < 15) == 21
    assert first_saturated(lambda k: 1.0, lambda k: k < 20) is None
