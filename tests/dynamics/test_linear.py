import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tools.thesis.harmonic import harmonic_response
from tools.thesis.simulate import simulate
from utank_hil.dynamics import RollModel, RollShip, Tank, coupled_model
from utank_hil.dynamics.linear import coupled_matrices

SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.87e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.1)
FREQUENCIES = np.array([0.2, 0.45, 0.55, 0.7, 1.1])


@pytest.mark.parametrize(
    ("inputs", "column"),
    [
        ({"pressure_pa": 2e4, "pressure_phase_rad": 0.4}, 0),
        ({"wave_moment_nm": 3e6, "wave_phase_rad": -1.1}, 1),
    ],
)
def test_closed_form_equals_state_space_frequency_response(inputs, column):
    amplitude, phase = inputs.values()
    transfer = (
        coupled_model(SHIP, TANK)(1j * FREQUENCIES)[:, column] * amplitude * np.exp(1j * phase)
    )
    closed = harmonic_response(SHIP, TANK, FREQUENCIES, **inputs)
    for k, size, angle in (
        (0, closed.roll_rad, closed.roll_phase_rad),
        (2, closed.level_m, closed.tank_phase_rad),
    ):
        np.testing.assert_allclose(size * np.exp(1j * angle), transfer[k], rtol=1e-12)
    np.testing.assert_allclose(closed.tank_angle_rad, closed.level_m / (17.1 / 2), rtol=1e-15)


@pytest.mark.parametrize("omega", FREQUENCIES)
@pytest.mark.parametrize(
    "inputs",
    [
        {"pressure_pa": 2e4, "pressure_phase_rad": 0.3},
        {"wave_moment_nm": 3e6, "wave_phase_rad": -0.8},
        {
            "pressure_pa": 2e4,
            "pressure_phase_rad": 0.3,
            "wave_moment_nm": 3e6,
            "wave_phase_rad": 2.0,
        },
    ],
)
def test_closed_form_equals_time_simulation(omega, inputs):
    """Start on the predicted oscillation and simulate four periods: it must be held."""
    closed = harmonic_response(SHIP, TANK, [omega], **inputs)
    system = coupled_model(SHIP, TANK)

    def motion(t):
        roll = closed.roll_rad * np.exp(1j * (omega * t + closed.roll_phase_rad))
        level = closed.level_m * np.exp(1j * (omega * t + closed.tank_phase_rad))
        return np.array([roll, 1j * omega * roll, level, 1j * omega * level])[:, 0].real

    def slope(t, x):
        pressure = inputs.get("pressure_pa", 0) * np.cos(
            omega * t + inputs.get("pressure_phase_rad", 0)
        )
        moment = inputs.get("wave_moment_nm", 0) * np.cos(
            omega * t + inputs.get("wave_phase_rad", 0)
        )
        return system.A @ x + system.B @ [pressure, moment]

    times = np.linspace(0, 8 * np.pi / omega, 60)
    run = solve_ivp(
        slope, times[[0, -1]], motion(0.0), "DOP853", t_eval=times, rtol=1e-10, atol=1e-12
    )
    expected = np.array([motion(t) for t in times]).T
    scale = np.abs(expected).max(axis=1, keepdims=True)
    assert np.max(np.abs(run.y - expected) / scale) < 1e-6


def test_reciprocity_roll_per_pump_moment_equals_tank_angle_per_wave_moment():
    pump = harmonic_response(SHIP, TANK, FREQUENCIES, pressure_pa=1 / (17.1 / 2 * 17.11))
    wave = harmonic_response(SHIP, TANK, FREQUENCIES, wave_moment_nm=1.0)
    np.testing.assert_allclose(pump.roll_rad, wave.tank_angle_rad, rtol=1e-12)
    np.testing.assert_allclose(pump.roll_phase_rad, wave.tank_phase_rad, rtol=1e-12)


def test_slow_heel_turns_the_tank_as_far_as_the_ship():
    still = harmonic_response(SHIP, TANK, [0.0], wave_moment_nm=1e7)
    np.testing.assert_allclose(still.tank_angle_rad, still.roll_rad, rtol=1e-12)
    assert still.tank_phase_rad == still.roll_phase_rad == 0


def test_matrices_are_symmetric_and_mass_and_stiffness_positive():
    for matrix in coupled_matrices(SHIP, TANK):
        np.testing.assert_array_equal(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix).min() > 0


def test_sampling_keeps_names_and_holds_the_input():
    """Zero-order hold by python-control against integration of the held input."""
    system = coupled_model(SHIP, TANK)
    discrete = system.sample(0.2)
    assert discrete.state_labels == system.state_labels
    assert discrete.input_labels == ["pressure_pa", "wave_moment_nm"]
    held = np.array([3e4, -2e6])
    x0 = np.array([0.05, -0.01, 0.4, 0.1])
    run = solve_ivp(
        lambda t, x: system.A @ x + system.B @ held, (0, 0.2), x0, rtol=1e-12, atol=1e-14
    )
    np.testing.assert_allclose(discrete.A @ x0 + discrete.B @ held, run.y[:, -1], rtol=1e-9)


def test_zero_dynamics_swing_with_g_over_height_plus_depth():
    """Thesis (4.10): with roll held at zero by the pump the water swings at sqrt(g / (H + Lz))."""
    roll_by_pump = coupled_model(SHIP, TANK)[["roll_rad"], ["pressure_pa"]]
    zeros = roll_by_pump.zeros()
    np.testing.assert_allclose(np.abs(zeros), np.sqrt(9.80665 / (4.88 + 1.83)), rtol=1e-6)
    np.testing.assert_allclose(zeros.real, 0, atol=1e-6)


def test_water_in_a_ship_held_still_swings_down_by_its_damping_ratio():
    """Each half swing is exp(-pi zeta / sqrt(1 - zeta^2)) of the one before, to the other side."""
    held = RollShip(1e16, 1e16)  # too heavy for the water to move her
    frequency = np.sqrt(2 * 9.80665 / (2 * 4.88 + 17.1 * 17.11 / 6.22))
    half_s = np.pi / (frequency * np.sqrt(1 - 0.1**2))
    run = simulate(
        RollModel(held, TANK), 3 * half_s, (0.0, 0.0, 0.05, 0.0), step_s=half_s / 500,
        record_every=500,
    )  # fmt: skip
    expected = 0.05 * (-np.exp(-np.pi * 0.1 / np.sqrt(1 - 0.1**2))) ** np.arange(4)
    np.testing.assert_allclose(run.state[:, 2], expected, rtol=1e-3)
