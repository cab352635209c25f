"""Every kind of law from inputs changed in the twelfth digit: the same law but for rounding.

Where a design searches, its answer must depend on ship, tank and sea alone: another processor's
rounding then moves gains by less than 1e-6 and the predicted roll by less than 1e-9.
"""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from utank_hil.analysis.loop.linear_tuning import AutoDesign
from utank_hil.analysis.loop.sea_response import motion_in_sea
from utank_hil.analysis.loop.self_tuning import SelfTunedDesign, unknown_sea
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.sea import Harmonics

QUICK = (
    "pd", "lqg", "gpc", "dpc", "constrained_gpc", "naval_constrained_gpc",
    "patti_b_constrained_gpc", "feedback_linearization", "fuzzy_robust", "pump_with_valve",
)  # fmt: skip
SEARCHED = ("self_tuned", "self_tuning", "naval_self_tuning", "patti_b_self_tuning")
SHIPS = ("pd", "naval_self_tuning", "patti_b_self_tuning")  #: One controller of each.
BY_SHIP = [
    *((ship, kind) for ship in SHIPS for kind in ("pd", "self_tuned")),
    # no such law has its margins on Patti-B
    *((ship, kind) for ship in SHIPS[:2] for kind in ("gpc", "dpc", "lqg")),
]


def changed(value, rng):
    """A ship, tank or limits with each of its numbers changed by up to 1e-12 of it."""
    return replace(
        value,
        **{
            field.name: number * (1 - 1e-12 * rng.uniform())
            for field in fields(value)
            if isinstance(number := getattr(value, field.name), float) and np.isfinite(number)
            and field.name not in ("brake_share", "sharpness")
        },
    )  # fmt: skip


def gains_and_roll(design, plant, *, renews):
    """Gains of the linear law, and its roll in the broad sea of an unknown one."""
    starts = renews and isinstance(design, SelfTunedDesign)
    law = design.build(plant, first=True) if starts else design.build(plant)
    linear = getattr(law.linear, "unlimited", lambda: law.linear)()
    names = ("gain", "observer_gain")
    gains = [getattr(linear, name) for name in names if hasattr(linear, name)]
    w = plant.ship.natural_frequency_rad_s * np.geomspace(0.2, 5.0, 400)
    slope = np.sqrt(2 * unknown_sea(plant.ship).slope_density(w) * np.gradient(w))
    waves = Harmonics(plant.ship.stiffness_nm_rad * slope, w, np.zeros(len(w)))
    moved = motion_in_sea(linear, plant, law.linear_measured, waves)
    return gains or list(linear.matrices()[:4]), moved.roll_rms_rad


def assert_stands(design, config, seeds):
    gains, roll = gains_and_roll(design, config.plant, renews=config.renews)
    for seed in range(seeds):
        rng, plant = np.random.default_rng(seed), config.plant
        plant = replace(
            plant,
            **{part: changed(getattr(plant, part), rng) for part in ("ship", "tank", "limits")},
        )
        others, roll_too = gains_and_roll(design, plant, renews=config.renews)
        for one, other in zip(gains, others, strict=True):
            np.testing.assert_allclose(other, one, rtol=0, atol=1e-6 * np.abs(one).max())
        assert roll_too == pytest.approx(roll, rel=1e-9)


def config_of(name):
    return load_config(Path("configs/controllers") / f"{name}.yaml", ControllerConfig)


@pytest.mark.parametrize("name", QUICK)
def test_a_law_without_a_long_search_stands(name):
    config = config_of(name)
    assert_stands(config.law, config, seeds=3)


@pytest.mark.evidence("pd-dpc", "pd-lqg", "naval_self_tuning-gpc")
@pytest.mark.parametrize(("ship", "kind"), BY_SHIP)
def test_each_kind_stands_on_every_ship(ship, kind):
    """Patti-B's spring is a small difference of large numbers."""
    designs = {"pd": config_of("pd").law, "self_tuned": SelfTunedDesign("self_tuned")}
    assert_stands(designs.get(kind) or AutoDesign(kind, "auto"), config_of(ship), seeds=1)


@pytest.mark.slow
@pytest.mark.parametrize("name", SEARCHED)
def test_a_law_that_is_searched_for_stands(name):
    config = config_of(name)
    assert_stands(config.law, config, seeds=1)
