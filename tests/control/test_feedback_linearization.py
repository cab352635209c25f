"""Feedback linearization: linear roll on the exact model, zero dynamics, limits of the level."""

import numpy as np
import pytest

from utank_hil.analysis.loop.margins import closed_loop_radius
from utank_hil.control.feedback_linearization import FeedbackLinearization
from utank_hil.control.gain import GainLaw
from utank_hil.dynamics import RollShip, Tank
from utank_hil.dynamics.linear import STATES, pump_model
from utank_hil.dynamics.sampling import sample

# Patti-B of Table 4.1 with its tank; a tank below the centre of gravity tests more terms
PATTI_B = RollShip(
    1.468e6, 2.366e6 * 0.2138, 3.206e3, 9.882e4, restoring_odd_nm=(-2.366e6 * 0.6713,)
)
TANK = Tank(5.0, 2.0, 2.0, 0.19, lz_m=0.5, damping_ratio=0.1, quadratic_loss=0.3)
FIRST = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.81875e7)
FIRST_TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10)


def law_of(ship=PATTI_B, tank=TANK, **changes):
    numbers = {
        "frequency_rad_s": 0.58,
        "damping_ratio": 0.15,
        "soft_level_m": 1.8,
        "hard_level_m": 1.95,
    }
    return FeedbackLinearization(ship=ship, tank=tank, **{**numbers, **changes})


def zero_dynamics_rad_s(tank=TANK):
    """Frequency of the level under zero roll, (4.10)."""
    return np.sqrt(9.80665 / (tank.height_m + tank.lz_m))


def run(law, initial, duration_s, wave=lambda t: 0.0, step_s=0.02):
    """Continuous control on the exact model: every stage of a Runge-Kutta step has its own."""

    def slope(t, x):
        share = law.share(x[2], x[3])
        return law.model.derivative(x, share * law.pressure_pa(x), wave(t))

    steps = round(duration_s / step_s)
    x = np.array(initial)
    states = [x]
    for k in range(steps):
        t, half = k * step_s, step_s / 2
        k1 = slope(t, x)
        k2 = slope(t + half, x + half * k1)
        k3 = slope(t + half, x + half * k2)
        k4 = slope(t + step_s, x + step_s * k3)
        x = x + step_s / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        states.append(x)
        if abs(x[2]) > 2 * law.tank.height_m:  # far beyond what the reservoirs hold
            break
    return step_s * np.arange(len(states)), np.array(states)


def linear_response(times, output, rate, w, zeta):
    damped = w * np.sqrt(1 - zeta**2)
    sine = (rate + zeta * w * output) / damped * np.sin(damped * times)
    return np.exp(-zeta * w * times) * (output * np.cos(damped * times) + sine)


def test_roll_is_the_linear_response_on_the_exact_model_at_large_angles():
    law = law_of()
    times, x = run(law, [0.25, 0.0, -0.2, 0.0], 20.0)
    assert np.hypot(x[:, 2], x[:, 3] / law.tank.natural_frequency_rad_s).max() < law.soft_level_m
    expected = linear_response(times, 0.25, 0.0, 0.58, 0.15)
    np.testing.assert_allclose(x[:, 0], expected, atol=1e-6 * 0.25)


@pytest.mark.slow
@pytest.mark.parametrize("length", [1.5, 2.5])
def test_shifted_output_is_the_linear_response_on_the_exact_model(length):
    law = law_of(shift_rad_m=0.1, shift_length_m=length)
    start = [0.2, 0.02, 0.3, -0.1]
    times, x = run(law, start, 20.0)
    assert np.hypot(x[:, 2], x[:, 3] / law.tank.natural_frequency_rad_s).max() < law.soft_level_m
    output = x[:, 0] + 0.1 * length * np.sin(x[:, 2] / length)
    rate = start[1] + 0.1 * np.cos(start[2] / length) * start[3]
    expected = linear_response(times, output[0], rate, 0.58, 0.15)
    np.testing.assert_allclose(output, expected, atol=1e-6 * abs(output[0]))


def test_target_of_the_output_is_reached():
    law = law_of(damping_ratio=0.9)
    state = np.array([0.05, 0.0, 0.1, 0.0])
    acceleration = law.model.derivative(state, law.pressure_pa(state, 0.05))[1]
    assert acceleration == pytest.approx(0.0, abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("ship", "tank"), [(PATTI_B, TANK), (FIRST, FIRST_TANK)])
def test_zero_dynamics_swing_with_the_frequency_of_4_10_and_do_not_decay(ship, tank):
    law = law_of(ship, tank)
    frequency = zero_dynamics_rad_s(tank)
    times, x = run(law, [0.0, 0.0, 0.4, 0.0], 20.0)
    np.testing.assert_allclose(x[:, 0], 0, atol=1e-9)
    np.testing.assert_allclose(x[:, 2], 0.4 * np.cos(frequency * times), atol=1e-6)


@pytest.mark.slow
def test_zero_dynamics_of_the_shifted_output_decay():
    law = law_of(shift_rad_m=1.0, shift_length_m=5.0)
    # on s = s' = 0 at a small level
    h = 0.01
    _, x = run(law, [-1.0 * 5.0 * np.sin(h / 5.0), 0.0, h, 0.0], 150.0, step_s=0.05)
    c = law.model.coefficients
    decay = c.damping / (2 * (c.inertia - c.coupling))
    swing = np.hypot(x[:, 2], x[:, 3] / 0.6)
    assert swing[-1] / swing[0] == pytest.approx(np.exp(-decay * 150), abs=0.03)
    assert decay * 150 > 0.1


@pytest.mark.slow
def test_printed_output_without_a_shift_is_driven_to_the_limits_where_blending_holds_the_level():
    # a wave at the frequency of the undamped zero dynamics makes the level grow for ever
    law = law_of(damping_ratio=0.5)
    frequency = zero_dynamics_rad_s()
    unbounded = law_of(damping_ratio=0.5, soft_level_m=1e6, hard_level_m=1e7)

    def wave(t):
        return 2e4 * np.sin(frequency * t)

    free = run(unbounded, np.zeros(4), 60.0, wave, 0.05)[1]
    held = run(law, np.zeros(4), 60.0, wave, 0.05)[1]
    assert np.abs(free[:, 2]).max() > TANK.level_limit_m
    assert np.abs(held[:, 2]).max() < TANK.level_limit_m


def test_share_falls_smoothly_from_one_at_the_soft_to_zero_at_the_hard_limit():
    law = law_of()
    levels = np.linspace(0, 3, 3001)
    shares = np.array([law.share(level, 0.0) for level in levels])
    assert (shares[levels <= 1.8] == 1).all()
    assert (shares[levels >= 1.9501] == 0).all()
    assert (np.diff(shares) <= 0).all()
    assert np.abs(np.diff(shares)).max() < 0.02
    assert law.share(0.0, 1.96 * TANK.natural_frequency_rad_s) == 0


def test_controller_gives_the_blended_pressure():
    law = law_of()
    controller = law.controller()
    inside, between = np.array([0.1, 0.02, 0.5, 0.1]), np.array([0.1, 0.02, 1.9, 0.1])
    assert controller.step(inside)[0] == law.pressure_pa(inside)
    assert controller.step(inside, np.array([0.1]))[0] == law.pressure_pa(inside, 0.1)
    blended = law.share(1.9, 0.1) * law.pressure_pa(between)
    assert 0 < law.share(1.9, 0.1) < 1
    assert controller.step(between)[0] == blended
    assert controller.step(np.array([0.1, 0.0, 1.99, 0.0]))[0] == 0


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"frequency_rad_s": 0.0}, "frequency_rad_s"),
        ({"soft_level_m": 2.0}, "soft_level_m"),
        ({"hard_level_m": 2.1}, "hard_level_m 2.1: the reservoirs end at 2 m"),
        ({"hard_level_m": 9.0}, "hard_level_m"),
        ({"shift_rad_m": -0.1}, "shift_rad_m"),
        ({"sample_time_s": np.inf}, "sample_time_s"),
    ],
)
def test_parameters_out_of_range_are_refused_by_name(changes, name):
    with pytest.raises(ValueError, match=name):
        law_of(**changes)


def test_shift_that_turns_over_within_the_level_limits_is_refused():
    with pytest.raises(ValueError, match="grip"):
        law_of(shift_rad_m=2.0, shift_length_m=1.0)


def test_level_brake_adds_its_term_to_the_linear_response_and_nothing_else():
    law = law_of(level_damping_ratio=0.4)
    state = np.array([0.2, 0.05, 0.0, 0.3])  # at level 0 the roll inertia is m0
    acceleration = law.model.derivative(state, law.pressure_pa(state))[1]
    c = law.model.coefficients
    brake = 2 * 0.4 * zero_dynamics_rad_s() * -c.coupling / c.inertia * 0.3
    expected = -(0.58**2) * 0.2 - 2 * 0.15 * 0.58 * 0.05 - brake
    assert acceleration == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("ship", "tank"), [(PATTI_B, TANK), (FIRST, FIRST_TANK)])
def test_delay_and_lag_of_the_pump_are_borne_with_the_level_braked_and_not_without(ship, tank):
    def radius(level_damping_ratio):
        law = law_of(ship, tank, damping_ratio=0.5, level_damping_ratio=level_damping_ratio)
        small = 1e-6 * np.eye(4)
        gain = [(law.pressure_pa(-x) - law.pressure_pa(x)) / 2e-6 for x in small]
        plant = sample(pump_model(ship, tank, STATES), 0.01, 0.05, 0.1)
        return closed_loop_radius(GainLaw(np.array([gain]), 0.01), plant)

    assert radius(0.4) < 1 < radius(0.0)
