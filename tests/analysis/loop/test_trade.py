"""A trade goes from gentle to hard, holds the design itself, and marks what may not be armed."""

import dataclasses

import matplotlib.image
import numpy as np
import pytest
from rolling_ship import SHIP, TANK
from shipped_designs import DPC_ROLL_LEVEL, GPC_ROLL, LQG_ROLL_RATE_LEVEL

from utank_hil.analysis.loop.trade import scaled, trade, varied
from utank_hil.control import DesignPlant
from utank_hil.control.constrained.design import ConstrainedDesign, SeaModel
from utank_hil.pictures.trade import draw_trade
from utank_hil.sea import EffectiveSlope, Sea, ittc

pytestmark = pytest.mark.slow

MOMENT = Sea.irregular(ittc(4.7, 10.0), 1).roll_moment(SHIP.stiffness_nm_rad, EffectiveSlope(0.5))
FACTORS = (10.0, 0.1, 1.0)


@pytest.fixture(scope="module")
def gpc():
    return trade(GPC_ROLL, DesignPlant(SHIP, TANK), MOMENT, factors=FACTORS)


def test_more_weight_buys_less_roll_with_margin_and_pressure(gpc):
    assert [point.factor for point in gpc.points] == sorted(FACTORS)
    for figures in (
        [point.roll_below_passive for point in gpc.points],
        [point.motion.pressure_rms_pa for point in gpc.points],
        [point.robustness.nominal.peak_sensitivity for point in gpc.points],
    ):
        assert figures == sorted(figures)
    assert gpc.passive.roll_rms_rad > gpc.points[0].motion.roll_rms_rad


def test_the_shipped_design_is_accepted_and_ten_times_its_weight_refused(gpc):
    assert [point.refused for point in gpc.points] == [False, False, True]


def test_an_exact_deadbeat_is_scaled_by_its_horizon_and_keeps_its_window():
    exact = dataclasses.replace(DPC_ROLL_LEVEL, output_weight=None)
    assert varied(exact) == "control horizon"
    half = scaled(exact, 0.5)
    assert half.control_horizon == round(exact.control_horizon / 2)
    window = exact.prediction_horizon - exact.control_horizon
    assert half.prediction_horizon - half.control_horizon == window
    assert scaled(exact, 1.0) == exact


def test_a_longer_horizon_comes_first_because_it_asks_for_less():
    exact = dataclasses.replace(
        DPC_ROLL_LEVEL,
        output_weight=None,
        predictor=dataclasses.replace(DPC_ROLL_LEVEL.predictor, order=8),
    )
    result = trade(exact, DesignPlant(SHIP, TANK), MOMENT, factors=(0.9, 1.5))
    assert [point.factor for point in result.points] == [1.5, 0.9]


def test_scaling_all_weights_of_an_lqg_law_scales_its_state_weight():
    assert varied(LQG_ROLL_RATE_LEVEL) == "state weight"
    tenfold = scaled(LQG_ROLL_RATE_LEVEL, 10.0)
    np.testing.assert_allclose(
        tenfold.state_weight, 10 * np.array(LQG_ROLL_RATE_LEVEL.state_weight)
    )


def test_a_constrained_law_is_traded_by_its_pressure_weight_where_no_limit_is_active():
    spectrum = ittc(4.7, 10.0)
    sea = SeaModel(tuple(spectrum.frequency_hz), tuple(spectrum.density))
    design = ConstrainedDesign("constrained_gpc", sea)
    assert varied(design) == "output weight"
    assert scaled(design, 4.0).pressure_weight_rad2 == design.pressure_weight_rad2 / 4
    gentle, hard = trade(design, DesignPlant(SHIP, TANK), MOMENT, factors=(0.01, 1.0)).points
    assert gentle.motion.pressure_rms_pa < hard.motion.pressure_rms_pa
    assert gentle.roll_below_passive < hard.roll_below_passive


@pytest.mark.evidence
def test_progress_ends_at_one():
    told = []
    trade(GPC_ROLL, DesignPlant(SHIP, TANK), MOMENT, factors=(1.0, 2.0), progress=told.append)
    assert told == [0.5, 1.0]


def colour(path, rgb):
    image = matplotlib.image.imread(path)
    return int((np.abs(image[..., :3] - np.array(rgb) / 255).max(axis=-1) < 0.02).sum())


@pytest.mark.evidence
def test_the_picture_fills_accepted_laws_and_stars_the_design(gpc, tmp_path):
    blue, yellow = (0x00, 0x72, 0xB2), (0xF0, 0xE4, 0x42)
    path = draw_trade(gpc, tmp_path / "trade.png", "A trade", 50e3, 3.85)
    both = colour(path, blue)
    assert colour(path, yellow) > 500
    refused = dataclasses.replace(gpc, points=gpc.points[2:])
    draw_trade(refused, path, "A trade", 50e3, 3.85)
    assert colour(path, yellow) == 0
    assert colour(path, blue) < both / 10


def test_a_trade_without_a_stable_law_is_not_drawn(gpc, tmp_path):
    lost = dataclasses.replace(gpc.points[0], motion=None, roll_below_passive=None)
    with pytest.raises(ValueError, match="no law of this trade is stable"):
        draw_trade(
            dataclasses.replace(gpc, points=(lost,)), tmp_path / "trade.png", "None", 50e3, 3.85
        )
