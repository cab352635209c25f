from dataclasses import replace

import numpy as np
import pytest

from utank_hil.dynamics import RollShip, Tank
from utank_hil.identification import Validation
from utank_hil.identification.ship_fit import ModelLimits, ShipFit, model_objections

GOOD = Validation(
    one_step_fit=np.array([0.99, 0.95]),
    residual_correlation=np.full((25, 2), 0.1),
    rows=400,
)
FIT = ShipFit(
    RollShip(1e9, 1e9 * 0.25),
    Tank(17.1, 4.88, 17.11, 6.22),
    deviation=np.full(4, 0.02),
    period_deviation=0.01,
    dispersion=1.5,
    extra_delay_s=np.zeros(2),
    pressure_gain=1.0,
)
LIMITS = ModelLimits((8.0, 20.0))
NAN = float("nan")


def test_good_model_meets_no_objection():
    assert model_objections(GOOD, FIT, LIMITS) == ()


@pytest.mark.parametrize(
    ("validation", "fit", "word"),
    [
        (replace(GOOD, one_step_fit=np.array([0.99, 0.5])), FIT, "held-out"),
        (replace(GOOD, one_step_fit=np.array([NAN, 0.9])), FIT, "held-out"),
        (replace(GOOD, residual_correlation=np.full((25, 2), -0.7)), FIT, "correlated"),
        (replace(GOOD, residual_correlation=np.full((25, 2), NAN)), FIT, "correlated"),
        (GOOD, replace(FIT, ship=RollShip(1e9, 1e9)), "stability booklet"),
        (GOOD, replace(FIT, ship=RollShip(1e9, 1e7)), "stability booklet"),
        (GOOD, replace(FIT, period_deviation=0.2), "uncertain"),
        (GOOD, replace(FIT, period_deviation=NAN), "uncertain"),
        (GOOD, replace(FIT, dispersion=50.0), "no ship explains"),
    ],
)
def test_each_shortcoming_is_objected_to_by_name(validation, fit, word):
    (objection,) = model_objections(validation, fit, LIMITS)
    assert word in objection


def test_all_shortcomings_are_listed():
    bad = replace(GOOD, one_step_fit=np.array([0.1, 0.1]))
    objections = model_objections(bad, replace(FIT, period_deviation=1.0), LIMITS)
    assert len(objections) == 2
