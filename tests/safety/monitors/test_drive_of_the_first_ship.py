"""The drive against a pump that swings as in waves, with the figures of the first ship."""

import math
from dataclasses import replace

import numpy as np
import pytest
from moving_ship import CONFIG, FINDINGS, THRESHOLDS

from utank_hil.dynamics.pump import AT_REST, pump_step
from utank_hil.safety.monitors.drive import DriveFollowing
from utank_hil.safety.monitors.finding import Finding

STEP_S = 0.05
LAG_S = CONFIG.vessel.pump.lag_s


def drive_findings(actual, seconds=30.0, limited=False, along_m_s=0.0):
    """When a drive that makes `actual(time, pressure)` of the right pressure is found out.

    The water flows at `along_m_s` the way of the command.
    """
    monitor = DriveFollowing(LAG_S, THRESHOLDS, STEP_S)
    right = 0.0
    first: dict[int, float] = {}
    for k in range(round(seconds / STEP_S)):
        t = k * STEP_S
        command = 30e3 * math.sin(0.6 * t)
        for j in range(5):  # a drive of its own: 20 ms late, in steps of 10 ms
            late = 30e3 * math.sin(0.6 * (t - STEP_S + 0.01 * (j + 1) - 0.02))
            right += (late - right) * (1 - math.exp(-0.01 / LAG_S))
        rate_m_s = math.copysign(along_m_s, right) * math.copysign(1.0, along_m_s)
        found = monitor.update(
            command,
            actual(t, right),
            0.0,
            rate_m_s,
            enabled=True,
            limited=limited,
            at_speed=limited,
        )
        for finding in FINDINGS:
            if found & finding:
                first.setdefault(finding, t)
    return first


def test_drive_that_follows_is_left_alone():
    assert not drive_findings(lambda _, right: right)


@pytest.mark.parametrize("begin_s", [2.0, 2.6, 4.0])
def test_stalled_drive_is_found_by_300_ms_and_lost_by_500(begin_s):
    """Counted from where the command is 15 % of the limit off."""
    found = drive_findings(lambda t, right: 0.0 if t >= begin_s else right)
    off_s = next(
        t
        for t in np.arange(begin_s, 30, 0.01)
        if abs(30e3 * math.sin(0.6 * (t - 0.12))) > THRESHOLDS.pressure_error_pa
    )
    assert found[Finding.DRIVE_LAGS] - off_s <= 0.3 + STEP_S
    assert found[Finding.DRIVE_LOST] - off_s <= 0.5 + STEP_S
    assert Finding.PUMP_SIGN not in found


def test_reversed_pump_is_found_within_200_ms_limited_or_not():
    for limited in (False, True):
        found = drive_findings(lambda t, right: -right if t >= 2.0 else right, limited=limited)
        assert found[Finding.PUMP_SIGN] <= 2.2


def test_drive_at_its_own_limit_may_stay_behind():
    def weak(_, right):
        return min(max(right, -10e3), 10e3)

    assert Finding.DRIVE_LOST in drive_findings(weak)
    assert not drive_findings(weak, limited=True)


def off_findings(pressure_pa, level_m=0.0, seconds=3.0, limited=False):
    """First findings of a drive that held 40 kPa and is switched off at zero."""
    monitor = DriveFollowing(LAG_S, THRESHOLDS, STEP_S)
    for _ in range(60):
        assert not monitor.update(40e3, 40e3, 0.0, 0.0, enabled=True, limited=False, at_speed=False)
    first: dict[int, float] = {}
    for k in range(1, round(seconds / STEP_S)):
        t = k * STEP_S
        off = {"enabled": False, "limited": limited, "at_speed": limited}
        found = monitor.update(0.0, pressure_pa(t), level_m, 0.0, **off)
        for finding in FINDINGS:
            if found & finding:
                first.setdefault(finding, t)
    return first


@pytest.mark.parametrize("limited", [False, True])
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_pump_that_presses_though_its_drive_is_off_is_found(sign, limited):
    found = off_findings(lambda _: sign * 1.1 * THRESHOLDS.pressure_error_pa, limited=limited)
    assert 0.8 < found[Finding.DRIVE_LOST] < 1.1
    assert Finding.PUMP_SIGN not in found
    later = off_findings(lambda t: 20e3 * (t >= 2.0))
    assert 2.3 < later[Finding.DRIVE_LOST] < 2.5


def test_a_rotor_that_runs_down_or_turns_freely_in_the_water_is_left_alone():
    assert not off_findings(lambda t: 40e3 * math.exp(-t / 0.2))
    for level_m in (-4.2, 4.2):
        # as measured, of a level that swings so far: docs/monitors.md
        free = off_findings(lambda _: 1.5 * THRESHOLDS.pressure_error_pa, level_m)
        assert not free
    assert off_findings(lambda _: 1.5 * THRESHOLDS.pressure_error_pa, 0.5)


def test_a_pressure_that_is_late_again_and_again_is_judged_by_what_comes_in_between():
    monitor = DriveFollowing(LAG_S, THRESHOLDS, STEP_S)
    found = []
    for k in range(60):
        pressure_pa = 0.0 if k % 3 else math.nan
        found.append(
            monitor.update(20e3, pressure_pa, 0.0, 0.0, enabled=True, limited=False, at_speed=False)
        )
    first = next(k for k, each in enumerate(found) if each & Finding.DRIVE_LOST)
    assert first < 30
    assert all(each & Finding.DRIVE_LOST for each in found[first:])
    held = {"enabled": True, "limited": False, "at_speed": False}
    assert monitor.update(20e3, math.nan, 0.0, 0.0, **held) & Finding.DRIVE_LOST
    assert not monitor.update(20e3, 20e3, 0.0, 0.0, **held)
    assert not monitor.update(20e3, math.nan, 0.0, 0.0, **held)


@pytest.mark.parametrize("phase_rad", [0.0, 0.8, 1.6])
def test_a_motor_at_its_power_presses_along_and_hides_no_wrong_sign(phase_rad):
    """The pump of `dynamics` in water that swings, its power too small for all of the pressure."""
    pump = replace(CONFIG.vessel.pump, max_power_w=6e5)
    sound, wrong = (DriveFollowing(LAG_S, THRESHOLDS, STEP_S) for _ in range(2))
    state, found_s, seconds_at_power = AT_REST, [], 0.0
    for k in range(2000):
        t = k * 0.01
        command_pa, flow_m3_s = 45e3 * math.sin(0.6 * t), 25.0 * math.sin(0.6 * t + phase_rad)
        state = pump_step(state, command_pa, flow_m3_s, 0.01, pump.coefficients)
        if k % 5:
            continue
        drive = {
            "enabled": True,
            "limited": state.limited,
            "at_speed": abs(state.speed_rad_s) >= 0.999 * pump.max_speed_rad_s,
        }
        assert not drive["at_speed"]
        seconds_at_power += STEP_S * state.limited
        assert not sound.update(command_pa, state.pressure_pa, 0.0, flow_m3_s, **drive)
        pressure_pa = -state.pressure_pa if 3.0 <= t < 3.5 else state.pressure_pa
        if wrong.update(command_pa, pressure_pa, 0.0, flow_m3_s, **drive) & Finding.PUMP_SIGN:
            found_s.append(t)
    assert found_s[0] == pytest.approx(3.1)
    assert found_s[-1] < 3.5  # and over, once the sign was right again
    assert seconds_at_power > 3.0
