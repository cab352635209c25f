"""What the figures are computed with, against independent computations."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tools.thesis import pump_power
from tools.thesis.adaptive_figures import OWN_WAVE, _pair, dpc_both
from tools.thesis.capsize import PATTI_B, WAVE_RAD_S
from tools.thesis.damping import START_RAD, _damping
from tools.thesis.fuzzy_parameters import _settled_s
from tools.thesis.linear_contest import PASSIVE, entrants, regular_wave_run, responses
from tools.thesis.loading_change import changed, voyage
from tools.thesis.ships import GREATER
from utank_hil.control.optimal_tank import ship_ratios


def amplitude(record, step_s, wave_rad_s):
    """First harmonic over the last whole wave periods."""
    period = 2 * np.pi / wave_rad_s
    count = round(3 * period / step_s)
    turn = np.exp(-1j * wave_rad_s * step_s * np.arange(count))
    return float(abs(record[-count:] @ turn) * 2 / count)


@pytest.mark.parametrize("name", [PASSIVE, "PD", "LQR", "GPC (roll)", "DPC (roll, level)"])
def test_a_long_run_in_a_regular_wave_has_the_amplitude_of_sampled_data_theory(name):
    ship, tank = GREATER
    law = entrants(ship, tank).get(name)
    w = 0.6
    run = regular_wave_run(ship, tank, law, 0.02 * ship.stiffness_nm_rad, w, 400.0)
    laws = {} if law is None else {name: law}
    exact = responses(ship, tank, laws, np.array([w / ship_ratios(ship, tank)[1]]))[name]
    assert amplitude(run.roll_rad, 0.02, w) == pytest.approx(0.02 * exact.roll[0], rel=2e-3)
    assert amplitude(run.pressure_pa, 0.02, w) == pytest.approx(
        0.02 * exact.pressure_pa[0], rel=2e-3, abs=1e-9
    )


def test_the_retuned_law_s_run_has_the_amplitude_of_the_law_for_the_true_ship():
    ship, tank = GREATER
    adaptation = dpc_both(50)
    found = voyage(ship, tank, adaptation, OWN_WAVE)
    w = OWN_WAVE.frequency_rad_s
    new = _pair(ship, tank, adaptation, adaptation)[1]
    ratio = np.array([w / ship_ratios(changed(ship), tank)[1]])
    exact = responses(changed(ship), tank, {"new": new}, ratio)["new"].roll[0]
    assert found.after_rad == pytest.approx(OWN_WAVE.slope_rad * exact, rel=0.01)


def test_a_tuned_pump_works_against_friction_alone():
    ship, tank = pump_power.first_ship(4.87e7, 0.1)
    tuned = pump_power.tuned_tank(ship, tank)
    _, _, pump_nm = pump_power._per_angle(ship, tuned)
    loss = tuned.loss_pa_per_m_s * tuned.reservoir_area_m2 * (tuned.width_m / 2) ** 2
    assert pump_nm == pytest.approx(loss * 0.5, rel=1e-12)
    faster = replace(tuned, duct_area_m2=2 * tuned.duct_area_m2)
    assert pump_power._per_angle(ship, faster)[2] > 2 * pump_nm


@pytest.mark.parametrize("ratio", [0.01, 0.03])
def test_damping_of_a_linear_decay_is_its_own(ratio):
    w = PATTI_B.ship.natural_frequency_rad_s
    time = np.arange(0.0, 600.0, 0.02)
    roll = math.degrees(START_RAD) * np.exp(-ratio * w * time) * np.cos(w * time)
    assert _damping(time, roll) == pytest.approx(ratio, rel=0.1)  # peaks come twice a cycle


def test_an_exponential_settles_when_its_wave_mean_does():
    time = np.arange(0.0, 200.0, 0.02)
    constant = 20.0
    settled = _settled_s(time, 1 - np.exp(-time / constant))
    # the mean over a wave lags by half a period
    assert settled == pytest.approx(
        constant * math.log(10) + math.pi / WAVE_RAD_S, abs=0.1 * constant
    )
