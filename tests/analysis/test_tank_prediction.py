import dataclasses
import math

import numpy as np
import pytest
from scipy.linalg import expm

from utank_hil.analysis.loop.sea_response import CalmSeaError, motion_in_sea
from utank_hil.analysis.tank_prediction import (
    SeaState,
    loading_sensitivity,
    predict_roll,
    pump_moments,
)
from utank_hil.analysis.tank_sizing import TankRoom, size_tank
from utank_hil.configuration.ship_keys import WrittenShip
from utank_hil.control import DesignPlant, PumpLimits
from utank_hil.dynamics import RollModel, simulate
from utank_hil.dynamics.linear import state_matrices
from utank_hil.dynamics.pump import AT_REST, Pump, pump_step
from utank_hil.sea import EffectiveSlope, Harmonics, Sea, jonswap

SHIP = WrittenShip(displacement_t=1900, gm_m=0.9, roll_period_s=9.5, damping_ratio=0.05).ship()
TANK = size_tank(SHIP, TankRoom.in_hull(63, 9.5)).tank
PLANT = DesignPlant(SHIP, TANK, limits=PumpLimits(12e3, 24e3, 1.4))
WAVES = Sea.irregular(jonswap(1.5, 9.5), seed=1).roll_moment(
    SHIP.stiffness_nm_rad, EffectiveSlope(0.7)
)
SEA = SeaState.on(SHIP, WAVES)
FOUND = predict_roll(PLANT, SEA)


def test_sea_is_described_as_the_ship_feels_it() -> None:
    assert SEA.peak_rad_s == pytest.approx(2 * math.pi / 9.5, rel=0.05)
    # of the same waves in time, twice the RMS of the slope of those below twice the roll frequency
    slow = WAVES.frequency_rad_s < 2 * SHIP.natural_frequency_rad_s
    kept = Harmonics(WAVES.amplitude[slow], WAVES.frequency_rad_s[slow], WAVES.phase_rad[slow])
    slope = kept.at(np.arange(0, 20_000, 0.7)) / SHIP.stiffness_nm_rad
    assert SEA.slope_rad == pytest.approx(2 * slope.std(), rel=0.03)


def test_waves_too_short_to_roll_the_ship_are_refused() -> None:
    ripples = Harmonics(np.ones(1), np.full(1, 4.0), np.zeros(1))
    with pytest.raises(CalmSeaError, match="does not roll the ship"):
        SeaState.on(SHIP, ripples)


def test_each_tank_lowers_the_roll_further() -> None:
    assert FOUND.without_tank_rad > FOUND.passive.roll_rms_rad > FOUND.active.roll_rms_rad
    assert FOUND.active_below_passive is not None
    assert FOUND.active_below_passive > 0.2
    assert 2 * FOUND.active.pressure_rms_pa <= PLANT.limits.pressure_pa
    assert 2 * FOUND.active.level_rms_m <= PLANT.limits.level_m


def test_passive_prediction_is_what_a_simulation_gives_for_small_motions() -> None:
    model = RollModel(SHIP, dataclasses.replace(TANK, headroom_m=math.inf))
    small = Harmonics(WAVES.amplitude / 100, WAVES.frequency_rad_s, WAVES.phase_rad)
    run = simulate(model, 4000.0, wave=small)
    roll = run.state[:, 0][len(run.state) // 10 :]
    assert 100 * roll.std() == pytest.approx(FOUND.passive.roll_rms_rad, rel=0.05)


def test_power_is_what_the_stepped_loop_gives_the_water() -> None:
    """The law stepped in time with ship, tank, lag and delay, in one wave."""
    frequency = 0.5  # away from resonance: pressure and flow are out of phase
    wave = Harmonics(np.full(1, 2e5), np.full(1, frequency), np.zeros(1))
    found = predict_roll(PLANT, dataclasses.replace(SEA, wave_moment=wave))
    law = found.law.design.law(PLANT)
    fine = 30
    step_s = law.sample_time_s / fine
    a, b = state_matrices(SHIP, TANK)
    turn = expm(np.block([[a, b], [np.zeros((2, 6))]]) * step_s)  # inputs held over a step
    delay = round(PLANT.delay_s / step_s)
    assert delay * step_s == pytest.approx(PLANT.delay_s)
    controller, state, pressure = law.controller(), np.zeros(4), 0.0
    commands, energy_j = [0.0] * delay, 0.0
    steps = fine * round(60 * 2 * math.pi / frequency / step_s / fine)
    for step in range(steps):
        if step % fine == 0:
            command = float(controller.step(state[:3])[0])
        commands.append(command)
        pressure += (commands[-1 - delay] - pressure) * -math.expm1(-step_s / PLANT.lag_s)
        if step >= steps / 2:
            energy_j += pressure * TANK.reservoir_area_m2 * state[3] * step_s
        moment = 2e5 * math.cos(frequency * (step + 0.5) * step_s)
        state = (turn @ [*state, pressure, moment])[:4]
    mean_w = energy_j / (steps / 2 * step_s)
    _, _, water_w = pump_moments(PLANT, found.law.design, wave)
    assert water_w == pytest.approx(mean_w, rel=0.03)


def test_shaft_power_is_what_the_stepped_pump_draws_in_the_same_waves() -> None:
    """Pressure and flow of the linear loop in time, and a rotor that has to follow them."""
    pump = Pump.for_duct(TANK.duct_area_m2, PLANT.limits.pressure_pa)
    pressure_rms_pa, flow_rms_m3_s, water_w = pump_moments(PLANT, FOUND.law.design, WAVES)
    rng, step_s = np.random.default_rng(1), 0.02
    # two narrow-banded signals of these RMS and this correlation
    t = np.arange(60_000) * step_s
    w, phase = rng.uniform(0.55, 0.75, 100), rng.uniform(0, math.tau, 100)
    lead = math.acos(water_w / (pressure_rms_pa * flow_rms_m3_s))
    angle = np.outer(t, w) + phase
    pressure = pressure_rms_pa * np.cos(angle).sum(axis=1) / math.sqrt(50)
    flow = flow_rms_m3_s * np.cos(angle + lead).sum(axis=1) / math.sqrt(50)
    state, drawn_w = AT_REST, 0.0
    for wanted, stream in zip(pressure.tolist(), flow.tolist(), strict=True):
        state = pump_step(state, wanted, stream, step_s, pump.coefficients)
        drawn_w += max(state.power_w, 0.0)
    assert FOUND.mean_power_w == pytest.approx(drawn_w / len(t), rel=0.15)
    assert FOUND.mean_power_w > 1.5 * water_w


def test_a_vessel_without_a_pump_has_no_active_tank() -> None:
    found = predict_roll(PLANT, SEA, pump=False)
    assert (found.active, found.law, found.active_below_passive) == (None, None, None)
    assert found.passive == FOUND.passive


def test_loading_changes_the_roll_and_the_nominal_one_is_the_prediction() -> None:
    points = {point.period_scale: point for point in loading_sensitivity(PLANT, SEA, FOUND)}
    assert points[1.0].active_rad == pytest.approx(FOUND.active.roll_rms_rad)
    assert points[1.0].passive_rad == pytest.approx(FOUND.passive.roll_rms_rad)
    stiff = dataclasses.replace(SHIP, stiffness_nm_rad=SHIP.stiffness_nm_rad / 0.7**2)
    moment = dataclasses.replace(WAVES, amplitude=WAVES.amplitude / 0.7**2)
    state = dataclasses.replace(SEA, wave_moment=moment)
    other = predict_roll(dataclasses.replace(PLANT, ship=stiff), state, pump=False)
    assert points[0.7].passive_rad == pytest.approx(other.passive.roll_rms_rad)
    assert points[0.7].without_tank_rad == pytest.approx(other.without_tank_rad)
    # the law is the one made for the nominal ship
    law, measured = FOUND.law.design.law(PLANT), FOUND.law.design.predictor.measured
    active = motion_in_sea(law, dataclasses.replace(PLANT, ship=stiff), measured, moment)
    assert points[0.7].active_rad == pytest.approx(active.roll_rms_rad)
