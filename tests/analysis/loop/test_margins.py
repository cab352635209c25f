"""Margins: each is where the loop really turns unstable; printed laws of the thesis."""

import control
import numpy as np
import pytest

from tools.thesis.linear_contest import PRINTED_ARX
from utank_hil.analysis.loop.margins import closed_loop_radius, loop_response, margins
from utank_hil.control import ARX, PredictiveLaw, design_dpc, design_gpc, pump_model
from utank_hil.dynamics import RollShip, Tank
from utank_hil.dynamics.sampling import LinearModel, sample

SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.87e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10)
ROLL = pump_model(SHIP, TANK, ("roll_rad",))


def roll_law():
    plant = sample(ROLL, 0.2, 0.05, 0.1)
    arx = ARX.from_state_space(control.ss(*plant), 8)
    return design_gpc(arx, 50, 50, 1e14)


def proportional(gain, sample_time_s=0.1):
    shape = (1, 1, 1)
    return PredictiveLaw(np.zeros(shape), np.full(shape, -gain), np.zeros(shape), sample_time_s)


INTEGRATOR = LinearModel(np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1)), 0.0)


def test_integrator_under_proportional_control_has_the_textbook_margins():
    # L = -k Ts / (z - 1): stable for 0 < k Ts < 2, phase at crossover 90 deg - w Ts / 2
    k, ts = 2.0, 0.1
    found = margins(proportional(k, ts), INTEGRATOR)
    assert found.radius == pytest.approx(1 - k * ts)
    assert found.gain_low == 0
    assert found.gain_high == pytest.approx(2 / (k * ts), rel=1e-9)
    crossover = 2 / ts * np.arcsin(k * ts / 2)
    assert found.phase_margin_rad == pytest.approx(np.pi / 2 - crossover * ts / 2, rel=1e-4)
    # S = (z - 1) / (z - 1 + k Ts) peaks at z = -1
    assert found.peak_sensitivity == pytest.approx(2 / (2 - k * ts), rel=1e-9)
    assert found.peak_frequency_rad_s == pytest.approx(np.pi / ts)


def test_gain_and_delay_margins_are_where_the_loop_turns_unstable():
    law = roll_law()
    found = margins(law, ROLL, 0.05, 0.1)
    assert found.radius < 1
    plant = sample(ROLL, 0.2, 0.05, 0.1)
    assert closed_loop_radius(law, plant, found.gain_high * 0.999) < 1
    assert closed_loop_radius(law, plant, found.gain_high * 1.001) > 1
    assert closed_loop_radius(law, plant, found.gain_low * 1.001) < 1
    assert closed_loop_radius(law, plant, found.gain_low * 0.999) > 1
    edge = found.delay_margin_s
    assert closed_loop_radius(law, sample(ROLL, 0.2, 0.05 + edge - 2e-4, 0.1)) < 1
    assert closed_loop_radius(law, sample(ROLL, 0.2, 0.05 + edge + 2e-4, 0.1)) > 1


def test_margins_bound_each_other():
    found = margins(roll_law(), ROLL, 0.05, 0.1)
    # textbook: a disk margin a guarantees these gain and phase margins
    assert found.gain_high >= (1 + found.disk_margin / 2) / (1 - found.disk_margin / 2)
    assert found.phase_margin_rad >= 2 * np.arctan(found.disk_margin / 2)
    # and peak sensitivity these
    assert found.gain_high >= found.peak_sensitivity / (found.peak_sensitivity - 1) * 0.999
    assert found.phase_margin_rad >= 2 * np.arcsin(0.5 / found.peak_sensitivity) * 0.999


@pytest.mark.parametrize(("design", "peak"), [(design_dpc, 4.8), (design_gpc, 6.0)])
def test_printed_laws_are_fragile(design, peak):
    law, plant = design(PRINTED_ARX), PRINTED_ARX.matrices()
    fine = np.linspace(1e-3, np.pi / 0.2, 50_000)
    found = np.abs(1 / (1 - loop_response(law, plant, fine))).max()
    assert found == pytest.approx(peak, abs=0.06)
    assert closed_loop_radius(law, plant) < 1
    # one more sample of delay, and it is unstable
    late = ARX(
        np.concatenate([PRINTED_ARX.alpha, np.zeros((1, 1, 1))]),
        np.concatenate([np.zeros((1, 1, 1)), PRINTED_ARX.beta]),
        0.2,
    )
    assert closed_loop_radius(law, late.matrices()) > 1


def test_unstable_loop_has_no_margin():
    found = margins(proportional(30.0), INTEGRATOR)
    assert found.radius == pytest.approx(2.0)
    assert (found.gain_low, found.gain_high, found.phase_margin_rad) == (1, 1, 0)
    assert found.delay_margin_s == found.disk_margin == 0


def test_two_pumps_are_refused():
    two = INTEGRATOR._replace(B=np.ones((1, 2)), D=np.zeros((1, 2)))
    with pytest.raises(ValueError, match="one pump"):
        margins(proportional(1.0), two)
