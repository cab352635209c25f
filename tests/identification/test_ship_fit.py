import math
from dataclasses import replace

import numpy as np
import pytest
from roll_plant import INERTIA_KG_M2, SAMPLE_TIME_S, SLOW_PUMP, TANK, jonswap_moment, noisy, pulses

from utank_hil.control import DesignPlant, pump_model
from utank_hil.dynamics import RollShip
from utank_hil.dynamics.linear import coupled_model
from utank_hil.dynamics.sampling import sample
from utank_hil.identification import find_disturbance_frequencies, okid
from utank_hil.identification.ship_fit import fit_ship

CONFIGURED = RollShip(INERTIA_KG_M2, INERTIA_KG_M2 * 0.25, 4.8e7)
MEASURED = ("roll_rad", "level_m")
DELAY_S, LAG_S = 0.05, 0.1
NUMBERS = ("inertia_kg_m2", "stiffness_nm_rad", "damping_nms_rad")


def ship_of(period_s, inertia=1.0, damping=1.0):
    inertia_kg_m2 = inertia * CONFIGURED.inertia_kg_m2
    return RollShip(
        inertia_kg_m2,
        inertia_kg_m2 * (2 * np.pi / period_s) ** 2,
        damping * CONFIGURED.damping_nms_rad,
    )


def respond(ship, tank, u, moment_nm):
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


def fitted(u, y, outputs, order, tank=TANK):
    result = okid(
        u, y[:, :outputs], order, disturbance_polynomial_degree=0, sample_time_s=SAMPLE_TIME_S
    )
    return fit_ship(result, u, DesignPlant(CONFIGURED, tank, DELAY_S, LAG_S), MEASURED[:outputs])


def period_s(fit):
    return 2 * np.pi / fit.ship.natural_frequency_rad_s


@pytest.mark.parametrize(("outputs", "order"), [(2, 30), (1, 60)])
def test_without_waves_every_number_of_ship_and_tank_comes_back(outputs, order):
    u = pulses(1, SLOW_PUMP)
    ship, tank = ship_of(8.5, 1.1, 1.4), replace(TANK, damping_ratio=0.12)
    y = noisy(respond(ship, tank, u, np.zeros(len(u))), 1e-3, 2)
    fit = fitted(u, y, outputs, order)
    assert fit.ship.inertia_kg_m2 == pytest.approx(ship.inertia_kg_m2, rel=0.02)
    assert period_s(fit) == pytest.approx(8.5, rel=2e-3)
    assert fit.ship.damping_nms_rad == pytest.approx(ship.damping_nms_rad, rel=0.1)
    assert fit.tank.damping_ratio == pytest.approx(0.12, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(("true_s", "inertia"), [(14.7, 1.1), (12.6, 1.0), (10.1, 0.9)])
@pytest.mark.parametrize(("outputs", "order"), [(2, 120), (1, 200)])
def test_in_a_storm_the_roll_period_is_found_within_a_tenth(true_s, inertia, outputs, order):
    u = pulses(3, SLOW_PUMP)
    y = respond(ship_of(true_s, inertia), TANK, u, jonswap_moment(len(u), 5, 2.5e7))
    fit = fitted(u, noisy(y, 5e-3, 6), outputs, order)
    assert period_s(fit) == pytest.approx(true_s, rel=0.1)
    assert abs(math.log(period_s(fit) / true_s)) < 3 * fit.period_deviation


@pytest.mark.evidence
@pytest.mark.parametrize(("outputs", "order"), [(1, 120), (2, 120)])
def test_stated_deviations_are_the_errors_over_seas(outputs, order):
    errors = []  # of inertia, stiffness, both dampings and period, each over its deviation
    for seed in range(1, 21):
        u, ship = pulses(seed, SLOW_PUMP), ship_of(12.6)
        y = respond(ship, TANK, u, jonswap_moment(len(u), 50 + seed, 2.5e7))
        u, y = u[:2000], noisy(y, 5e-3, seed)[:2000, :outputs]  # as the retuner does
        waves = find_disturbance_frequencies(u, y, sample_time_s=SAMPLE_TIME_S)
        found = okid(
            u,
            y,
            order,
            sample_time_s=SAMPLE_TIME_S,
            disturbance_frequencies_rad_s=waves,
            disturbance_polynomial_degree=0,
        )
        fit = fit_ship(found, u, DesignPlant(CONFIGURED, TANK, DELAY_S, LAG_S), MEASURED[:outputs])
        ratios = [getattr(fit.ship, name) / getattr(ship, name) for name in NUMBERS]
        ratios += [fit.tank.damping_ratio / TANK.damping_ratio, period_s(fit) / 12.6]
        errors.append(np.log(ratios) / [*fit.deviation, fit.period_deviation])
    # of 20 at 95 %, 16 or fewer come by chance once in sixty times, each number by itself
    assert (np.sum(np.abs(errors) < 1.96, axis=0) >= 16).all()
    # and not so wide that they hold anything: twenty squares about one
    root = np.sqrt(np.mean(np.square(errors), axis=0))
    assert 0.5 < root[0] < 1.5  # inertia and period are what the record tells, not the prior
    assert 0.5 < root[4] < 1.5


@pytest.mark.parametrize(("outputs", "order"), [(2, 120), (1, 120)])
def test_way_that_is_not_quite_as_configured_is_not_laid_to_the_ship(outputs, order):
    # a gauge 25 ms and a motion sensor 10 ms sooner than 50 and 100 ms have it, as on the bus
    ship, u = ship_of(7.5), pulses(1, SLOW_PUMP)
    y = np.empty((len(u), 2))
    for column, sooner_s in ((0, 0.01), (1, 0.025)):
        plant = sample(pump_model(ship, TANK, MEASURED), SAMPLE_TIME_S, DELAY_S - sooner_s, LAG_S)
        state = np.zeros(len(plant.A))
        for k, value in enumerate(u):
            y[k, column] = (plant.C @ state + plant.D[:, 0] * value)[column]
            state = plant.A @ state + plant.B[:, 0] * value
    fit = fitted(u, noisy(y, 5e-3, 2), outputs, order)
    np.testing.assert_allclose(fit.extra_delay_s, [-0.01, -0.025][:outputs], rtol=0, atol=6e-3)
    assert fit.dispersion < 1.5
    errors = [math.log(getattr(fit.ship, name) / getattr(ship, name)) for name in NUMBERS]
    assert (np.abs(errors) < 3 * fit.deviation[:3]).all()
    assert fit.deviation[0] < 0.02


@pytest.mark.parametrize(("outputs", "order"), [(2, 60), (1, 120)])
def test_what_a_law_answers_to_the_waves_tells_nothing_of_the_ship(outputs, order):
    u, plant = pulses(3, SLOW_PUMP), DesignPlant(CONFIGURED, TANK, DELAY_S, LAG_S)
    y = noisy(respond(ship_of(12.6), TANK, u, jonswap_moment(len(u), 5, 2.5e7)), 5e-3, 6)
    result = okid(u, y[:, :outputs], order, sample_time_s=SAMPLE_TIME_S)
    answer = np.convolve(np.nan_to_num(result.errors[:, 0]), 0.9 ** np.arange(40))[: len(u)]
    answer *= 3 * np.std(u) / np.std(answer)
    alone = fit_ship(result, u, plant, MEASURED[:outputs])
    beside = fit_ship(result, u + answer, plant, MEASURED[:outputs])
    assert beside.deviation == pytest.approx(alone.deviation, rel=0.2)
    assert beside.period_deviation == pytest.approx(alone.period_deviation, rel=0.2)


def test_what_the_record_does_not_show_stays_as_configured():
    u = pulses(1, SLOW_PUMP) * 1e-4  # pulses that drown in the waves
    y = respond(ship_of(8.5), TANK, u, jonswap_moment(len(u), 5, 2.5e7))
    fit = fitted(u, noisy(y, 0.05, 2), 1, 40)
    assert fit.ship.inertia_kg_m2 == pytest.approx(CONFIGURED.inertia_kg_m2, rel=0.1)
    assert fit.period_deviation > 0.1


def test_outputs_that_do_not_fit_the_model_are_refused():
    u = pulses(1, SLOW_PUMP)
    y = respond(CONFIGURED, TANK, u, np.zeros(len(u)))
    result = okid(u, noisy(y, 1e-3, 2), 10, sample_time_s=SAMPLE_TIME_S)
    with pytest.raises(ValueError, match="outputs"):
        fit_ship(result, u, DesignPlant(CONFIGURED, TANK), ("roll_rad",))
