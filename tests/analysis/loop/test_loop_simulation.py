"""The fast loop against integration of the coupled model and against the sampled plant."""

import numpy as np
import pytest
from rolling_ship import SHIP, TANK
from scipy.integrate import solve_ivp
from shipped_designs import GPC_ROLL

from utank_hil.analysis import LinearShip, NonlinearShip, SensorNoise, run_law
from utank_hil.analysis.loop.loop_simulation import passive_motion, simulate_loop
from utank_hil.base.tick import TICK_S
from utank_hil.control import DesignPlant, PassiveController, PumpLimits
from utank_hil.dynamics.linear import STATES, coupled_model, pump_model
from utank_hil.dynamics.sampling import sample
from utank_hil.sea import Harmonics

SILENT = SensorNoise(0.0, 0.0, 0.0, 0.0)
FREE = PumpLimits(pressure_pa=1e9, rate_pa_s=1e12, level_m=1e6)
WAVES = Harmonics(np.array([2e7, 1e7]), np.array([0.55, 0.9]), np.array([0.3, 2.0]))


class Script:
    """Plays a list of commands and keeps what it is told."""

    sample_time_s = 0.2

    def __init__(self, commands):
        self.commands, self.seen, self.told = list(commands), [], []

    def step(self, y, reference=None):
        self.seen.append(y.copy())
        return np.array([self.commands[len(self.seen) - 1]])

    def applied(self, u):
        self.told.append(float(u[0]))

    def reset(self):
        self.seen.clear()


def test_passive_motion_equals_integration_from_rest():
    system = coupled_model(SHIP, TANK)
    times = 0.5 * np.arange(121)
    result = solve_ivp(
        lambda t, x: system.A @ x + system.B[:, 1] * WAVES.at(t),
        (0.0, 60.0),
        np.zeros(4),
        t_eval=times,
        rtol=1e-10,
        atol=1e-12,
    )
    np.testing.assert_allclose(
        passive_motion(SHIP, TANK, WAVES, 0.5, 121), result.y.T, rtol=1e-6, atol=1e-9
    )


def test_pump_acts_as_in_the_sampled_model_with_delay_and_lag():
    commands = 1e4 * np.random.default_rng(0).normal(size=50)
    script = Script(commands)
    still = np.zeros((50 * 20, 4))
    run = simulate_loop(DesignPlant(SHIP, TANK, limits=FREE), still, script, STATES, noise=SILENT)
    plant = sample(pump_model(SHIP, TANK, STATES), 0.2, 0.05, 0.1)
    state = np.zeros(len(plant.A))
    held = np.concatenate([[0.0], commands])  # v(k + 1) is the command of sample k
    for k in range(50):
        expected = plant.C @ state + plant.D[:, 0] * held[k]
        np.testing.assert_allclose(run.motion[20 * k], expected, rtol=1e-8, atol=1e-14)
        state = plant.A @ state + plant.B[:, 0] * held[k]
    np.testing.assert_allclose(script.told, commands[:-1])


def test_with_no_pressure_the_motion_is_the_passive_one():
    waves = passive_motion(SHIP, TANK, WAVES, 0.01, 500)
    run = simulate_loop(
        DesignPlant(SHIP, TANK, limits=PumpLimits()), waves, PassiveController(), ("roll_rad",)
    )
    np.testing.assert_array_equal(run.motion, waves)


def test_a_delay_between_the_ticks_is_refused():
    with pytest.raises(ValueError, match="delay_s"):
        simulate_loop(
            DesignPlant(SHIP, TANK, delay_s=0.055),
            np.zeros((10, 4)),
            PassiveController(),
            ("roll_rad",),
        )


def test_a_nonlinear_ship_in_small_waves_moves_as_the_linear_one():
    small = Harmonics(WAVES.amplitude / 50, WAVES.frequency_rad_s, WAVES.phase_rad)
    plant, ticks = DesignPlant(SHIP, TANK, limits=FREE), 6000
    commands = 300.0 * np.sin(0.3 * np.arange(ticks // 20))
    linear = LinearShip(plant, passive_motion(SHIP, TANK, small, TICK_S, ticks), noise=SILENT)
    nonlinear = NonlinearShip(plant, small, ticks, noise=SILENT)
    one, other = (
        run_law(ship, Script(commands), STATES, plant, ticks) for ship in (linear, nonlinear)
    )
    np.testing.assert_allclose(other.motion, one.motion, atol=0.01 * np.abs(one.motion).max())
    np.testing.assert_allclose(other.pressure_pa, one.pressure_pa, atol=1e-6)
    assert nonlinear.strikes == 0
    assert nonlinear.capsized_s == np.inf


def test_a_law_quiets_the_nonlinear_ship_in_waves():
    plant, ticks = DesignPlant(SHIP, TANK, limits=FREE), 30_000
    law = GPC_ROLL.law(plant)
    waves = Harmonics(np.array([2e7]), np.array([0.5]), np.array([0.0]))
    passive, ruled = (
        run_law(NonlinearShip(plant, waves, ticks), controller, measured, plant, ticks)
        for controller, measured in (
            (PassiveController(sample_time_s=0.2), ("roll_rad",)),
            (law.controller(), GPC_ROLL.predictor.measured),
        )
    )
    late = slice(ticks // 2, None)
    assert np.std(ruled.motion[late, 0]) < 0.7 * np.std(passive.motion[late, 0])
