"""Spikes, noise, volume, drive and saturation."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from moving_ship import CONFIG, THRESHOLDS

from utank_hil.runtime.monitors.drive import DriveFollowing, Saturation
from utank_hil.runtime.monitors.finding import Finding
from utank_hil.runtime.monitors.noise import Noise, SecondDifference
from utank_hil.runtime.monitors.spikes import STEP_SAMPLES, SpikeCount, SpikeGate
from utank_hil.runtime.monitors.volume import Volume

MS = 1_000_000


def test_one_spike_is_discarded_and_the_next_sample_is_taken() -> None:
    gate = SpikeGate(0.01, 0.5)
    assert gate.passes(0.1, 0)
    assert not gate.passes(0.6, 10 * MS)
    assert gate.passes(0.1, 20 * MS)
    assert gate.discarded == 1


def test_first_sample_passes_wherever_it_is() -> None:
    assert SpikeGate(0.01, 0.5).passes(3.0, 0)


def test_step_that_stays_is_taken_in_the_end() -> None:
    gate = SpikeGate(0.01, 0.5)
    assert gate.passes(0.0, 0)
    passed = [gate.passes(0.5, k * 10 * MS) for k in range(1, 8)]
    assert passed == [k >= STEP_SAMPLES - 1 for k in range(7)]


@given(st.floats(-1, 1), st.integers(1, 1000), st.floats(0, 1))
def test_what_moves_no_faster_than_it_can_always_passes(
    start: float, elapsed_ms: int, share: float
) -> None:
    gate = SpikeGate(0.01, 0.5)
    gate.passes(start, 0)
    move = share * (0.01 + 0.5 * elapsed_ms * 1e-3) * 0.999
    assert gate.passes(start + move, elapsed_ms * MS)


def test_five_spikes_are_too_many_unless_seconds_lie_between_them() -> None:
    close, far = SpikeCount(), SpikeCount()
    assert [close.update(n, 0.1) for n in range(1, 8)].index(True) in (4, 5)
    assert not any(far.update(n, 1.0) for n in range(100))


@pytest.mark.parametrize(("times", "expected"), [(1, False), (2, False), (10, True), (100, True)])
def test_noise_ten_times_the_figure_is_found_within_two_seconds(
    times: float, expected: bool
) -> None:
    random = np.random.default_rng(1)
    noise, smooth = Noise(math.sqrt(6) * THRESHOLDS.rate_noise_rad_s), SecondDifference()
    found = False
    for k in range(40):
        rate = 0.06 * math.sin(0.6 * 0.05 * k) + times * 5e-4 * random.standard_normal()
        found |= noise.update(smooth.update(rate), 0.05)
    assert found is expected


def volume_findings(
    port_error_m: float, seconds: float, noise_m: float = 0.005, port_noise_m: float = 0.0
) -> list[int]:
    random, volume = np.random.default_rng(1), Volume(THRESHOLDS)
    found = []
    for k in range(round(seconds / 0.1)):
        level = 2.0 * math.sin(0.06 * k)
        port, starboard = (max(noise_m, port_noise_m), noise_m) * random.standard_normal(2)
        found.append(volume.update(port_error_m - level + port, level + starboard, 0.1))
    return found


def test_levels_that_mirror_one_another_are_left_alone() -> None:
    assert not any(volume_findings(0.0, 600))
    assert not any(volume_findings(0.8 * THRESHOLDS.volume_m, 60)[30:])


def test_a_gauge_that_is_off_degrades_and_ends_if_it_lasts_or_is_far_off() -> None:
    little = volume_findings(1.5 * THRESHOLDS.volume_m, 60)
    assert little[50] & Finding.VOLUME
    assert not little[50] & Finding.VOLUME_LASTS
    assert little[-1] & Finding.VOLUME_LASTS
    assert volume_findings(8 * THRESHOLDS.volume_m, 5)[-1] & Finding.VOLUME_LASTS


def test_noise_of_one_gauge_is_seen_from_four_times_its_figure() -> None:
    found = volume_findings(0.0, 60.0, port_noise_m=0.0225)
    assert np.mean([bool(each & Finding.NOISE) for each in found]) > 0.6
    assert not any(volume_findings(0.0, 600.0, port_noise_m=0.0075))


def test_noise_of_the_gauges_is_seen_in_their_sum() -> None:
    assert volume_findings(0.0, 2.0, noise_m=0.05)[-1] & Finding.NOISE


STEP_S = 0.05
LAG_S = CONFIG.vessel.pump.lag_s


def drive_findings(
    actual, seconds: float = 30.0, limited: bool = False, along_m_s: float = 0.0
) -> dict[Finding, float]:
    """When a drive that makes `actual(time, pressure)` of the right pressure is found out.

    The water flows at `along_m_s` the way of the command.
    """
    monitor = DriveFollowing(LAG_S, THRESHOLDS, STEP_S)
    right = 0.0
    first: dict[Finding, float] = {}
    for k in range(round(seconds / STEP_S)):
        t = k * STEP_S
        command = 30e3 * math.sin(0.6 * t)
        for j in range(5):  # a drive of its own: 20 ms late, in steps of 10 ms
            late = 30e3 * math.sin(0.6 * (t - STEP_S + 0.01 * (j + 1) - 0.02))
            right += (late - right) * (1 - math.exp(-0.01 / LAG_S))
        rate_m_s = math.copysign(along_m_s, right) * math.copysign(1.0, along_m_s)
        found = monitor.update(
            command, actual(t, right), 0.0, rate_m_s, enabled=True, limited=limited
        )
        for finding in Finding:
            if found & finding:
                first.setdefault(finding, t)
    return first


def test_drive_that_follows_is_left_alone() -> None:
    assert not drive_findings(lambda _, right: right)


@pytest.mark.parametrize("begin_s", [2.0, 2.6, 4.0])
def test_stalled_drive_is_found_by_300_ms_and_lost_by_500(begin_s: float) -> None:
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


@pytest.mark.parametrize(
    ("share", "what", "updates"),
    [(0.0, Finding.DRIVE_LAGS, 4), (0.0, Finding.DRIVE_LOST, 9), (-1.0, Finding.PUMP_SIGN, 3)],
)
def test_how_many_steps_a_drive_may_be_off(share: float, what: Finding, updates: int) -> None:
    """With the step in which the fault began and the model's lag: 300, 500 and 200 ms."""
    monitor = DriveFollowing(LAG_S, THRESHOLDS, STEP_S)
    for _ in range(60):
        assert not monitor.update(40e3, 40e3, 0.0, 0.0, enabled=True, limited=False)
    found = [
        monitor.update(40e3, share * 40e3, 0.0, 0.0, enabled=True, limited=False)
        for _ in range(updates)
    ]
    assert [bool(each & what) for each in found] == [False] * (updates - 1) + [True]


def test_reversed_pump_is_found_within_200_ms_limited_or_not() -> None:
    for limited in (False, True):
        found = drive_findings(lambda t, right: -right if t >= 2.0 else right, limited=limited)
        assert found[Finding.PUMP_SIGN] <= 2.2


def test_drive_at_its_own_limit_may_stay_behind() -> None:
    def weak(_, right):
        return min(max(right, -10e3), 10e3)

    assert Finding.DRIVE_LOST in drive_findings(weak)
    assert not drive_findings(weak, limited=True)


def test_water_that_outruns_a_rotor_at_its_limit_is_no_reversed_pump() -> None:
    def braking(_, right):
        return -0.3 * right

    for along_m_s, limited, blamed in ((0.7, True, False), (-0.7, True, True), (0.7, False, True)):
        found = drive_findings(braking, limited=limited, along_m_s=along_m_s)
        assert (Finding.PUMP_SIGN in found) == blamed


def off_findings(pressure_pa, level_m=0.0, seconds: float = 3.0, limited: bool = False):
    """First findings of a drive that held 40 kPa and is switched off at zero."""
    monitor = DriveFollowing(LAG_S, THRESHOLDS, STEP_S)
    for _ in range(60):
        assert not monitor.update(40e3, 40e3, 0.0, 0.0, enabled=True, limited=False)
    first: dict[Finding, float] = {}
    for k in range(1, round(seconds / STEP_S)):
        t = k * STEP_S
        off = {"enabled": False, "limited": limited}
        found = monitor.update(0.0, pressure_pa(t), level_m, 0.0, **off)
        for finding in Finding:
            if found & finding:
                first.setdefault(finding, t)
    return first


@pytest.mark.parametrize("limited", [False, True])
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_pump_that_presses_though_its_drive_is_off_is_found(sign: int, limited: bool) -> None:
    found = off_findings(lambda _: sign * 1.1 * THRESHOLDS.pressure_error_pa, limited=limited)
    assert 0.8 < found[Finding.DRIVE_LOST] < 1.1
    assert Finding.PUMP_SIGN not in found
    later = off_findings(lambda t: 20e3 * (t >= 2.0))
    assert 2.3 < later[Finding.DRIVE_LOST] < 2.5


def test_a_rotor_that_runs_down_or_turns_freely_in_the_water_is_left_alone() -> None:
    assert not off_findings(lambda t: 40e3 * math.exp(-t / 0.2))
    for level_m in (-4.2, 4.2):
        # as measured, of a level that swings so far: docs/monitors.md
        free = off_findings(lambda _: 1.5 * THRESHOLDS.pressure_error_pa, level_m)
        assert not free
    assert off_findings(lambda _: 1.5 * THRESHOLDS.pressure_error_pa, 0.5)


def test_a_pressure_that_is_late_again_and_again_is_judged_by_what_comes_in_between() -> None:
    monitor = DriveFollowing(LAG_S, THRESHOLDS, STEP_S)
    found = []
    for k in range(60):
        pressure_pa = 0.0 if k % 3 else math.nan
        found.append(monitor.update(20e3, pressure_pa, 0.0, 0.0, enabled=True, limited=False))
    first = next(k for k, each in enumerate(found) if each & Finding.DRIVE_LOST)
    assert first < 30
    assert all(each & Finding.DRIVE_LOST for each in found[first:])
    held = {"enabled": True, "limited": False}
    assert monitor.update(20e3, math.nan, 0.0, 0.0, **held) & Finding.DRIVE_LOST
    assert not monitor.update(20e3, 20e3, 0.0, 0.0, **held)
    assert not monitor.update(20e3, math.nan, 0.0, 0.0, **held)


def test_command_held_at_its_limit_for_ten_seconds_is_saturated_until_it_leaves() -> None:
    limit_pa = THRESHOLDS.pressure_limit_pa
    saturation = Saturation(THRESHOLDS)
    held = [saturation.update(limit_pa, drive_limited=False, elapsed_s=0.1) for _ in range(110)]
    assert held.index(Finding.SATURATED) in range(100, 103)
    # half the pressure is what it is left with
    assert saturation.update(limit_pa / 2, drive_limited=False, elapsed_s=0.1)
    assert not saturation.update(limit_pa / 4, drive_limited=False, elapsed_s=0.1)


def test_command_that_goes_from_limit_to_limit_is_not_saturated() -> None:
    saturation = Saturation(THRESHOLDS)
    for k in range(1000):
        side = 1 if k // 60 % 2 else -1
        pressure_pa = side * THRESHOLDS.pressure_limit_pa
        limited = k % 60 > 0  # not while it turns
        assert not saturation.update(pressure_pa, drive_limited=limited, elapsed_s=0.1)


def test_drive_that_says_it_is_limited_for_ten_seconds_is_saturated_whatever_the_command() -> None:
    saturation = Saturation(THRESHOLDS)
    held = [
        saturation.update(math.copysign(1e3, math.sin(k / 20)), drive_limited=True, elapsed_s=0.1)
        for k in range(110)
    ]
    assert held.index(Finding.SATURATED) in range(99, 103)
    assert not saturation.update(1e3, drive_limited=False, elapsed_s=0.1)
