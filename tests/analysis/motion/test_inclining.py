import numpy as np
import pytest

from utank_hil.analysis.motion.inclining import inclining

MOMENT = 1e5 * np.array([0.0, 1, 2, 1, 0, -1, -2, -1])
WEIGHT, GM = 1.9e7, 0.9


def heel(noise=0.0, seed=1):
    scatter = noise * np.random.default_rng(seed).normal(size=len(MOMENT))
    return np.arctan(0.003 + MOMENT / (WEIGHT * GM)) + scatter


def test_gm_and_list_are_those_of_the_ship():
    found = inclining(MOMENT, heel(), WEIGHT)
    assert found.gm_m == pytest.approx(GM, rel=1e-9)
    assert found.list_rad == pytest.approx(np.arctan(0.003))


def test_the_interval_holds_the_truth_as_often_as_it_says():
    held = 0
    for seed in range(200):
        low, high = inclining(MOMENT, heel(3e-4, seed), WEIGHT).interval_m
        held += low <= GM <= high
    assert 180 <= held <= 199


@pytest.mark.parametrize(
    ("moment", "angle", "words"),
    [
        (MOMENT[:4], heel()[:4], "five shifts"),
        (np.abs(MOMENT) + 1, heel(), "to both sides"),
        (MOMENT, 20 * heel(), "lighter weights"),
        (MOMENT, -heel(), "signs of both"),
    ],
)
def test_a_test_that_says_nothing_is_refused(moment, angle, words):
    with pytest.raises(ValueError, match=words):
        inclining(moment, angle, WEIGHT)
