"""The clairvoyant bound: feasible, optimal against another solver, below every controller."""

import dataclasses

import numpy as np
import pytest
from rolling_ship import SHIP, TANK
from shipped_designs import GPC_ROLL

from tools.studies.clairvoyant import NoHistoryError, clairvoyant_bound
from utank_hil.analysis.loop.loop_simulation import passive_motion, simulate_loop
from utank_hil.base.tick import TICK_S
from utank_hil.control import DesignPlant, PumpLimits
from utank_hil.control.constrained.horizon import ActiveSetSolver
from utank_hil.dynamics.linear import STATES, pump_model
from utank_hil.dynamics.sampling import LinearModel, transition_and_step
from utank_hil.sea import EffectiveSlope, Sea, jonswap

LIMITS = PumpLimits(level_m=3.0)
MOMENT = Sea.irregular(jonswap(4.7, 10.0), 3, components=128).roll_moment(
    SHIP.stiffness_nm_rad, EffectiveSlope(0.5)
)
SAMPLES = 150
WAVES = passive_motion(SHIP, TANK, MOMENT, 0.2, SAMPLES + 1)
LAG_S = 0.1


def lagged():
    pump = pump_model(SHIP, TANK, STATES)
    a = np.block([[pump.A, pump.B], [np.zeros((1, 4)), np.full((1, 1), -1 / LAG_S)]])
    b = np.append(np.zeros(4), 1 / LAG_S)[:, None]
    return LinearModel(*transition_and_step(a, b, 0.2), np.eye(5), np.zeros((5, 1)), 0.2)


def replay(commands):
    plant, state, history = lagged(), np.zeros(5), []
    for u in commands:
        state = plant.A @ state + plant.B[:, 0] * u
        history.append(state)
    return np.array(history)


def test_history_obeys_the_dynamics_and_keeps_the_limits():
    best = clairvoyant_bound(DesignPlant(SHIP, TANK, lag_s=LAG_S, limits=LIMITS), WAVES)
    history = replay(best.command_pa)
    np.testing.assert_allclose(best.motion, WAVES[1:] + history[:, :4], atol=1e-6)
    np.testing.assert_allclose(best.pressure_pa, history[:, 4], atol=1.0)
    assert np.abs(best.command_pa).max() <= LIMITS.pressure_pa * (1 + 1e-6)
    steps = np.diff(best.command_pa, prepend=0.0)
    assert np.abs(steps).max() <= LIMITS.rate_pa_s * 0.2 * (1 + 1e-6)
    assert np.abs(best.motion[:, 2]).max() <= LIMITS.level_m + 1e-6
    assert best.roll_rms_rad == pytest.approx(np.sqrt(np.mean(best.motion[:, 0] ** 2)))


def test_bound_equals_a_dense_programme_in_the_commands_alone():
    # condensed by superposition, solved by an active-set method
    best = clairvoyant_bound(DesignPlant(SHIP, TANK, lag_s=LAG_S, limits=LIMITS), WAVES)
    plant = lagged()
    pulse, state = np.empty((SAMPLES, 5)), plant.B[:, 0]
    for k in range(SAMPLES):
        pulse[k] = state
        state = plant.A @ state
    effect = np.zeros((SAMPLES, SAMPLES, 5))
    for k in range(SAMPLES):
        effect[k:, k] = pulse[: SAMPLES - k]
    unit = LIMITS.pressure_pa
    roll, level = np.rad2deg(effect[:, :, 0]) * unit, effect[:, :, 2] * unit
    waves = np.rad2deg(WAVES[1:, 0])
    steps = np.eye(SAMPLES) - np.eye(SAMPLES, k=-1)
    hessian = roll.T @ roll + 1e-9 * np.eye(SAMPLES)
    ones = np.ones(SAMPLES)
    rate = LIMITS.rate_pa_s * 0.2 / unit
    solver = ActiveSetSolver(hessian, np.vstack([steps, level]), 100_000)
    found = solver.solve(
        roll.T @ waves,
        np.concatenate([-ones, -rate * ones, -LIMITS.level_m - WAVES[1:, 2]]),
        np.concatenate([ones, rate * ones, LIMITS.level_m - WAVES[1:, 2]]),
    )
    other = np.sqrt(np.mean(np.square(waves + roll @ found)))
    assert np.rad2deg(best.roll_rms_rad) == pytest.approx(other, rel=1e-4)


def test_wider_limits_never_raise_the_bound_and_a_power_limit_never_lowers_it():
    bound = clairvoyant_bound(DesignPlant(SHIP, TANK, limits=LIMITS), WAVES).roll_rms_rad
    for field, value in (("pressure_pa", 80e3), ("rate_pa_s", 2e5), ("level_m", 3.5)):
        wider = dataclasses.replace(LIMITS, **{field: value})
        assert clairvoyant_bound(
            DesignPlant(SHIP, TANK, limits=wider), WAVES
        ).roll_rms_rad < bound * (1 + 1e-6)
    powers = [
        clairvoyant_bound(
            DesignPlant(SHIP, TANK, limits=dataclasses.replace(LIMITS, power_w=power)), WAVES
        ).roll_rms_rad
        for power in (2e5, 5e5, 1e8)
    ]
    assert powers[0] > powers[1] > powers[2]
    assert powers[2] == pytest.approx(bound, rel=1e-5)


def test_the_hull_of_the_power_limit_lets_every_permitted_history_through():
    # power of the history with a power limit stays above what any history within it could need
    power_w = 3e5
    limits = dataclasses.replace(LIMITS, power_w=power_w)
    best = clairvoyant_bound(DesignPlant(SHIP, TANK, limits=limits), WAVES)
    flow = power_w / TANK.reservoir_area_m2
    cut = 4.0 * best.pressure_pa + LIMITS.pressure_pa * best.motion[:, 3]
    assert np.abs(cut).max() <= flow + 4.0 * LIMITS.pressure_pa + 1.0
    rng = np.random.default_rng(0)
    pressure, speed = rng.uniform(-5e4, 5e4, 10_000), rng.uniform(-4, 4, 10_000)
    permitted = pressure * speed <= flow
    inside = np.abs(4.0 * pressure + LIMITS.pressure_pa * speed) <= flow + 4.0 * 5e4
    assert inside[permitted].all()
    assert not inside.all()


def test_a_controller_on_the_same_record_stays_above_the_bound():
    waves = passive_motion(SHIP, TANK, MOMENT, TICK_S, 20 * SAMPLES + 1)
    controller = GPC_ROLL.law(DesignPlant(SHIP, TANK)).controller()
    run = simulate_loop(DesignPlant(SHIP, TANK, limits=LIMITS), waves, controller, ("roll_rad",))
    rms = np.sqrt(np.mean(np.square(run.motion[20::20, 0])))
    assert rms > clairvoyant_bound(DesignPlant(SHIP, TANK, limits=LIMITS), WAVES).roll_rms_rad


def test_waves_that_flood_the_tank_whatever_the_pump_does_are_told():
    weak = PumpLimits(pressure_pa=10.0, rate_pa_s=100.0, level_m=0.1)
    with pytest.raises(NoHistoryError, match="level_m"):
        clairvoyant_bound(DesignPlant(SHIP, TANK, limits=weak), WAVES)
