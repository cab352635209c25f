"""The loop around a drive: its margins, its lag, and what it does at a limit."""

import math

import numpy as np
import pytest

from utank_hil.control.pressure_loop import PressureLoop, loop_margins
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.pump_curve import pump_pressure

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


def pressures(loop, wanted_pa, steps, gain=1.0, late=2, flow=2.0):
    """Pressure that a drive with a speed loop of its own makes, `gain` times that of the map."""
    c, speed = PUMP.coefficients, flow / PUMP.duct_area_m2 / PUMP.pitch_m
    seen, found = [0.0] * (late + 1), []
    for _ in range(steps):
        target = loop.step(wanted_pa, seen[-late - 1], flow, math.nan)
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
    loop = PressureLoop(PUMP, CYCLE_S, 0.05, torque=False)
    pressures(loop, 50e3, 300, 0.2)  # the pump makes a fifth, whatever is asked for
    after = pressures(loop, -15e3, 60)
    assert after[40:] == pytest.approx(-15e3, rel=0.1)


def test_without_a_measurement_it_goes_by_the_map():
    loop = PressureLoop(PUMP, CYCLE_S, 0.05, torque=False)
    for _ in range(100):
        speed = loop.step(20e3, math.nan, 2.0, math.nan)
    assert pump_pressure(speed, 2.0, PUMP.coefficients) == pytest.approx(20e3, rel=1e-3)
