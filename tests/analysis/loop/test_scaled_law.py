import dataclasses
from pathlib import Path

import pytest

from utank_hil.analysis.loop.linear_tuning import STEP, NoLawError, first_law, scaled_law
from utank_hil.analysis.loop.margins import robustness
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control import DesignPlant, PumpLimits
from utank_hil.control.lqg_design import LQGDesign
from utank_hil.control.predictive.design import PredictiveDesign

SHIPPED = load_config(Path("configs/controllers/lqg.yaml"), ControllerConfig)
LAW = SHIPPED.law
assert isinstance(LAW, LQGDesign)
SLOPE, PEAK = LAW.predictor.wave_slope_rad, LAW.predictor.wave_peak_rad_s


def froude(plant, scale):
    """The same ship, all lengths multiplied: time by the root, mass by the cube, g the same."""
    ship, tank, limits, time = plant.ship, plant.tank, plant.limits, scale**0.5
    return DesignPlant(
        dataclasses.replace(
            ship,
            inertia_kg_m2=ship.inertia_kg_m2 * scale**5,
            stiffness_nm_rad=ship.stiffness_nm_rad * scale**4,
            damping_nms_rad=ship.damping_nms_rad * scale**4.5,
        ),
        dataclasses.replace(
            tank,
            width_m=tank.width_m * scale,
            height_m=tank.height_m * scale,
            lz_m=tank.lz_m * scale,
            reservoir_area_m2=tank.reservoir_area_m2 * scale**2,
            duct_area_m2=tank.duct_area_m2 * scale**2,
        ),
        plant.delay_s * time,
        plant.lag_s * time,
        PumpLimits(
            limits.pressure_pa * scale, limits.rate_pa_s * scale / time, limits.level_m * scale
        ),
    )


def test_the_first_ship_has_the_shipped_law():
    found = scaled_law("lqg", SHIPPED.plant, SLOPE, PEAK)
    assert found.state_weight == pytest.approx(LAW.state_weight, rel=0.01)
    assert found.washout_rad_s == pytest.approx(LAW.washout_rad_s)
    mine, theirs = found.predictor, LAW.predictor
    assert mine.measured == theirs.measured
    assert mine.measurement_std == pytest.approx(theirs.measurement_std, rel=0.01)
    for key in ("wave_damping_ratio", "sample_time_s", "pressure_noise_pa_rt_s"):
        assert getattr(mine, key) == pytest.approx(getattr(theirs, key), rel=0.01)
    assert first_law(SHIPPED.plant, SLOPE, PEAK) == found


@pytest.mark.parametrize("kind", ["gpc", "dpc"])
def test_the_first_ship_has_the_other_shipped_laws_but_for_their_wave_peaks(kind):
    shipped = load_config(Path(f"configs/controllers/{kind}.yaml"), ControllerConfig)
    law = shipped.law
    assert isinstance(law, PredictiveDesign)
    found = scaled_law(kind, shipped.plant, law.predictor.wave_slope_rad, PEAK)
    assert isinstance(found, PredictiveDesign)
    assert found.output_weight == pytest.approx(law.output_weight, rel=0.01)
    given = law.predictor
    std, noise = given.measurement_std, given.pressure_noise_pa_rt_s
    assert found.predictor.measurement_std == pytest.approx(std, rel=0.01)
    assert found.predictor.pressure_noise_pa_rt_s == pytest.approx(noise, rel=0.01)
    same = dataclasses.replace(law, predictor=found.predictor, output_weight=found.output_weight)
    assert found == same


@pytest.mark.parametrize("scale", [0.25, 4.0])
def test_a_ship_of_another_size_has_the_same_loop(scale):
    """Froude similarity: nothing dimensionless of the loop depends on the size."""
    own = scaled_law("lqg", SHIPPED.plant, SLOPE, PEAK)
    larger = froude(SHIPPED.plant, scale)
    found = scaled_law("lqg", larger, SLOPE, PEAK / scale**0.5)
    measured = own.predictor.measured
    mine = robustness(own.law(SHIPPED.plant), SHIPPED.plant, measured).nominal
    theirs = robustness(found.law(larger), larger, measured).nominal
    assert theirs.peak_sensitivity == pytest.approx(mine.peak_sensitivity, rel=0.01)
    assert theirs.peak_loop_gain == pytest.approx(mine.peak_loop_gain, rel=0.01)
    assert theirs.radius == pytest.approx(mine.radius, abs=1e-3)


def test_a_refused_law_is_asked_for_less_and_no_less_than_it_must():
    # a ship of little damping and a pump with much more than the water needs
    plant = SHIPPED.plant
    strong = dataclasses.replace(plant, limits=PumpLimits(300e3, 600e3, 3.85))
    found = first_law(strong, SLOPE, PEAK)
    assert found != scaled_law("lqg", strong, SLOPE, PEAK)
    harder = tuple(STEP * weight for weight in found.state_weight)
    for law, fails in ((found, False), (dataclasses.replace(found, state_weight=harder), True)):
        judged = robustness(law.law(strong), strong, law.predictor.measured)
        assert bool(judged.failures()) is fails


def test_that_no_law_is_robust_enough_is_said(monkeypatch):
    monkeypatch.setattr("utank_hil.analysis.loop.linear_tuning.MOST_TRIALS", 1)
    strong = dataclasses.replace(SHIPPED.plant, limits=PumpLimits(300e3, 600e3, 3.85))
    with pytest.raises(NoLawError, match="the gentlest one is"):
        first_law(strong, SLOPE, PEAK)
