"""Exact sampled-data response, against time simulation of the very same loop."""

import numpy as np
import pytest
from scipy.linalg import expm

from utank_hil.analysis.loop.margins import closed_loop_radius, closed_loop_response
from utank_hil.control import ARX, DesignPlant, PredictiveLaw, design_gpc, pump_model
from utank_hil.dynamics import RollShip, Tank, coupled_model, sampled_model
from utank_hil.dynamics.sampling import sample

SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.87e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10)
MEASURED = ("roll_rad", "level_m")
TS, DELAY_S, LAG_S = 0.2, 0.05, 0.1
# any stable law will do: level rate fed back with some memory
LAW = PredictiveLaw(
    np.array([0.4, -0.1]).reshape(2, 1, 1),
    np.array([[[1e5, -6e4]], [[-2e5, 5e4]]]),
    np.zeros((1, 1, 2)),
    TS,
)


def simulate(wave_rad_s, duration_s, step_s=0.01):
    """State (roll, roll rate, level, level rate, pressure) every step; exact between steps.

    The wave is an oscillator of the model itself, so its effect is exact too.
    """
    model = coupled_model(SHIP, TANK)
    chain = np.zeros((8, 8))  # plant, actuator, command, wave sine and cosine
    chain[:4, :4], chain[:4, 4], chain[:4, 6] = model.A, model.B[:, 0], model.B[:, 1]
    chain[4, 4], chain[4, 5] = -1 / LAG_S, 1 / LAG_S
    chain[6, 7], chain[7, 6] = wave_rad_s, -wave_rad_s
    advance = expm(chain * step_s)
    state = np.zeros(8)
    state[7] = 1e6  # wave moment 1e6 sin(w t)
    controller = LAW.controller()
    late, command, rows = round(DELAY_S / step_s), 0.0, []
    for k in range(round(duration_s / step_s)):
        if k % 20 == 0:
            command = controller.step(state[[0, 2]])[0]
        if k % 20 == late:
            state[5] = command
        rows.append(state[:5].copy())
        state = advance @ state
    return np.array(rows)


@pytest.mark.slow
@pytest.mark.parametrize("samples_a_period", [40, 90])
def test_response_equals_time_simulation(samples_a_period):
    period_s = samples_a_period * TS
    w = 2 * np.pi / period_s
    record = simulate(w, round(1200 / period_s) * period_s)  # transients fall to 1e-10
    last = record[-round(period_s / 0.01) :]
    k = np.arange(len(last)) + len(record) - len(last)
    component = 2 * np.mean(last * np.exp(-1j * w * 0.01 * k)[:, None], axis=0) / (-1j * 1e6)
    plant = DesignPlant(SHIP, TANK, DELAY_S, LAG_S)
    motions, pressure = closed_loop_response(LAW, plant, MEASURED, np.array([w]))
    expected = np.append(motions[0], pressure[0])
    # the sum over a period stands for its integral; pressure has corners at the commands
    np.testing.assert_allclose(component, expected, rtol=1e-3)
    np.testing.assert_allclose(component[[0, 2]], expected[[0, 2]], rtol=2e-5)


def test_radius_is_the_decay_of_the_simulated_loop():
    plant = sample(pump_model(SHIP, TANK, MEASURED), TS, DELAY_S, LAG_S)
    radius = closed_loop_radius(LAW, plant)
    assert radius < 1
    controller, x, u, sizes = LAW.controller(), np.ones(5), np.zeros(1), []
    for _ in range(3000):
        y = plant.C @ x + plant.D @ u
        x = plant.A @ x + plant.B @ u
        u = controller.step(y)
        sizes.append(abs(y[0]))
    fall = max(sizes[2900:]) / max(sizes[1900:2000])
    assert fall == pytest.approx(radius**1000, rel=0.1)


def test_passive_response_is_the_open_loop():
    system = coupled_model(SHIP, TANK)
    w = np.array([0.3, 0.6])
    motions, pressure = closed_loop_response(None, DesignPlant(SHIP, TANK), MEASURED, w)
    np.testing.assert_allclose(motions, system(1j * w)[:, 1].T, rtol=1e-12)
    assert not pressure.any()


def test_frequency_above_half_the_sampling_frequency_is_refused():
    with pytest.raises(ValueError, match="frequencies must lie in"):
        closed_loop_response(LAW, DesignPlant(SHIP, TANK), MEASURED, np.array([16.0]))


def test_model_without_python_control_is_the_coupled_model():
    system = coupled_model(SHIP, TANK)[list(MEASURED), ["pressure_pa"]]
    model = pump_model(SHIP, TANK, MEASURED)
    for mine, theirs in zip(model[:4], (system.A, system.B, system.C, system.D), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-12)


def test_a_gpc_law_on_the_sampled_plant_quiets_the_ship_it_was_made_for():
    ship = RollShip(inertia_kg_m2=1.9275e9, stiffness_nm_rad=4.81875e8, damping_nms_rad=4.81875e7)
    tank = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.1)
    system = coupled_model(ship, tank)[["roll_rad"], ["pressure_pa"]]
    plant = sampled_model(system, sample_time_s=0.2, delay_s=0.05, lag_s=0.1)
    arx = ARX.from_state_space(plant, order=6)
    law = design_gpc(arx, control_horizon=50, prediction_horizon=50)
    assert closed_loop_radius(law, plant) == pytest.approx(0.976, abs=1e-3)
    controller, x = law.controller(), np.zeros(plant.nstates)
    x[0] = 0.05
    y = plant.C @ x
    for _ in range(600):
        command = controller.step(y)
        y = plant.C @ x + plant.D @ command
        x = plant.A @ x + plant.B @ command
    assert abs(y[0]) < 1e-3 * 0.05
