"""The test of the sign against its formulas, sample by sample."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from moving_ship import THRESHOLDS

from utank_hil.runtime.monitors.motion_sign import SignTest

S = 1 / 1024
"""Noise of a sample."""
JUMP = 64.0
LIMITS = replace(THRESHOLDS, drift_rad=JUMP * S, roll_noise_rad=5 * S)
Look = tuple[float, float, float, bool]
"""Moved and turned, in units of S, elapsed seconds, and whether the sign is judged."""


def memory(squares: list[float], shares: list[float]) -> float:
    """Mean of squares with these shares of the newest, from three differences of noise S on."""
    weights = [share * math.prod(1 - later for later in shares[place + 1 :])
               for place, share in enumerate(shares)]  # fmt: skip
    return 6 * (1 - sum(weights)) + float(np.dot(weights, squares))


def sums_of(looks: list[Look]) -> list[float]:
    """The sum after each look."""
    total, sums, step = 0.0, [], [(0.0, 0.0)]
    squares: list[float] = []
    slow: list[float] = []
    fast: list[float] = []
    elapsed, last = 0.0, math.nan
    for moved, turned, seconds, judged in looks:
        move = max(min(moved, abs(turned) + JUMP), -abs(turned) - JUMP)
        if not math.isnan(last):
            squares.append((move - last) ** 2)
            slow.append(min(seconds / 2.0, 1.0))
            fast.append(min(seconds / 0.25, 1.0))
        last = move
        step.append((step[-1][0] + move, step[-1][1] + turned))
        elapsed += seconds
        power = max(memory(squares, slow), memory(squares, fast) / 3, 6.0) / 6
        rolled, turns = np.array(step).T
        evidence = np.var(turns) * len(step) / 2 / power
        if elapsed >= 0.6 or (elapsed >= 0.14 and evidence >= 5):
            ratio = -np.cov(turns, rolled + turns / 2, bias=True)[0, 1] * len(step) / power
            if judged:
                total = min(max(total + min(ratio, 5.0), 0.0), 16.0)
            step, elapsed = [(0.0, 0.0)], 0.0
        sums.append(float(total))
    return sums


moves = st.integers(-80, 80).map(float)
looks = st.lists(
    st.tuples(moves, moves, st.sampled_from([0.05, 0.125, 0.3, 0.7, 3.0]), st.booleans()),
    max_size=20,
)


@given(looks)
def test_the_sum_is_that_of_its_formulas(looks: list[Look]) -> None:
    test, found = SignTest(LIMITS), []
    expected = sums_of(looks)
    for moved, turned, seconds, judged in looks:
        found.append(test.update(moved * S, turned * S, seconds, judged=judged))
        assert test.sum == pytest.approx(expected[len(found) - 1], rel=1e-6, abs=1e-6)
    assert found == [each > 8 for each in expected]


@pytest.mark.parametrize("turned", [2.0, 5.0, 20.0])
@pytest.mark.parametrize("noise", [0.0, 3.0, 12.0])
def test_a_wrong_sign_among_noise_adds_as_the_formulas_say(turned: float, noise: float) -> None:
    looks = [(noise * (-1) ** k - turned, turned, 0.05, True) for k in range(80)]
    test = SignTest(LIMITS)
    for (moved, turn, seconds, judged), expected in zip(looks, sums_of(looks), strict=True):
        test.update(moved * S, turn * S, seconds, judged=judged)
        assert test.sum == pytest.approx(expected, rel=1e-6, abs=1e-6)
    assert test.sum > 8


def test_a_gap_forgets_all_but_the_noise() -> None:
    test = SignTest(LIMITS)
    for k in range(100):
        test.update((30 * (-1) ** k - 40) * S, 40 * S, 0.05, judged=True)
    assert test.sum == 16.0
    test.restart()
    assert test.sum == 0.0
    # evidence of 5 without the noise: none is said before the longest step ends
    sums = []
    for _ in range(12):
        test.update(-1.5 * S, 1.5 * S, 0.05, judged=True)
        sums.append(test.sum)
    assert sums[:11] == [0.0] * 11
    assert 0.0 < sums[11] < 1.0
