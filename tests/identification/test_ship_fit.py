from dataclasses import replace

import numpy as np
import pytest
from roll_plant import INERTIA_KG_M2, SAMPLE_TIME_S, SLOW_PUMP, TANK, jonswap_moment, noisy, pulses

from utank_hil.arrays import FloatArray
from utank_hil.control import pump_model
from utank_hil.dynamics import RollShip, Tank
from utank_hil.dynamics.linear import coupled_model
from utank_hil.dynamics.sampling import sample
from utank_hil.identification import okid
from utank_hil.identification.ship_fit import ShipFit, fit_ship

CONFIGURED = RollShip(INERTIA_KG_M2, INERTIA_KG_M2 * 0.25, 4.8e7)
MEASURED = ("roll_rad", "level_m")
DELAY_S, LAG_S = 0.05, 0.1


def ship_of(period_s: float, inertia: float = 1.0, damping: float = 1.0) -> RollShip:
    inertia_kg_m2 = inertia * CONFIGURED.inertia_kg_m2
    return RollShip(
        inertia_kg_m2,
        inertia_kg_m2 * (2 * np.pi / period_s) ** 2,
        damping * CONFIGURED.damping_nms_rad,
    )


def respond(ship: RollShip, tank: Tank, u: FloatArray, moment_nm: FloatArray) -> FloatArray:
    """Roll and level: the pump through delay and lag, the wave straight from its samples."""
    pump = sample(pump_model(ship, tank, MEASURED), SAMPLE_TIME_S, DELAY_S, LAG_S)
    whole = coupled_model(ship, tank)[list(MEASURED), ["wave_moment_nm"]]
    wave = sample(whole, SAMPLE_TIME_S, 0.0, 0.0)
    y = np.empty((len(u), 2))
    for plant, inputs, first in ((pump, u, True), (wave, moment_nm, False)):
        state = np.zeros(len(plant.A))
        for k, value in enumerate(inputs):
            output = plant.C @ state + plant.D[:, 0] * value
            y[k] = output if first else y[k] + output
            state = plant.A @ state + plant.B[:, 0] * value
    return y


def fitted(u: FloatArray, y: FloatArray, outputs: int, order: int, tank: Tank = TANK) -> ShipFit:
    result = okid(u, y[:, :outputs], order, disturbance_polynomial_degree=0)
    return fit_ship(result, u, CONFIGURED, tank, MEASURED[:outputs], DELAY_S, LAG_S)


def period_s(fit: ShipFit) -> float:
    return 2 * np.pi / fit.ship.natural_frequency_rad_s


@pytest.mark.parametrize(("outputs", "order"), [(2, 30), (1, 60)])
def test_without_waves_every_number_of_ship_and_tank_comes_back(outputs: int, order: int) -> None:
    u = pulses(1, SLOW_PUMP)
    ship, tank = ship_of(8.5, 1.1, 1.4), replace(TANK, damping_ratio=0.12)
    y = noisy(respond(ship, tank, u, np.zeros(len(u))), 1e-3, 2)
    fit = fitted(u, y, outputs, order)
    assert fit.ship.inertia_kg_m2 == pytest.approx(ship.inertia_kg_m2, rel=0.02)
    assert period_s(fit) == pytest.approx(8.5, rel=2e-3)
    assert fit.ship.damping_nms_rad == pytest.approx(ship.damping_nms_rad, rel=0.1)
    assert fit.tank.damping_ratio == pytest.approx(0.12, rel=0.02)


@pytest.mark.parametrize(("true_s", "inertia"), [(14.7, 1.1), (12.6, 1.0), (10.1, 0.9)])
@pytest.mark.parametrize(("outputs", "order"), [(2, 120), (1, 200)])
def test_in_a_storm_the_roll_period_is_found_within_a_tenth(
    true_s: float, inertia: float, outputs: int, order: int
) -> None:
    u = pulses(3, SLOW_PUMP)
    y = respond(ship_of(true_s, inertia), TANK, u, jonswap_moment(len(u), 5, 2.5e7))
    fit = fitted(u, noisy(y, 5e-3, 6), outputs, order)
    assert period_s(fit) == pytest.approx(true_s, rel=0.1)
    assert abs(period_s(fit) / true_s - 1) < max(0.02, 5 * fit.period_deviation)


def test_stated_deviation_of_the_period_is_the_scatter_over_seas() -> None:
    errors, stated = [], []
    for seed in range(8):
        u = pulses(seed, SLOW_PUMP)
        y = respond(ship_of(12.6), TANK, u, jonswap_moment(len(u), 50 + seed, 2.5e7))
        fit = fitted(u, noisy(y, 5e-3, seed), 1, 120)
        errors.append(period_s(fit) / 12.6 - 1)
        stated.append(fit.period_deviation)
    scatter = float(np.sqrt(np.mean(np.square(errors))))
    assert scatter / 4 < float(np.mean(stated)) < scatter * 4


def test_what_the_record_does_not_show_stays_as_configured() -> None:
    u = pulses(1, SLOW_PUMP) * 1e-4  # pulses that drown in the waves
    y = respond(ship_of(8.5), TANK, u, jonswap_moment(len(u), 5, 2.5e7))
    fit = fitted(u, noisy(y, 0.05, 2), 1, 40)
    assert fit.ship.inertia_kg_m2 == pytest.approx(CONFIGURED.inertia_kg_m2, rel=0.1)
    assert fit.period_deviation > 0.1


def test_outputs_that_do_not_fit_the_model_are_refused() -> None:
    u = pulses(1, SLOW_PUMP)
    y = respond(CONFIGURED, TANK, u, np.zeros(len(u)))
    result = okid(u, noisy(y, 1e-3, 2), 10)
    with pytest.raises(ValueError, match="outputs"):
        fit_ship(result, u, CONFIGURED, TANK, ("roll_rad",))
