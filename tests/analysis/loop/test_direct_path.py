"""Laws with a direct path D: radius and margins against python-control and against stepping."""

from dataclasses import dataclass

import control
import numpy as np
import pytest
from shipped_designs import DPC_ROLL_LEVEL, GPC_ROLL, LQG_ROLL_RATE_LEVEL

from utank_hil.analysis.loop.margins import (
    closed_loop_eigenvalues,
    closed_loop_radius,
    margins,
    robustness,
)
from utank_hil.control import DesignPlant, WashoutLaw, design_pd
from utank_hil.control.gain import GainLaw
from utank_hil.control.state_space import StateSpaceLaw
from utank_hil.dynamics import RollShip, Tank
from utank_hil.dynamics.linear import pump_model
from utank_hil.dynamics.sampling import LinearModel, sample, state_space_response

SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.87e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10)
RATE = ("roll_rate_rad_s",)
DELAY_S, LAG_S = 0.05, 0.1


@dataclass
class MatrixLaw:
    """A law by its matrices in the loop's count: D answers y(k) with v(k)."""

    model: LinearModel

    @property
    def sample_time_s(self):
        return self.model.dt

    def response(self, z):
        return state_space_response(self.model, z)

    def matrices(self):
        return self.model


def lead_lag(gain, zero=0.9, pole=0.3, sample_time_s=0.1):
    """Gain (1 - zero / z) / (1 - pole / z), its D the gain."""
    model = LinearModel(
        np.array([[pole]]), np.ones((1, 1)), gain * np.array([[pole - zero]]),
        np.array([[gain]]), sample_time_s,
    )  # fmt: skip
    return StateSpaceLaw(model)


def static(gain, sample_time_s=0.1):
    none = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
    return StateSpaceLaw(LinearModel(*none, np.array([[gain]]), sample_time_s))


def growth(law, plant):
    """Factor a sample that the stepped loop ends in."""
    controller = law.controller()
    # small: laws take no measurement that grew beyond all sensors
    x, u, logarithm = np.full(len(plant.A), 1e-12), np.zeros(1), []
    for _ in range(8000):
        y = plant.C @ x + plant.D @ u
        x = plant.A @ x + plant.B @ u
        u = controller.step(y)
        size = max(np.abs(x).max(), 1e-200)
        logarithm.append(np.log(size))
    # peaks of the swing, far apart
    return np.exp((max(logarithm[7000:]) - max(logarithm[3000:4000])) / 4000)


@pytest.mark.parametrize(
    "law",
    [lead_lag(-1e6), lead_lag(3e6), static(-1e5), static(1e6)],
    ids=["lead", "lead, wrong sign", "gain", "gain, wrong sign"],
)
def test_radius_is_the_growth_of_the_stepped_loop(law):
    plant = sample(pump_model(SHIP, TANK, RATE), 0.1, DELAY_S, LAG_S)
    assert plant.D.any()  # a delay below the sample time
    assert closed_loop_radius(law, plant) == pytest.approx(growth(law, plant), abs=2e-5)


def test_a_direct_path_that_destabilizes_is_judged_unstable():
    lag = lead_lag(-3e5).model
    without, with_path = (
        StateSpaceLaw(lag._replace(D=np.array([[direct]]))) for direct in (0.0, 1e6)
    )
    system = pump_model(SHIP, TANK, RATE)
    plant = sample(system, 0.1, DELAY_S, LAG_S)
    assert growth(without, plant) < 1 < growth(with_path, plant)
    assert margins(without, system, DELAY_S, LAG_S).radius < 1
    assert margins(with_path, system, DELAY_S, LAG_S).radius > 1
    assert robustness(without, DesignPlant(SHIP, TANK), RATE).nominal.radius < 1
    assert (
        "unstable on its own ship"
        in robustness(with_path, DesignPlant(SHIP, TANK), RATE).failures()[0]
    )
    # the same matrices in the loop's count
    assert closed_loop_radius(MatrixLaw(without.model), plant) < 1
    assert closed_loop_radius(MatrixLaw(with_path.model), plant) > 1


@pytest.mark.parametrize("direct", [0.0, -0.4, 0.3])
def test_eigenvalues_with_both_direct_paths_are_those_of_python_control(direct):
    rng = np.random.default_rng(3)
    plant = LinearModel(
        0.4 * rng.normal(size=(4, 4)), rng.normal(size=(4, 1)), rng.normal(size=(2, 4)),
        rng.normal(size=(2, 1)), 0.1,
    )  # fmt: skip
    law = MatrixLaw(
        LinearModel(
            0.4 * rng.normal(size=(3, 3)), rng.normal(size=(3, 2)), rng.normal(size=(1, 3)),
            direct * rng.normal(size=(1, 2)), 0.1,
        )
    )  # fmt: skip
    closed = control.feedback(control.ss(*plant), control.ss(*law.model), sign=1)
    found = np.sort_complex(closed_loop_eigenvalues(law, plant))
    np.testing.assert_allclose(found, np.sort_complex(closed.poles()), rtol=1e-9)
    halved = control.feedback(0.5 * control.ss(*plant), control.ss(*law.model), sign=1)
    found = np.sort_complex(closed_loop_eigenvalues(law, plant, 0.5))
    np.testing.assert_allclose(found, np.sort_complex(halved.poles()), rtol=1e-9)


@pytest.mark.evidence("gain", "lead, in the loop's count")
@pytest.mark.slow
@pytest.mark.parametrize(
    "law",
    [lead_lag(-2.5e6), static(-3e5), MatrixLaw(lead_lag(-2.5e6).model)],
    ids=["lead", "gain", "lead, in the loop's count"],
)
def test_margins_are_those_of_python_control_and_where_the_loop_turns_unstable(law):
    system = pump_model(SHIP, TANK, RATE)
    found = margins(law, system, DELAY_S, LAG_S)
    plant = sample(system, 0.1, DELAY_S, LAG_S)
    assert found.radius < 1
    open_loop = -control.ss(*law.matrices()) * control.ss(*plant)
    # of its own grid, which rounding moves, the gain is right to 1e-3 only
    response = control.frd(open_loop, np.geomspace(1e-2, 31.4, 20000))
    gain, phase_deg, distance, *_ = control.stability_margins(response)
    assert found.gain_high == pytest.approx(gain, rel=1e-3)
    assert found.phase_margin_rad == pytest.approx(np.radians(phase_deg), rel=1e-2)
    assert found.peak_sensitivity == pytest.approx(1 / distance, rel=1e-3)
    assert closed_loop_radius(law, plant, found.gain_high * 0.999) < 1
    assert closed_loop_radius(law, plant, found.gain_high * 1.001) > 1

    def late(extra_s):
        return closed_loop_radius(law, sample(system, 0.1, DELAY_S + extra_s, LAG_S))

    sound_s = min(found.delay_margin_s - 0.01, 2.5)
    assert max(map(late, [*np.arange(0, sound_s, 0.05), sound_s])) < 1
    assert found.delay_margin_s == np.inf or late(found.delay_margin_s + 0.01) >= 1


def test_direct_paths_that_leave_the_command_undetermined_are_an_error():
    plant = sample(pump_model(SHIP, TANK, RATE), 0.1, DELAY_S, LAG_S)
    law = MatrixLaw(static(1 / plant.D[0, 0]).model)
    with pytest.raises(ValueError, match="ill-posed"):
        closed_loop_radius(law, plant)
    assert closed_loop_radius(law, plant, 0.5) > 0


@pytest.mark.parametrize(
    "design", [None, GPC_ROLL, DPC_ROLL_LEVEL, LQG_ROLL_RATE_LEVEL], ids=["pd", "gpc", "dpc", "lqg"]
)
def test_laws_without_a_direct_path_have_the_eigenvalues_of_the_plain_form_bit_for_bit(design):
    law, measured = design_pd(SHIP, TANK), ("level_m", "level_rate_m_s")
    if design is not None:
        law, measured = design.law(DesignPlant(SHIP, TANK)), design.predictor.measured
    plant = sample(pump_model(SHIP, TANK, measured), law.sample_time_s, DELAY_S, LAG_S)
    own = law.matrices()
    plain = np.block(
        [[plant.A, plant.B @ own.C], [own.B @ plant.C, own.A + own.B @ plant.D @ own.C]]
    )
    np.testing.assert_array_equal(closed_loop_eigenvalues(law, plant), np.linalg.eigvals(plain))


def test_a_gain_by_its_matrices_is_the_gain_law():
    plant = sample(pump_model(SHIP, TANK, RATE), 0.1, DELAY_S, LAG_S)
    gain = GainLaw(np.array([[-1e6]]), 0.1)
    assert closed_loop_radius(static(1e6), plant) == pytest.approx(
        closed_loop_radius(gain, plant), rel=1e-12
    )


def test_a_washout_keeps_its_laws_direct_path():
    washed = WashoutLaw(MatrixLaw(lead_lag(2.0).model), 0.5)
    z = np.exp(1j * np.array([0.01, 0.4, 3.0]))
    np.testing.assert_allclose(
        state_space_response(washed.matrices(), z), washed.response(z), rtol=1e-12
    )
