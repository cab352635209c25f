"""From ship, tank and sea to a law: the model in it, the parameters, the refusals."""

import numpy as np
import pytest

from utank_hil.control import (
    ARX,
    DesignPlant,
    PredictiveDesign,
    PredictiveLaw,
    Predictor,
    WashoutLaw,
    wave_arx,
)
from utank_hil.dynamics import RollShip, Tank, coupled_model
from utank_hil.dynamics.sampling import noise_covariance, sampled_model

SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.87e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10)
PREDICTOR = Predictor(("roll_rad", "level_m"), (2e-3, 0.05), 30, 0.62, 0.1, 0.05, 1000.0)


def test_predictor_knows_what_the_pump_does_exactly():
    # commands on still water, from rest: the ARX prediction is the sampled plant's response
    plant = sampled_model(
        coupled_model(SHIP, TANK)[["roll_rad", "level_m"], ["pressure_pa"]], 0.2, 0.05, 0.1
    )
    arx = wave_arx(PREDICTOR, DesignPlant(SHIP, TANK))
    u = 1e4 * np.random.default_rng(0).normal(size=(25, 1))
    x, y = np.zeros(plant.nstates), []
    for sample in u:
        y.append(plant.C @ x + plant.D @ sample)
        x = plant.A @ x + plant.B @ sample
    y = np.array(y)
    np.testing.assert_allclose(arx.predict(u, y), y, atol=1e-9 * np.abs(y).max())


def test_noise_covariance_is_the_integral_of_the_noise_response():
    a = np.array([[0.0, 1.0], [-0.4, -0.1]])
    noise = np.array([[0.0, 0.3], [1.0, 0.0]])
    times = np.linspace(0, 0.2, 2001)
    eigenvalues, vectors = np.linalg.eig(a)
    inverse = np.linalg.inv(vectors)
    responses = [(vectors * np.exp(eigenvalues * t)) @ inverse @ noise for t in times]
    integrand = np.array([(response @ response.T).real for response in responses])
    expected = np.trapezoid(integrand, times, axis=0)
    np.testing.assert_allclose(noise_covariance(a, noise, 0.2), expected, rtol=1e-6, atol=1e-12)


def test_predictor_errs_less_in_its_sea_than_one_that_knows_no_waves():
    wp, zeta, step_s = 0.62, 0.1, 0.02
    system = coupled_model(SHIP, TANK)
    a = np.zeros((6, 6))
    a[:4, :4] = system.A
    a[:4, 4] = system.B[:, 1] * SHIP.stiffness_nm_rad * 0.05
    a[4:, 4:] = [[0.0, 1.0], [-(wp**2), -2 * zeta * wp]]
    noise = np.random.default_rng(1).normal(size=60_000) * np.sqrt(4 * zeta * wp**3 * step_s)
    advance, x, y = np.linalg.matrix_power(np.eye(6) + a * step_s / 64, 64), np.zeros(6), []
    for k, kick in enumerate(noise):
        if k % 10 == 0:
            y.append([x[0], x[2]])
        x = advance @ x
        x[5] += kick
    y = np.array(y)
    exact = Predictor(("roll_rad", "level_m"), (1e-5, 1e-4), 30, wp, zeta, 0.05, 0.0)
    plant = sampled_model(system[["roll_rad", "level_m"], ["pressure_pa"]], 0.2, 0.05, 0.1)
    still = ARX.from_state_space(plant, 5)
    u = np.zeros((len(y), 1))
    knowing, unknowing = (
        np.sqrt(np.mean((arx.predict(u, y) - y)[100:, 0] ** 2))
        for arx in (wave_arx(exact, DesignPlant(SHIP, TANK)), still)
    )
    assert knowing < 0.2 * unknowing


def test_washout_and_kind_of_law():
    gpc = PredictiveDesign("gpc", PREDICTOR, 20, 30, output_weight=(1e12, 0.0))
    assert isinstance(gpc.law(DesignPlant(SHIP, TANK)), PredictiveLaw)
    washed = PredictiveDesign("gpc", PREDICTOR, 20, 30, (1e12, 0.0), washout_rad_s=0.02)
    assert isinstance(washed.law(DesignPlant(SHIP, TANK)), WashoutLaw)
    # a relaxed deadbeat law weighs only its window
    dpc = PredictiveDesign("dpc", PREDICTOR, 20, 30, output_weight=(1e12, 0.0)).law(
        DesignPlant(SHIP, TANK)
    )
    same = PredictiveDesign("gpc", PREDICTOR, 20, 30, (1e12, 0.0), first_output=20)
    np.testing.assert_allclose(dpc.output_gains, same.law(DesignPlant(SHIP, TANK)).output_gains)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"measured": ("yaw_rad", "level_m")}, "measured must name outputs"),
        ({"measured": ()}, "measured must name outputs"),
        ({"measurement_std": (1e-3,)}, "one value per measured output"),
        ({"measurement_std": (1e-3, 0.0)}, r"measurement_std\.1 must be positive"),
        ({"order": 0}, "order must be 1 to 500"),
        ({"wave_damping_ratio": -0.1}, "wave_damping_ratio"),
        ({"pressure_noise_pa_rt_s": -1.0}, "pressure_noise_pa_rt_s"),
    ],
)
def test_bad_predictor_parameters_are_refused_by_name(change, message):
    values = {
        "measured": ("roll_rad", "level_m"),
        "measurement_std": (2e-3, 0.05),
        "order": 30,
        "wave_peak_rad_s": 0.62,
        "wave_damping_ratio": 0.1,
        "wave_slope_rad": 0.05,
        "pressure_noise_pa_rt_s": 1000.0,
    }
    with pytest.raises(ValueError, match=message):
        Predictor(**{**values, **change})


def test_bad_designs_are_refused():
    with pytest.raises(ValueError, match="gpc or dpc"):
        PredictiveDesign("lqr", PREDICTOR, 20, 30)
    with pytest.raises(ValueError, match="first_output belongs to GPC"):
        PredictiveDesign("dpc", PREDICTOR, 20, 30, first_output=5)
    with pytest.raises(ValueError, match="GPC needs an output_weight"):
        PredictiveDesign("gpc", PREDICTOR, 20, 30).law(DesignPlant(SHIP, TANK))
