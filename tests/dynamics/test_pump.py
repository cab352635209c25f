import dataclasses
import math

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pump_losses import pump_losses

from utank_hil.dynamics.pump import AT_REST, Pump, compile_pump, pump_coast, pump_step
from utank_hil.dynamics.pump_curve import pump_load, pump_pressure, pump_speed

PUMP = Pump.for_duct(6.22)
C = PUMP.coefficients

speeds = st.floats(-28.0, 28.0)
flows = st.floats(-60.0, 60.0)
rated_flows = st.floats(-45.0, 45.0)
pressures = st.floats(-50e3, 50e3)


def run(setpoint, flow, seconds, step_s=0.002, state=AT_REST, pump=PUMP):
    """States over time; set-point and flow are numbers or functions of time."""
    c = pump.coefficients
    states = []
    for index in range(round(seconds / step_s)):
        now = index * step_s
        state = pump_step(
            state,
            setpoint(now) if callable(setpoint) else setpoint,
            flow(now) if callable(flow) else flow,
            step_s,
            c,
        )
        states.append(state)
    return states


# The characteristic


@given(speeds, flows)
def test_shaft_power_is_hydraulic_power_plus_losses_in_all_quadrants(speed, flow):
    torque, _ = pump_load(speed, flow, C)
    losses = pump_losses(speed, flow, C)
    hydraulic = pump_pressure(speed, flow, C) * flow
    assert losses >= 0
    assert torque * speed == pytest.approx(hydraulic + losses, rel=1e-6, abs=1e-3)


@given(speeds, flows)
def test_starboard_and_port_are_alike(speed, flow):
    assert pump_pressure(-speed, -flow, C) == -pump_pressure(speed, flow, C)
    assert pump_load(-speed, -flow, C)[0] == -pump_load(speed, flow, C)[0]


@given(speeds, flows, st.floats(0.1, 3.0))
def test_affinity_laws(speed, flow, factor):
    """Pressure and torque go with the square of speed at the same flow coefficient."""
    pressure = pump_pressure(speed, flow, C)
    scaled = pump_pressure(factor * speed, factor * flow, C)
    assert scaled == pytest.approx(factor**2 * pressure, rel=1e-9, abs=1e-6)
    torque = pump_load(factor * speed, factor * flow, C)[0]
    assert torque == pytest.approx(factor**2 * pump_load(speed, flow, C)[0], rel=1e-6, abs=1e-3)


@given(speeds, flows, st.floats(0.01, 5.0))
def test_pressure_rises_with_speed_and_falls_with_flow_everywhere(speed, flow, more):
    here = pump_pressure(speed, flow, C)
    assert pump_pressure(speed + more, flow, C) > here
    assert pump_pressure(speed, flow + more, C) < here


@given(speeds, flows)
def test_load_slope_is_the_derivative_of_the_load(speed, flow):
    eps = 1e-5
    rise = pump_load(speed + eps, flow, C)[0] - pump_load(speed - eps, flow, C)[0]
    slope = pump_load(speed, flow, C)[1]
    assert slope >= 0
    assert slope == pytest.approx(max(rise / (2 * eps), 0.0), rel=1e-3, abs=20.0)


@given(pressures, flows)
def test_inverse_head_curve_gives_the_pressure(pressure, flow):
    speed = pump_speed(pressure, flow, C)
    assert pump_pressure(speed, flow, C) == pytest.approx(pressure, rel=1e-7, abs=1e-3)


def test_locked_rotor_opposes_the_flow_and_a_screw_without_slip_gives_no_pressure():
    assert pump_pressure(0.0, 30.0, C) < 0
    assert pump_load(0.0, 30.0, C)[0] < 0  # the water turns the rotor with the flow
    freewheel = 30.0 / PUMP.duct_area_m2 / PUMP.pitch_m
    assert pump_pressure(freewheel, 30.0, C) == pytest.approx(0.0, abs=1e-6)


def test_first_ship_reaches_rated_pressure_at_rated_flow_within_its_limits():
    speed = pump_speed(50e3, 45.0, C)
    torque, _ = pump_load(speed, 45.0, C)
    assert speed < PUMP.max_speed_rad_s
    assert torque < PUMP.max_torque_nm
    assert torque * speed < PUMP.max_power_w
    efficiency = 50e3 * 45.0 / (torque * speed)
    assert efficiency == pytest.approx(0.67, abs=0.01)
    # tip speed of a tunnel thruster: below 40 m/s
    assert speed * PUMP.radius_m / 0.7 < 40.0


def test_smaller_pump_is_similar():
    """Same velocities, so the same pressure and efficiency; powers go with the area."""
    small = Pump.for_duct(0.19)
    ratio = 0.19 / 6.22
    speed = pump_speed(50e3, 45.0, C)
    small_speed = pump_speed(50e3, 45.0 * ratio, small.coefficients)
    assert small_speed == pytest.approx(speed / math.sqrt(ratio))
    power = pump_load(speed, 45.0, C)[0] * speed
    small_power = pump_load(small_speed, 45.0 * ratio, small.coefficients)[0] * small_speed
    assert small_power == pytest.approx(power * ratio)
    assert small.max_power_w == pytest.approx(PUMP.max_power_w * ratio)
    # same materials: energy in the rotor goes with its volume
    energy, small_energy = (
        p.inertia_kg_m2 * n**2 for p, n in ((PUMP, speed), (small, small_speed))
    )
    assert small_energy == pytest.approx(energy * ratio**1.5)
    weaker = Pump.for_duct(6.22, 12.5e3)
    half = pump_speed(12.5e3, 22.5, weaker.coefficients)
    assert half == pytest.approx(speed / 2)
    assert half / weaker.max_speed_rad_s == pytest.approx(speed / PUMP.max_speed_rad_s)


# The loop


@pytest.mark.parametrize("flow", [-45.0, -20.0, 0.0, 20.0, 45.0])
@pytest.mark.parametrize("target", [-10e3, 5e3, 10e3])
def test_step_response_is_that_of_the_lag(flow, target):
    settled = run(0.0, flow, 20.0, step_s=0.01)[-1]
    assert settled.pressure_pa == pytest.approx(0.0, abs=1.0)
    states = run(target, flow, 0.6, state=settled)
    assert not any(state.limited for state in states)
    time = 0.002 * np.arange(1, len(states) + 1)
    response = np.array([state.pressure_pa for state in states]) / target
    assert time[np.argmax(response >= 1 - math.exp(-1))] == pytest.approx(PUMP.lag_s, rel=0.1)
    # worst from rest without flow, where the pressure starts as the square of speed
    assert np.max(np.abs(response - (1 - np.exp(-time / PUMP.lag_s)))) < 0.15
    assert np.max(response) < 1.02
    assert response[-1] == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("omega", [0.5, 2.0, 5.0])
def test_frequency_response_in_a_rolling_ship_is_that_of_the_lag(omega):
    """Set-point at several frequencies, the water swinging at the roll frequency of 0.5 rad/s."""
    period = 2 * math.pi / 0.5
    amplitude = 20e3
    states = run(
        lambda t: amplitude * math.sin(omega * t), lambda t: 25.0 * math.cos(0.5 * t), 2 * period
    )
    time = 0.002 * np.arange(1, len(states) + 1)
    pressure = np.array([state.pressure_pa for state in states])
    last = time > period
    basis = np.exp(-1j * omega * time[last])
    response = 2 * np.mean(pressure[last] * basis) / (amplitude / 1j)
    expected = 1 / (1 + 1j * omega * PUMP.lag_s)
    assert abs(response - expected) < 0.05


def test_integral_takes_out_what_the_feed_forward_has_wrong():
    """A constant error of the inverse head curve is the same as an integral that starts wrong."""
    start = AT_REST._replace(integral_pa=5e3)
    states = run(20e3, 20.0, 10.0, state=start)
    assert states[500].pressure_pa > 20.5e3
    assert states[-1].pressure_pa == pytest.approx(20e3, rel=1e-3)
    assert states[-1].integral_pa == pytest.approx(0.0, abs=50.0)


@given(
    st.lists(st.tuples(st.floats(-1e6, 1e6), rated_flows), min_size=1, max_size=60),
    st.sampled_from([0.001, 0.005, 0.01, 0.02]),
    st.sampled_from([6.22, 0.19]),
    st.sampled_from([1.0, 0.3]),
)
def test_limits_are_never_exceeded(inputs, step_s, area, power):
    full = Pump.for_duct(area)
    pump = dataclasses.replace(full, max_power_w=power * full.max_power_w)
    c = pump.coefficients
    state = AT_REST
    for setpoint, flow in inputs:
        before = state.reference_pa
        for _ in range(5):
            state = pump_step(state, setpoint, flow * area / 6.22, step_s, c)
            assert abs(state.reference_pa) <= pump.max_pressure_pa
            rate = abs(state.reference_pa - before) / step_s
            assert rate <= pump.max_pressure_rate_pa_s * (1 + 1e-9)
            assert abs(state.torque_nm) <= pump.max_torque_nm
            assert abs(state.power_w) <= pump.max_power_w * (1 + 1e-9)
            assert abs(state.speed_rad_s) <= pump.max_speed_rad_s * (1 + 1e-9)
            assert math.isfinite(state.pressure_pa)
            before = state.reference_pa


def test_pressure_rate_limit_ramps_the_reference():
    slow = dataclasses.replace(PUMP, max_pressure_rate_pa_s=50e3)
    states = run(50e3, 10.0, 0.5, pump=slow)
    reference = np.array([state.reference_pa for state in states])
    np.testing.assert_allclose(reference, 50e3 * 0.002 * np.arange(1, len(states) + 1), rtol=1e-9)


def test_power_limit_gives_less_pressure_and_recovers_without_overshoot():
    weak = dataclasses.replace(PUMP, max_power_w=1.5e6)
    limited = run(50e3, 40.0, 5.0, pump=weak)
    assert limited[-1].limited
    assert limited[-1].power_w == pytest.approx(1.5e6, rel=1e-3)
    assert 10e3 < limited[-1].pressure_pa < 45e3
    after = run(10e3, 40.0, 1.0, state=limited[-1], pump=weak)
    assert min(state.pressure_pa for state in after) > 9.5e3
    assert after[-1].pressure_pa == pytest.approx(10e3, rel=0.02)


def test_small_pump_at_its_torque_limit_stays_steady_at_the_longest_step():
    """Its rotor follows the water within milliseconds, which an explicit step would not survive."""
    full = Pump.for_duct(0.05)
    weak = dataclasses.replace(full, max_torque_nm=0.4 * full.max_torque_nm)
    states = run(50e3, 0.3, 2.0, step_s=0.02, pump=weak)
    last = [state.pressure_pa for state in states[-20:]]
    assert states[-1].limited
    assert max(last) - min(last) < 1.0
    torque, _ = pump_load(states[-1].speed_rad_s, 0.3, weak.coefficients)
    assert torque == pytest.approx(weak.max_torque_nm, rel=1e-3)


def test_power_of_a_long_first_step_is_the_energy_of_the_rotor():
    """From rest without flow all work goes into the rotor; the end speed would give twice it."""
    state = pump_step(AT_REST, 20e3, 0.0, 0.02, C)
    kinetic = PUMP.inertia_kg_m2 * state.speed_rad_s**2 / 2
    assert state.power_w * 0.02 == pytest.approx(kinetic, rel=1e-6)


@pytest.mark.slow
def test_work_of_the_shaft_goes_into_water_losses_and_the_rotor():
    step_s = 1e-4

    def flow(t):
        return 30.0 * math.cos(0.8 * t)

    state, work, water, lost = AT_REST, 0.0, 0.0, 0.0
    for index in range(80_000):
        now = index * step_s
        state = pump_step(state, 30e3 * math.sin(0.8 * now), flow(now), step_s, C)
        work += state.power_w * step_s
        water += state.pressure_pa * flow(now) * step_s
        lost += pump_losses(state.speed_rad_s, flow(now), C) * step_s
    kinetic = PUMP.inertia_kg_m2 * state.speed_rad_s**2 / 2
    assert work == pytest.approx(water + lost + kinetic, rel=1e-3)
    assert lost > 0


def test_coasting_pump_only_takes_energy_from_the_water_and_stops_with_it():
    state, taken = AT_REST, 0.0
    for index in range(int(10 * 2 * math.pi / 0.5 / 0.01)):
        flow = 30.0 * math.sin(0.5 * index * 0.01)
        state = pump_coast(state, flow, 0.01, C)
        assert state.torque_nm == 0
        taken -= state.pressure_pa * flow * 0.01
    assert taken > 0
    for _ in range(60_000):
        state = pump_coast(state, 0.0, 0.01, C)
    assert abs(state.speed_rad_s) < 0.1


def test_coasting_rotor_adds_the_inertia_of_its_gear_ratio_to_the_water():
    """Pressure J / (p A)^2 dQ/dt, the reason to hold zero pressure rather than coast."""
    state, omega, in_phase, weight = AT_REST, 0.5, 0.0, 0.0
    for index in range(40_000):
        flow, rate = 30.0 * math.sin(omega * index * 0.01), math.cos(omega * index * 0.01)
        state = pump_coast(state, flow, 0.01, C)
        in_phase -= state.pressure_pa * rate
        weight += 30.0 * omega * rate**2
    expected = PUMP.inertia_kg_m2 / (PUMP.pitch_m * PUMP.duct_area_m2) ** 2
    # less than that, because the water's hold on the rotor is weak where the flow turns
    assert 0.8 * expected < in_phase / weight < expected


@pytest.mark.slow
def test_compiled_pump_does_the_same():
    step, coast = compile_pump(numba.njit)
    rng = np.random.default_rng(5)
    plain = quick = AT_REST
    for _ in range(300):
        setpoint, flow = rng.uniform(-60e3, 60e3), rng.uniform(-50, 50)
        plain, quick = (
            pump_step(plain, setpoint, flow, 0.01, C),
            step(quick, setpoint, flow, 0.01, C),
        )
        np.testing.assert_allclose(quick, plain, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(coast(quick, 20.0, 0.01, C), pump_coast(plain, 20.0, 0.01, C))


@pytest.mark.parametrize("name", [field.name for field in dataclasses.fields(Pump)])
@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_bad_parameters_are_refused_by_name(name, bad):
    with pytest.raises(ValueError, match=name):
        dataclasses.replace(PUMP, **{name: bad})


def test_ambiguous_head_curves_and_impossible_lags_are_refused():
    with pytest.raises(ValueError, match="pitch_m must be"):
        dataclasses.replace(PUMP, pitch_m=0.3)
    with pytest.raises(ValueError, match=r"lag_s = 0\.01 must exceed"):
        dataclasses.replace(PUMP, lag_s=0.01)
    with pytest.raises(ValueError, match="positive area"):
        Pump.for_duct(-1.0)
