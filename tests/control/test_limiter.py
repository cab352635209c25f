"""Pump limits: each holds, and the level barrier keeps the pump from flooding a reservoir."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.control import CommandLimiter, PumpLimits
from utank_hil.dynamics import Tank

TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10)
PERIOD_S = 0.02

numbers = st.floats(-1e6, 1e6)
motions = st.lists(st.tuples(numbers, st.floats(-6, 6), st.floats(-4, 4)), min_size=1, max_size=50)


@given(motions)
def test_pressure_and_rate_hold_for_any_wish_and_motion(sequence):
    limits = PumpLimits(pressure_pa=50e3, rate_pa_s=100e3)
    limiter = CommandLimiter(limits, TANK, PERIOD_S)
    commands = [0.0, *(limiter.limit(*sample) for sample in sequence)]
    assert np.abs(commands).max() <= 50e3
    assert np.abs(np.diff(commands)).max() <= 100e3 * PERIOD_S * (1 + 1e-12)


@given(numbers, st.floats(-6, 6), st.floats(-4, 4), st.floats(0, 1))
def test_share_of_the_pressure_holds_for_braking_too(desired, level, rate, share):
    limiter = CommandLimiter(PumpLimits(pressure_pa=50e3, rate_pa_s=1e9), TANK, PERIOD_S)
    assert abs(limiter.limit(desired, level, rate, share)) <= 50e3 * share


@pytest.mark.parametrize("place", [0, 1, 2])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_sends_the_command_to_zero(place, value):
    limiter = CommandLimiter(PumpLimits(rate_pa_s=1e9), TANK, PERIOD_S)
    sample = [30e3, 0.5, 0.3]
    limiter.limit(*sample)
    sample[place] = value
    assert limiter.limit(*sample) == 0.0
    assert limiter.limiting


@given(numbers, st.floats(-6, 6), st.floats(-4, 4))
def test_mirrored_motion_gives_the_mirrored_command(desired, level, rate):
    limits = PumpLimits(rate_pa_s=1e9, power_w=4e5)
    one = CommandLimiter(limits, TANK, PERIOD_S).limit(desired, level, rate)
    other = CommandLimiter(limits, TANK, PERIOD_S).limit(-desired, -level, -rate)
    assert one == -other


@given(numbers, st.floats(-6, 6), st.floats(-4, 4))
def test_power_put_into_the_water_stays_below_its_limit(desired, level, rate):
    limiter = CommandLimiter(PumpLimits(rate_pa_s=1e9, power_w=2e5), TANK, PERIOD_S)
    command = limiter.limit(desired, level, rate)
    assert command * TANK.reservoir_area_m2 * rate <= 2e5 * (1 + 1e-12)


@pytest.mark.parametrize("rate", [5e-324, -5e-324, 1e-310])
def test_water_that_all_but_stands_still_divides_nothing_by_zero(rate):
    """Half a square metre times the smallest rate there is rounds to no flow."""
    small = dataclasses.replace(TANK, reservoir_area_m2=0.4)
    limiter = CommandLimiter(PumpLimits(pressure_pa=50e3, rate_pa_s=1e9), small, PERIOD_S)
    assert limiter.limit(7e3, 0.0, rate) == 7e3


def test_small_motion_leaves_the_wish_alone():
    limiter = CommandLimiter(PumpLimits(rate_pa_s=1e9), TANK, PERIOD_S)
    assert limiter.limit(31e3, 0.5, 0.3) == 31e3


@pytest.mark.parametrize("start_m", [0.0, 1.5, -3.0])
def test_pump_pushing_with_the_flow_never_overshoots_the_level(start_m):
    # bang-bang in step with the water, the worst a controller can ask for, in a ship at rest
    limits = PumpLimits(level_m=3.85)
    limiter = CommandLimiter(limits, TANK, PERIOD_S)
    level, rate, pressure, highest = start_m, 0.01, 0.0, 0.0
    inertia = TANK.density_kg_m3 * TANK.effective_length_m
    stiffness = 2 * TANK.density_kg_m3 * 9.80665
    for k in range(60_000):
        if k % 10 == 0:
            command = limiter.limit(np.copysign(1e6, rate), level, rate)
        pressure += 0.002 / 0.1 * (command - pressure)  # the drive's lag
        rate += 0.002 * (pressure - stiffness * level - TANK.loss_pa_per_m_s * rate) / inertia
        level += 0.002 * rate
        highest = max(highest, abs(level))
    assert 3.4 < highest < 3.85


@pytest.mark.parametrize(("share", "push_pa"), [(1.0, 15e3), (0.5, 15e3), (0.25, 15e3)])
def test_a_wave_that_leaves_the_passive_water_below_the_limit_leaves_the_pump_s_there(
    share, push_pa
):
    # the wave at the water's own frequency, the pump always with the flow
    limits = PumpLimits(level_m=3.85)
    inertia = TANK.density_kg_m3 * TANK.effective_length_m
    stiffness = 2 * TANK.density_kg_m3 * 9.80665
    highest = []
    for part in (0.0, share):
        limiter = CommandLimiter(limits, TANK, PERIOD_S)
        level = rate = pressure = most = 0.0
        for k in range(100_000):
            if k % 10 == 0:
                command = limiter.limit(np.copysign(1e6, rate), level, rate, part)
            pressure += 0.002 / 0.1 * (command - pressure)
            push = pressure + push_pa * np.sin(TANK.natural_frequency_rad_s * 0.002 * k)
            rate += 0.002 * (push - stiffness * level - TANK.loss_pa_per_m_s * rate) / inertia
            level += 0.002 * rate
            most = max(most, abs(level))
        highest.append(most)
    assert 3.4 < highest[0] < 3.85
    assert 3.4 < highest[1] < 3.85


@pytest.mark.parametrize("share", [1.0, 0.4])
@pytest.mark.parametrize("brake_share", [0.1, 0.5, 0.9])
@pytest.mark.parametrize("sharpness", [1.0, 2.2])
def test_barrier_allows_what_its_formula_says(brake_share, sharpness, share):
    level, rate, level_limit = 3.6, 0.85, 3.85
    limits = PumpLimits(
        rate_pa_s=1e9, brake_share=brake_share, sharpness=sharpness, lookahead_s=0.0
    )
    # the pressure under which the water, free of losses, just comes to rest at the limit: the
    # energy h'^2 / 2 w0^2 + (h - h_e)^2 / 2 is the same there
    speed = rate / TANK.natural_frequency_rad_s
    candidates = np.linspace(-6, 6, 2_000_001)
    left = speed**2 + (level - candidates) ** 2 - (level_limit - candidates) ** 2
    touch = 2 * TANK.density_kg_m3 * 9.80665 * candidates[np.abs(left).argmin()]
    brake = brake_share * share * 50e3
    expected = np.clip(-brake + sharpness * (touch + brake), -share * 50e3, share * 50e3)
    command = CommandLimiter(limits, TANK, PERIOD_S).limit(1e6, level, rate, share)
    assert share < 1 or abs(expected) < 50e3
    assert command == pytest.approx(expected, abs=10)


def test_a_millimetre_below_the_level_all_of_the_pressure_brakes():
    limits = PumpLimits(rate_pa_s=1e9, level_m=2e-3, lookahead_s=0.0)
    assert CommandLimiter(limits, TANK, PERIOD_S).limit(1e6, 1e-3, 1e-9) == -50e3


def test_mean_of_the_commands_between_two_steps():
    limiter = CommandLimiter(PumpLimits(rate_pa_s=1e5), TANK, PERIOD_S)
    commands = [limiter.limit(50e3, 0.0, 0.0) for _ in range(10)]
    assert limiter.mean_since_last_call() == pytest.approx(np.mean(commands))
    limiter.limit(0.0, 0.0, 0.0)
    assert limiter.mean_since_last_call() == pytest.approx(limiter.command_pa)
    # nothing since: what was commanded last
    assert limiter.mean_since_last_call() == limiter.command_pa > 0
    last_pa = limiter.limit(50e3, 0.0, 0.0)
    limiter.cut()  # is a command of zero
    assert limiter.mean_since_last_call() == pytest.approx(last_pa / 2)


def test_limits_of_a_file_that_says_nothing_and_the_least_there_are():
    assert PumpLimits() == PumpLimits(50e3, 100e3, 3.85, np.inf, 0.7, 2.2, 0.25)
    PumpLimits(pressure_pa=1e-3, rate_pa_s=1e-3, level_m=1e-3, power_w=1e-3, brake_share=1.0)
    PumpLimits(sharpness=1.0, lookahead_s=0.0)
    limiter = CommandLimiter(PumpLimits(rate_pa_s=1e9), TANK, PERIOD_S)
    assert limiter.limit(60e3, 0.0, 0.0) == 50e3  # all of the pressure, if no share is named


def test_new_and_after_a_cut_or_ramp_it_limits_nothing():
    limiter = CommandLimiter(PumpLimits(rate_pa_s=1e5), TANK, PERIOD_S)
    assert (limiter.command_pa, limiter.limiting) == (0.0, False)
    assert limiter.mean_since_last_call() == 0.0
    for relieve in (limiter.cut, limiter.ramp_to_zero):
        limiter.limit(50e3, 0.0, 0.0)
        assert limiter.limiting
        relieve()
        assert limiter.limiting is False
    limiter.limit(limiter.command_pa, 0.0, 0.0)
    assert not limiter.limiting


@pytest.mark.parametrize("period_s", [0.0, -0.01, np.nan, np.inf])
def test_a_period_that_is_none_is_refused(period_s):
    with pytest.raises(ValueError, match="period_s"):
        CommandLimiter(PumpLimits(), TANK, period_s)


def test_cut_is_at_zero_at_once_and_ramp_at_the_rate_limit():
    limiter = CommandLimiter(PumpLimits(rate_pa_s=1e5), TANK, PERIOD_S)
    for _ in range(20):
        limiter.limit(50e3, 0.0, 0.0)
    before = limiter.command_pa
    assert limiter.ramp_to_zero() == pytest.approx(before - 1e5 * PERIOD_S)
    assert limiter.cut() == limiter.command_pa == 0.0


def test_ramp_to_zero_ends_there_even_where_the_level_barrier_would_brake():
    limiter = CommandLimiter(PumpLimits(rate_pa_s=1e9), TANK, PERIOD_S)
    assert limiter.limit(0.0, 3.7, 1.0) < 0.0
    assert limiter.ramp_to_zero() == 0.0


def test_a_share_of_the_pressure_bounds_the_command():
    limiter = CommandLimiter(PumpLimits(rate_pa_s=1e9), TANK, PERIOD_S)
    assert limiter.limit(50e3, 0.0, 0.0, share=0.5) == 25e3
    assert limiter.limiting


@pytest.mark.parametrize(
    "bad",
    [
        {"pressure_pa": 0.0},
        {"rate_pa_s": -1.0},
        {"level_m": float("nan")},
        {"power_w": 0.0},
        {"brake_share": 1.5},
        {"sharpness": 0.5},
        {"lookahead_s": -0.1},
    ],
)
def test_bad_limits_are_refused_by_name(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        PumpLimits(**bad)
