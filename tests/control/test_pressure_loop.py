"""The loop around a drive: its margins, its lag, and what it does at a limit."""

import math

import numpy as np
import pytest

from utank_hil.control.pressure_loop import PressureLoop, loop_margins
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.pump_curve import pump_load, pump_pressure, pump_speed

PUMP = Pump.for_duct(6.22)
CYCLE_S = 0.02


@pytest.mark.parametrize(("design_s", "real_s"), [(0.05, 0.05), (0.05, 0.07), (0.1, 0.05)])
def test_margins_are_those_of_the_frequency_response(design_s, real_s):
    w = np.geomspace(0.1, 200, 200_000)
    loop = np.exp(-1j * w * real_s) / (2 * design_s * 1j * w)
    phase, size = np.unwrap(np.angle(loop)), np.abs(loop)
    found = loop_margins(design_s, real_s)
    at = np.argmin(abs(size - 1))
    assert found.crossover_rad_s == pytest.approx(w[at], rel=1e-3)
    assert found.phase_rad == pytest.approx(math.pi + phase[at], abs=1e-3)
    assert found.gain == pytest.approx(1 / size[np.argmin(abs(phase + math.pi))], rel=1e-3)


def pressures(loop, wanted_pa, steps, gain=1.0, late=2, flow=2.0, targets=None):
    """Pressure that a drive with a speed loop of its own makes, `gain` times that of the map."""
    c, speed = PUMP.coefficients, flow / PUMP.duct_area_m2 / PUMP.pitch_m
    seen, found = [0.0] * (late + 1), []
    for _ in range(steps):
        target = loop.step(wanted_pa, seen[-late - 1], flow, math.nan)
        if targets is not None:
            targets.append(target)
        speed += (1 - math.exp(-CYCLE_S * PUMP.speed_bandwidth_rad_s)) * (target - speed)
        seen.append(gain * pump_pressure(speed, flow, c))
        found.append(seen[-1])
    return np.array(found)


def test_the_pressure_has_the_lag_that_the_law_is_designed_for():
    found = pressures(PressureLoop(PUMP, CYCLE_S, 0.05, torque=False), 20e3, 200)
    missing_s = CYCLE_S * float(0.5 + np.sum(1 - found / 20e3))  # the area above a step
    assert 0.5 * PUMP.lag_s < missing_s <= PUMP.lag_s
    assert found[-1] == pytest.approx(20e3, rel=1e-3)
    assert max(found) < 1.05 * 20e3


@pytest.mark.parametrize("gain", [0.6, 1.8])
def test_a_map_that_is_wrong_is_corrected(gain):
    found = pressures(PressureLoop(PUMP, CYCLE_S, 0.05, torque=False), 15e3, 300, gain)
    assert found[-1] == pytest.approx(15e3, rel=0.01)


def test_what_can_not_be_reached_winds_nothing_up():
    found = []
    for steps in (300, 3000):
        loop = PressureLoop(PUMP, CYCLE_S, 0.05, torque=False)
        pressures(loop, 50e3, steps, 0.2)  # the pump makes a fifth, whatever is asked for
        found.append(pressures(loop, -15e3, 60))
    assert found[0][40:] == pytest.approx(-15e3, rel=0.1)
    assert found[1] == pytest.approx(found[0])


def test_without_a_measurement_it_goes_by_the_map():
    loop = PressureLoop(PUMP, CYCLE_S, 0.05, torque=False)
    for _ in range(100):
        speed = loop.step(20e3, math.nan, 2.0, math.nan)
    assert pump_pressure(speed, 2.0, PUMP.coefficients) == pytest.approx(20e3, rel=1e-3)


@pytest.mark.parametrize(("delay_s", "late"), [(0.005, 1), (0.05, 2)])
def test_a_speed_is_that_of_the_map_and_of_a_simc_pi_loop(delay_s, late):
    """By its own arithmetic: reference and drive as low-passes, Kc = lag / (2 delay), Ti = lag."""
    loop = PressureLoop(PUMP, CYCLE_S, delay_s, torque=False)
    lag_s, wanted_pa, flow = 1 / PUMP.speed_bandwidth_rad_s, 3e3, 2.0
    references, expected_pa, integral_pa = [0.0] * (late + 1), 0.0, 0.0
    for k in range(1, 12):
        measured_pa = 0.9 * expected_pa - 20.0
        speed = loop.step(wanted_pa, measured_pa, flow, math.nan)
        reference_pa = wanted_pa * (1 - math.exp(-k * CYCLE_S / (PUMP.lag_s - lag_s)))
        expected_pa += (1 - math.exp(-CYCLE_S / lag_s)) * (references[-late] - expected_pa)
        references.append(reference_pa)
        error_pa = expected_pa - measured_pa
        integral_pa += lag_s / (2 * delay_s) * error_pa * CYCLE_S / lag_s
        due_pa = reference_pa + integral_pa + lag_s / (2 * delay_s) * error_pa
        assert pump_pressure(speed, flow, PUMP.coefficients) == pytest.approx(due_pa)


@pytest.mark.parametrize("torque", [False, True])
def test_a_pump_that_has_stood_still_is_asked_for_nothing_until_something_is_wanted(torque):
    loop = PressureLoop(PUMP, CYCLE_S, 0.05, torque=torque)
    for _ in range(2):
        assert [loop.step(0.0, 0.0, 0.0, 0.0) for _ in range(5)] == [0.0] * 5
        assert loop.step(20e3, 5e3, 1.0, 0.1) != 0.0
        loop.reset()


def test_the_pressure_asked_for_rises_no_faster_than_the_pump_can():
    loop, c = PressureLoop(PUMP, CYCLE_S, 0.05, torque=False), PUMP.coefficients
    wanted = [pump_pressure(loop.step(5e5, math.nan, 0.0, math.nan), 0.0, c) for _ in range(4)]
    step_pa = PUMP.max_pressure_rate_pa_s * CYCLE_S
    assert wanted == pytest.approx([step_pa * k for k in (1, 2, 3, 4)], rel=1e-6)


def test_torque_is_that_of_the_water_of_the_acceleration_and_of_a_speed_that_is_behind():
    """By its own arithmetic: a low-pass of the pump's lag, the map, and a gain of 1 / (2 delay)."""
    delay_s, late, flow, c = 0.05, 2, 2.0, PUMP.coefficients
    loop = PressureLoop(PUMP, CYCLE_S, delay_s, torque=True)
    wanted_pa, before = 2e3, [0.0] * (late + 1)
    references, integral_pa = [0.0] * (late + 1), 0.0
    for k in range(1, 8):
        speed_rad_s = 0.9 * before[-1]
        measured_pa = 0.9 * references[-late]
        torque = loop.step(wanted_pa, measured_pa, flow, speed_rad_s if k != 4 else math.nan)
        reference_pa = wanted_pa * (1 - math.exp(-k * CYCLE_S / PUMP.lag_s))
        integral_pa += CYCLE_S / (2 * delay_s) * (references[-late] - measured_pa)
        references.append(reference_pa)
        speed = pump_speed(reference_pa + integral_pa, flow, c)
        behind = before[-late] - speed_rad_s if k != 4 else 0.0
        acceleration = (speed - before[-1]) / CYCLE_S + behind / (2 * delay_s)
        due = pump_load(speed, flow, c)[0] + c.inertia * acceleration
        assert torque == pytest.approx(min(max(due, -c.max_torque), c.max_torque))
        before.append(speed)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_torque_ends_at_its_limit_and_winds_nothing_up_there(way):
    c, after = PUMP.coefficients, []
    for steps in (100, 1000):
        loop = PressureLoop(PUMP, CYCLE_S, 0.05, torque=True)
        for k in range(steps):  # a rotor that does not turn
            torque = loop.step(way * 30e3, 0.0, 0.0, 0.0)
            assert k < 20 or torque == way * c.max_torque
        after.append(loop.step(0.0, math.nan, 0.0, math.nan))
    assert after[1] == pytest.approx(after[0])
