"""``tuning: auto``: margins on another ship, its sea, what a file may say; how a law is scaled."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from shipped_designs import DPC_ROLL_LEVEL, LQG_ROLL_RATE_LEVEL

from utank_hil.analysis.loop.linear_tuning import LINEAR_KINDS, AutoDesign, scaled, varied
from utank_hil.analysis.loop.margins import robustness
from utank_hil.analysis.loop.sea_response import moment_of, motion_in_sea
from utank_hil.assembly import build_law
from utank_hil.configuration import ConfigError, ControllerConfig, load_config
from utank_hil.control.constrained.design import ConstrainedDesign
from utank_hil.control.sea_model import SeaModel
from utank_hil.sea import jonswap

CONTROLLERS = Path("configs/controllers").resolve()
SHIPPED = {
    kind: load_config(CONTROLLERS / f"{kind}.yaml", ControllerConfig) for kind in LINEAR_KINDS
}
PLANT = SHIPPED["gpc"].plant
SPECTRUM = jonswap(1.0, 8.0)
SEA = SeaModel(tuple(SPECTRUM.frequency_hz), tuple(SPECTRUM.density))


@pytest.mark.parametrize("kind", LINEAR_KINDS)
def test_another_ship_in_a_sea_that_is_not_known_gets_a_law_with_all_margins(kind) -> None:
    naval = load_config(CONTROLLERS / "naval_constrained_gpc.yaml", ControllerConfig).plant
    law = AutoDesign(kind, "auto").build(naval)
    assert not robustness(law.linear, naval, law.measured, with_delay_margin=False).failures()
    passive = motion_in_sea(None, naval, law.measured, moment_of(SEA, naval.ship))
    active = motion_in_sea(law.linear, naval, law.measured, moment_of(SEA, naval.ship))
    assert active.roll_rms_rad < 0.95 * passive.roll_rms_rad


def test_the_sea_that_is_named_is_the_one_designed_for() -> None:
    tuned = AutoDesign("lqg", "auto", SEA).tuned(PLANT)
    moment = moment_of(SEA, PLANT.ship)
    roll = motion_in_sea(None, PLANT, (), moment).roll_rms_rad
    assert tuned.predictor.wave_slope_rad == pytest.approx(1.46 * roll, rel=0.02)
    higher = SeaModel(SEA.frequency_hz, tuple(4 * density for density in SEA.density_m2_hz))
    twice = AutoDesign("lqg", "auto", higher).tuned(PLANT).predictor.wave_slope_rad
    assert twice == pytest.approx(2 * tuned.predictor.wave_slope_rad, rel=0.01)


def test_an_exact_deadbeat_is_scaled_by_its_horizon_and_keeps_its_window():
    exact = dataclasses.replace(DPC_ROLL_LEVEL, output_weight=None)
    assert varied(exact) == "control horizon"
    half = scaled(exact, 0.5)
    assert half.control_horizon == round(exact.control_horizon / 2)
    window = exact.prediction_horizon - exact.control_horizon
    assert half.prediction_horizon - half.control_horizon == window
    assert scaled(exact, 1.0) == exact


def test_scaling_all_weights_of_an_lqg_law_scales_its_state_weight():
    assert varied(LQG_ROLL_RATE_LEVEL) == "state weight"
    tenfold = scaled(LQG_ROLL_RATE_LEVEL, 10.0)
    np.testing.assert_allclose(
        tenfold.state_weight, 10 * np.array(LQG_ROLL_RATE_LEVEL.state_weight)
    )


def test_a_constrained_law_is_scaled_by_its_pressure_weight() -> None:
    design = ConstrainedDesign("constrained_gpc", SEA)
    assert varied(design) == "output weight"
    assert scaled(design, 4.0).pressure_weight_rad2 == design.pressure_weight_rad2 / 4


def written(folder: Path, law: str) -> Path:
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
