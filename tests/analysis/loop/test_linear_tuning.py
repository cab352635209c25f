"""``tuning: auto``: margins and cost of what is found, another ship, and what a file may say."""

from pathlib import Path

import numpy as np
import pytest

from utank_hil.analysis.loop.linear_tuning import (
    LINEAR_KINDS,
    AutoDesign,
    _Search,
    auto_tuned,
)
from utank_hil.analysis.loop.margins import robustness
from utank_hil.analysis.loop.sea_response import motion_in_sea
from utank_hil.analysis.loop.self_tuning import (
    NoLawError,
    cost_weights,
    passive_roll_rad,
    unknown_sea,
)
from utank_hil.assembly import build_law
from utank_hil.configuration import ConfigError, ControllerConfig, load_config
from utank_hil.control.sea_model import SeaModel
from utank_hil.sea import EffectiveSlope, Sea, jonswap

CONTROLLERS = Path("configs/controllers").resolve()
SHIPPED = {
    kind: load_config(CONTROLLERS / f"{kind}.yaml", ControllerConfig) for kind in LINEAR_KINDS
}
PLANT = SHIPPED["gpc"].plant
SPECTRUM = jonswap(1.0, 8.0)
SEA = SeaModel(tuple(SPECTRUM.frequency_hz), tuple(SPECTRUM.density))


@pytest.fixture
def short_search(monkeypatch):
    monkeypatch.setattr("utank_hil.analysis.loop.linear_tuning._SIZES", 1)
    monkeypatch.setattr("utank_hil.analysis.loop.linear_tuning._SWEEPS", 1)
    monkeypatch.setattr("utank_hil.analysis.loop.linear_tuning.STEP", 8.0)


@pytest.mark.evidence("dpc", "gpc")
@pytest.mark.parametrize("kind", LINEAR_KINDS)
def test_the_law_has_all_margins_and_costs_less_than_the_one_that_is_only_scaled(
    kind, short_search
):
    cost, design = auto_tuned(kind, PLANT, SEA)
    law, measured = design.law(PLANT), design.predictor.measured
    assert not robustness(law, PLANT, measured, with_delay_margin=False).failures()
    assert cost < _Search(kind, PLANT, SEA).start[0]


@pytest.mark.evidence
def test_in_mild_weather_it_costs_less_than_the_law_that_was_tuned_in_the_storm():
    cost, design = auto_tuned("lqg", PLANT, SEA)
    assert cost < 0.95 * _Search("lqg", PLANT, SEA)._cost(SHIPPED["lqg"].law)
    assert min(design.predictor.measurement_std) >= 2e-4  # the sensors' own


def test_the_cost_is_that_of_the_sum_over_random_components(short_search):
    cost, design = auto_tuned("lqg", PLANT, SEA)
    moment = Sea.irregular(SPECTRUM, 1, components=4096).roll_moment(
        PLANT.ship.stiffness_nm_rad, EffectiveSlope(SEA.effective_slope)
    )
    measured = design.predictor.measured
    motion = motion_in_sea(design.law(PLANT), PLANT, measured, moment)
    passive_rad, limits = passive_roll_rad(PLANT, SEA), PLANT.limits
    pressure = motion.pressure_rms_pa / limits.pressure_pa
    squares = np.square([motion.roll_rms_rad, motion.level_rms_m, pressure])
    expected = squares @ cost_weights(passive_rad, limits) / passive_rad**2
    assert cost == pytest.approx(expected, rel=0.03)


@pytest.mark.evidence
def test_another_ship_in_a_sea_that_is_not_known_gets_a_law():
    naval = load_config(CONTROLLERS / "naval_constrained_gpc.yaml", ControllerConfig).plant
    design = AutoDesign("lqg", "auto")
    law = design.build(naval)
    assert not robustness(law.linear, naval, law.measured, with_delay_margin=False).failures()
    assert design.tuned(naval) == auto_tuned("lqg", naval, unknown_sea(naval.ship))[1]


def test_a_sea_without_waves_is_refused():
    class Still:
        def slope_density(self, omega_rad_s):
            return 0 * omega_rad_s

    with pytest.raises(NoLawError, match="does not roll"):
        auto_tuned("lqg", PLANT, Still())


def written(folder, law):
    path = folder / "law.yaml"
    ship = CONTROLLERS.parent / "ships" / "thesis_first.yaml"
    path.write_text(f"name: any\nvessel: {ship}\nlaw: {law}\n")
    return path


def test_a_file_names_the_kind_and_a_sea(tmp_path):
    sea = "{kind: jonswap, hs_m: 3, tp_s: 9, effective_slope: 0.6}"
    path = written(tmp_path, f"{{kind: lqg, tuning: auto, sea: {sea}}}")
    config = load_config(path, ControllerConfig)
    assert isinstance(config.law, AutoDesign)
    assert config.law.sea.effective_slope == 0.6
    law = build_law(config)
    assert not robustness(law.linear, config.plant, law.measured).failures()
    # as a law made in code, too, and within the law of a valve
    assert ControllerConfig.model_validate({**dict(config), "law": config.law}).law == config.law
    pair = written(tmp_path, "{kind: pump_with_valve, pump: {kind: dpc, tuning: auto}}")
    assert load_config(pair, ControllerConfig).law.pump.kind == "dpc"


@pytest.mark.parametrize(
    ("law", "key", "reason"),
    [
        ("{kind: gpc, tuning: auto, output_weight: [1.0]}", "output_weight", "exclude each other"),
        ("{kind: lqg, tuning: auto, predictor: {}}", "predictor", "exclude each other"),
        ("{kind: dpc, tuning: manual}", "tuning", "must be one of auto"),
        ("{kind: pd, tuning: auto}", "tuning", "is not a known key"),
        ("{kind: gpc, tuning: auto, sea: {kind: jonswap, hs_m: 3}}", "sea.tp_s", "missing"),
        ("{kind: nothing, tuning: auto}", "kind", "passive, pd, lqg"),
    ],
)
def test_what_is_wrong_is_said_at_its_key(tmp_path, law, key, reason):
    with pytest.raises(ConfigError) as refused:
        load_config(written(tmp_path, law), ControllerConfig)
    found = {problem.key: problem.reason for problem in refused.value.problems}
    assert reason in found[f"law.{key}"]
    assert "tuning auto" not in found[f"law.{key}"]
