"""The ship's constrained law in its loop: limits, heel, and what the sea's model is good for."""

import dataclasses

import numpy as np
import pytest
from rolling_ship import SHIP, TANK

from utank_hil.analysis.loop.loop_simulation import passive_motion, simulate_loop
from utank_hil.base.tick import TICK_S
from utank_hil.control import DesignPlant, PumpLimits
from utank_hil.control.constrained.design import ConstrainedDesign, sea_plant
from utank_hil.control.sea_model import SeaModel
from utank_hil.dynamics.linear import coupled_model
from utank_hil.sea import EffectiveSlope, Harmonics, Sea, jonswap

SPECTRUM = jonswap(4.7, 10.0)
DESIGN = ConstrainedDesign(
    "constrained_gpc", SeaModel(tuple(SPECTRUM.frequency_hz), tuple(SPECTRUM.density))
)
LIMITS = PumpLimits(level_m=4.0)
UNGUARDED = PumpLimits(level_m=100.0)  # nothing but pressure and rate behind the law


def rms(signal) -> float:
    return float(np.sqrt(np.mean(np.square(signal))))


def storm(seconds: float, scale: float = 1.0):
    moment = Sea.irregular(SPECTRUM, 3, components=128).roll_moment(
        scale * SHIP.stiffness_nm_rad, EffectiveSlope(0.5)
    )
    return passive_motion(SHIP, TANK, moment, TICK_S, round(seconds / TICK_S) + 1)


def run(design, waves, limits=LIMITS, behind=UNGUARDED):
    controller = design.law(DesignPlant(SHIP, TANK, limits=limits)).controller()
    result = simulate_loop(
        DesignPlant(SHIP, TANK, limits=behind), waves, controller, design.measured, seed=1
    )
    return result, controller


def test_in_a_storm_the_roll_is_much_less_than_passive_and_level_and_pressure_keep_their_limits():
    waves = storm(300.0)
    result, controller = run(DESIGN, waves)
    assert rms(result.motion[:, 0]) < 0.8 * rms(waves[:, 0])
    assert np.abs(result.motion[:, 2]).max() < LIMITS.level_m + 0.2
    assert np.abs(result.command_pa).max() <= LIMITS.pressure_pa
    assert controller.fallbacks == 0


def test_a_power_limit_is_kept_and_costs_roll():
    waves = storm(200.0)
    free, _ = run(DESIGN, waves)
    limited, _ = run(DESIGN, waves, dataclasses.replace(LIMITS, power_w=4e5))

    def power(result):
        return result.pressure_pa * TANK.reservoir_area_m2 * result.motion[:, 3]

    assert power(free).max() > 8e5
    # the speed that the last plan foresaw is not quite the one that comes
    assert np.quantile(power(limited), 0.999) < 1.2 * 4e5
    assert rms(limited.motion[:, 0]) > rms(free.motion[:, 0])


def heeled(slope_rad: float, seconds: float):
    moment = Harmonics(np.array([slope_rad * SHIP.stiffness_nm_rad]), np.zeros(1), np.zeros(1))
    return passive_motion(SHIP, TANK, moment, TICK_S, round(seconds / TICK_S) + 1)


@pytest.mark.slow
@pytest.mark.parametrize(("share", "left"), [(0.0, 1.0), (0.5, 0.5), (1.0, 0.0)])
def test_of_a_steady_heel_the_tank_takes_out_the_share_asked_for(share, left):
    design = dataclasses.replace(DESIGN, heel_share=share)
    waves = heeled(0.005, 400.0)
    result, _ = run(design, waves)
    end = slice(-2000, None)
    passive = np.linalg.solve(coupled_model(SHIP, TANK).A, -coupled_model(SHIP, TANK).B[:, 1])[0]
    passive *= 0.005 * SHIP.stiffness_nm_rad
    assert result.motion[end, 0].mean() == pytest.approx(left * passive, abs=0.05 * passive)
    if share == 0:
        assert abs(result.pressure_pa[end].mean()) < 500.0


def test_level_that_a_heel_brings_is_known_to_the_level_limit():
    waves = storm(300.0, 0.7) + heeled(0.03, 300.0)
    result, _ = run(DESIGN, waves)
    assert np.abs(result.motion[10_000:, 2]).max() < LIMITS.level_m + 0.2


@pytest.mark.parametrize(
    "bad",
    [
        {"measured": ("roll_rad",), "measurement_std": (1e-3,)},
        {"measured": ("pitch", "level_m", "roll_rad")},
        {"measurement_std": (1e-3, 1e-3)},
        {"pressure_weight_rad2": 0.0},
        {"level_margin_m": -0.1},
        {"heel_share": 1.5},
        {"heel_time_s": 0.0},
        {"slope_noise_rad_rt_s": -1.0},
    ],
)
def test_bad_values_are_refused_by_name(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        dataclasses.replace(DESIGN, **bad)


def test_a_plan_that_the_law_follows_is_the_law_whatever_its_length():
    # the principle of optimality: with a knot at each sample the horizon makes no difference
    gains = [
        dataclasses.replace(
            DESIGN,
            knots=tuple(range(samples)),
            horizon=samples,
            heel_std_rad=0.0,
        )
        .law(DesignPlant(SHIP, TANK, limits=LIMITS))
        .unlimited()
        .gain[0, :-1]
        for samples in (2, 25)
    ]
    np.testing.assert_allclose(gains[0], gains[1], rtol=1e-3, atol=1e-3 * np.abs(gains[0]).max())


def test_the_margin_that_is_not_given_is_the_error_of_the_forecast_that_draws_have():
    plant = DesignPlant(SHIP, TANK, limits=LIMITS)
    law = DESIGN.law(plant)
    noises = ("pressure_noise_pa_rt_s", "slope_noise_rad_rt_s", "heel_std_rad", "heel_time_s")
    settings = {name: getattr(DESIGN, name) for name in (*noises, "sample_time_s")}
    _, covariance, *_ = sea_plant(DESIGN.sea, plant, **settings)
    model, level = law.model, law.level_output
    rng = np.random.default_rng(1)
    process = rng.multivariate_normal(np.zeros(len(covariance)), covariance, 20_000)
    noise = rng.standard_normal((20_000, 3)) * DESIGN.measurement_std
    error, surprises = np.zeros(len(model.A)), []
    for push, wrong in zip(process, noise, strict=True):
        surprise = model.C @ error + wrong
        error = model.A @ error - law.observer_gain @ surprise + push
        surprises.append(surprise[level])
    assert LIMITS.level_m - law.limits.level_m == pytest.approx(np.std(surprises[100:]), rel=0.03)


def test_a_margin_that_leaves_no_level_is_refused():
    with pytest.raises(ValueError, match="level_margin_m"):
        dataclasses.replace(DESIGN, level_margin_m=4.0).law(DesignPlant(SHIP, TANK, limits=LIMITS))
