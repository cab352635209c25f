"""The names that are promised to notebooks of others: imports, arguments, shapes and meaning.

A notebook that was written for an earlier version calls exactly these.
"""

import control
import numpy as np
import pytest

from utank_hil.control import ARX, design_dpc, design_gpc, design_lqr
from utank_hil.dynamics import Tank, tank_wrench
from utank_hil.identification import era, okid
from utank_hil.sea import load_ndbc

SAMPLE_TIME_S = 0.2


@pytest.fixture(scope="module")
def system():
    """A damped oscillator of 12 s with two outputs."""
    a = np.array([[0.0, 1.0], [-((2 * np.pi / 12) ** 2), -0.08]])
    plant = control.ss(a, [[0.0], [1.0]], np.eye(2), np.zeros((2, 1)))
    return plant.sample(SAMPLE_TIME_S)


@pytest.mark.parametrize("design", [design_dpc, design_gpc])
def test_predictive_laws_are_designed_from_an_arx_model_and_step(system, design):
    arx = ARX.from_state_space(system, 6)
    assert (arx.alpha.shape, arx.beta.shape) == ((6, 2, 2), (7, 2, 1))
    again = ARX(arx.alpha, arx.beta, SAMPLE_TIME_S)
    weights = {"output_weight": 1e4, "input_weight": 1.0} if design is design_gpc else {}
    law = design(again, control_horizon=50, prediction_horizon=54, **weights)
    assert (law.input_gains.shape, law.output_gains.shape) == ((6, 1, 1), (6, 1, 2))
    controller = law.controller()
    # u = sum Gu_i u(k-i) + sum Gy_i y(k-i), newest first
    u, y = np.zeros((6, 1)), np.zeros((6, 2))
    rng = np.random.default_rng(0)
    for _ in range(9):
        newest = rng.standard_normal(2)
        y = np.vstack([newest, y[:-1]])
        command = np.atleast_1d(controller.step(newest, np.zeros(2)))
        expected = np.einsum("irs,is->r", law.input_gains, u) + np.einsum(
            "irm,im->r", law.output_gains, y
        )
        np.testing.assert_allclose(command, expected, rtol=1e-9, atol=1e-12)
        u = np.vstack([command, u[:-1]])


def test_lqr_takes_a_state_space_model(system):
    law = design_lqr(system, np.eye(2), np.eye(1))
    expected, _, _ = control.dlqr(system, np.eye(2), np.eye(1))
    np.testing.assert_allclose(law.gain, expected, rtol=1e-9)


def test_okid_gives_an_arx_model_and_pulse_responses_that_era_realizes(system):
    u = np.random.default_rng(1).standard_normal((3000, 1))
    y = control.forced_response(system, inputs=u.T).outputs.T
    result = okid(
        u[:-1], y[1:], order=10, sample_time_s=SAMPLE_TIME_S, disturbance_frequencies_rad_s=()
    )
    assert result.arx.alpha.shape == (10, 2, 2)
    assert result.observer_gain.shape == (len(result.markov) - 1, 2, 2)
    realized = era(result.markov, order=2, sample_time_s=SAMPLE_TIME_S)
    assert realized.dt == SAMPLE_TIME_S
    np.testing.assert_allclose(
        np.sort_complex(realized.poles()), np.sort_complex(system.poles()), atol=1e-8
    )
    np.testing.assert_allclose(result.markov[0], system.C @ system.B, atol=1e-8)


def test_wrench_of_water_at_rest_is_its_weight_and_its_residual_gravity_along_the_duct():
    tank = Tank(
        width_m=17.1,
        height_m=4.88,
        reservoir_area_m2=17.11,
        duct_area_m2=6.22,
        lx_m=0.0,
        lz_m=1.83,
    )
    rest, roll = np.zeros(3), 0.1
    force, moment, residual = tank_wrench(tank, 0.3, 0.0, 0.0, rest, rest, rest, rest, roll, 0.0)
    assert (force.shape, moment.shape, residual.shape) == ((3,), (3,), ())
    weight_n = 1000.0 * 9.81 * (2 * 17.11 * 4.88 + 6.22 * 17.1)
    assert np.linalg.norm(force) == pytest.approx(weight_n, rel=1e-3)
    # from the port to the starboard surface: 17.1 m to starboard, 0.6 m up
    along = -9.81 * (17.1 * np.sin(roll) - 0.6 * np.cos(roll))
    assert float(residual) == pytest.approx(along, rel=1e-3)


def test_spectra_of_a_buoy_have_time_frequency_density_height_and_period(tmp_path):
    path = tmp_path / "44025w2024.txt"
    path.write_text(
        "#YY  MM DD hh mm   .0500  .1000  .1500  .2000\n"
        "2024 01 01 00 00    0.00   8.00   2.00   0.50\n"
    )
    spectra = load_ndbc(path)
    assert len(spectra.time) == len(spectra.density) == len(spectra.hs_m) == len(spectra.tp_s) == 1
    assert spectra.frequency_hz.tolist() == pytest.approx([0.05, 0.1, 0.15, 0.2])
    assert spectra.density.shape == (len(spectra.time), len(spectra.frequency_hz))
    assert spectra.tp_s[0] == pytest.approx(10.0)
