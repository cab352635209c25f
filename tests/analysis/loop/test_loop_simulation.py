"""The fast loop against integration of the coupled model and against the sampled plant."""

import numpy as np
import pytest
from rolling_ship import SHIP, TANK
from scipy.integrate import solve_ivp

from utank_hil.analysis import SensorNoise
from utank_hil.analysis.loop.loop_simulation import between, passive_motion, simulate_loop
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


def test_motion_between_its_samples_is_that_of_the_finer_grid():
    coarse = passive_motion(SHIP, TANK, WAVES, 0.05, 1001)
    fine = passive_motion(SHIP, TANK, WAVES, 0.01, 5000)
    # (w step)^4 / 384 of the faster wave, and of its rate four times the (w step)^3 of it
    found = between(coarse, 0.05, 5)
    np.testing.assert_allclose(found[::5], fine[::5], rtol=1e-12, atol=1e-12)
    size = np.abs(fine).max(axis=0)
    assert (np.abs(found - fine).max(axis=0) < size * [1e-7, 1e-5, 1e-7, 1e-5]).all()


@pytest.mark.parametrize("delay_s", [0.0, 0.05])
def test_what_is_kept_is_each_fifth_tick_of_all(delay_s):
    commands = 1e4 * np.random.default_rng(3).normal(size=30)
    waves = passive_motion(SHIP, TANK, WAVES, 0.01, 600)
    plant = DesignPlant(SHIP, TANK, delay_s=delay_s)
    every, fifth = (
        simulate_loop(plant, waves, Script(commands), STATES, seed=2, every=step) for step in (1, 5)
    )
    for name in ("motion", "pressure_pa", "command_pa"):
        np.testing.assert_array_equal(getattr(fifth, name), getattr(every, name)[::5])
    # a command reaches the drive after the delay, and its lag
    reached = np.flatnonzero(every.pressure_pa)[0]
    assert reached == np.flatnonzero(every.command_pa)[0] + round(delay_s / 0.01) + 1
