"""Feedback linearization: linear roll on the exact model, zero dynamics, limits of the level."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from utank_hil.control.feedback_linearization import FeedbackLinearization
from utank_hil.dynamics import RollShip, Tank

# Patti-B of Table 4.1 with its tank; a tank below the centre of gravity tests more terms
PATTI_B = RollShip(
    1.468e6, 2.366e6 * 0.2138, 3.206e3, 9.882e4, restoring_odd_nm=(-2.366e6 * 0.6713,)
)
TANK = Tank(5.0, 2.0, 2.0, 0.19, lz_m=0.5, damping_ratio=0.1, quadratic_loss=0.3)
FIRST = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.81875e7)
FIRST_TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10)


def law_of(ship=PATTI_B, tank=TANK, **changes):
    numbers = {
        "frequency_rad_s": 0.6,
        "damping_ratio": 0.3,
        "soft_level_m": 1.8,
        "hard_level_m": 1.95,
    }
    return FeedbackLinearization(ship, tank, **{**numbers, **changes})


def run(law, initial, duration_s, wave=lambda t: 0.0, control=True):
    """Continuous control on the exact model, to integrator accuracy."""

    def slope(t, x):
        share = law.share(x[2], x[3]) if control else 0.0
        pressure = share * law.pressure_pa(x) if share else 0.0
        return law.model.derivative(x, pressure, wave(t))

    times = np.linspace(0, duration_s, 401)
    result = solve_ivp(slope, (0, duration_s), initial, "DOP853", times, rtol=1e-10, atol=1e-12)
    return times, result.y.T


def linear_response(times, output, rate, w, zeta):
    damped = w * np.sqrt(1 - zeta**2)
    return np.exp(-zeta * w * times) * (
        output * np.cos(damped * times) + (rate + zeta * w * output) / damped * np.sin(damped * times)
    )


def test_roll_is_the_linear_response_on_the_exact_model_at_large_angles():
    law = law_of()
    times, x = run(law, [0.35, -0.05, 0.4, 0.1], 40.0)
    assert np.hypot(x[:, 2], x[:, 3] / law.zero_dynamics_rad_s).max() < law.soft_level_m
    expected = linear_response(times, 0.35, -0.05, 0.6, 0.3)
    np.testing.assert_allclose(x[:, 0], expected, atol=1e-6 * 0.35)


@pytest.mark.parametrize("length", [1.0, 2.5])
def test_shifted_output_is_the_linear_response_on_the_exact_model(length):
    law = law_of(shift_rad_m=0.2, shift_length_m=length)
    start = [0.2, 0.02, 0.5, -0.1]
    times, x = run(law, start, 40.0)
    assert np.hypot(x[:, 2], x[:, 3] / law.zero_dynamics_rad_s).max() < law.soft_level_m
    output = x[:, 0] + 0.2 * length * np.sin(x[:, 2] / length)
    rate = start[1] + 0.2 * np.cos(start[2] / length) * start[3]
    expected = linear_response(times, output[0], rate, 0.6, 0.3)
    np.testing.assert_allclose(output, expected, atol=1e-6 * abs(output[0]))


def test_target_of_the_output_is_reached():
    law = law_of(damping_ratio=0.9)
    state = np.array([0.05, 0.0, 0.1, 0.0])
    acceleration = law.model.derivative(state, law.pressure_pa(state, 0.05))[1]
    assert acceleration == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("ship", "tank"), [(PATTI_B, TANK), (FIRST, FIRST_TANK)])
def test_zero_dynamics_swing_with_the_frequency_of_4_10_and_do_not_decay(ship, tank):
    law = law_of(ship, tank)
    frequency = law.zero_dynamics_rad_s
    assert frequency == pytest.approx(np.sqrt(9.80665 / (tank.height_m + tank.lz_m)))
    times, x = run(law, [0.0, 0.0, 1.0, 0.0], 30 / frequency)
    np.testing.assert_allclose(x[:, 0], 0, atol=1e-9)
    np.testing.assert_allclose(x[:, 2], np.cos(frequency * times), atol=1e-6)


def test_zero_dynamics_of_the_shifted_output_decay():
    law = law_of(shift_rad_m=1.0, shift_length_m=5.0)
    # on s = s' = 0 at a small level
    h = 0.01
    times, x = run(law, [-1.0 * 5.0 * np.sin(h / 5.0), 0.0, h, 0.0], 3000.0)
    late = np.abs(x[times > 2500, 2]).max()
    c, shift = law.model.coefficients, 1.0
    damping = c.damping * shift / (2 * (c.inertia * shift - c.coupling))
    assert late == pytest.approx(h * np.exp(-damping * 2500), rel=0.3)


def test_printed_output_without_a_shift_is_driven_to_the_limits_where_blending_holds_the_level():
    # a wave at the frequency of the undamped zero dynamics makes the level grow for ever
    law = law_of()
    frequency = law.zero_dynamics_rad_s
    unbounded = law_of(soft_level_m=1e6, hard_level_m=1e7)

    def wave(t):
        return 2e4 * np.sin(frequency * t)

    free = run(unbounded, np.zeros(4), 60.0, wave)[1]
    held = run(law, np.zeros(4), 60.0, wave)[1]
    np.testing.assert_allclose(free[:, 0], free[0, 0], atol=2e4 / 1e6)
    assert np.abs(free[:, 2]).max() > 3.0
    assert np.abs(held[:, 2]).max() < TANK.level_limit_m


def test_share_falls_smoothly_from_one_at_the_soft_to_zero_at_the_hard_limit():
    law = law_of()
    levels = np.linspace(0, 3, 3001)
    shares = np.array([law.share(level, 0.0) for level in levels])
    assert (shares[levels <= 1.8] == 1).all()
    assert (shares[levels >= 1.9501] == 0).all()
    assert (np.diff(shares) <= 0).all()
    assert np.abs(np.diff(shares)).max() < 0.02
    assert law.share(0.0, 1.95 * law.zero_dynamics_rad_s) == 0


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
