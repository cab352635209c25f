"""The test of the sign against its formulas, sample by sample."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from moving_ship import THRESHOLDS

from utank_hil.safety.monitors.motion_sign import SignTest

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
        noise = 1.5 * math.sqrt(max(memory(squares, slow), memory(squares, fast)))
        most = abs(turned) + max(JUMP, noise)
        move = max(min(moved, most), -most)
        if not math.isnan(last):
            squares.append((move - last) ** 2)
            slow.append(min(seconds / 2.0, 1.0))
            fast.append(min(seconds / 0.15, 1.0))
        last = move
        step.append((step[-1][0] + move, step[-1][1] + turned))
        elapsed += seconds
        power = max(memory(squares, slow), memory(squares, fast) / 1.5, 6.0) / 6
        rolled, turns = np.array(step).T
        evidence = np.var(turns) * len(step) / 2 / power
        if elapsed >= 0.6 or (elapsed >= 0.14 and evidence >= 5):
            ratio = -np.cov(turns, rolled + turns / 2, bias=True)[0, 1] * len(step) / power
            if judged and evidence >= 2:
                total = min(max(total + min(ratio, 5.0), 0.0), 16.0)
            step, elapsed = [(0.0, 0.0)], 0.0
        sums.append(float(total))
    return sums


moves = st.integers(-300, 300).map(float)
looks = st.lists(
    st.tuples(moves, moves, st.sampled_from([0.05, 0.125, 0.3, 0.7, 3.0]), st.booleans()),
    max_size=20,
)


bursts = st.lists(
    st.tuples(
        st.sampled_from([1.0, 20.0, 60.0, 200.0]),
        st.lists(
            st.tuples(st.integers(-3, 3), st.integers(-2, 2), st.sampled_from([0.05, 0.125, 0.3])),
            min_size=1,
            max_size=6,
        ),
    ),
    min_size=1,
    max_size=4,
).map(
    lambda parts: [
        (noise * moved, noise * turned / 2, seconds, True)
        for noise, part in parts
        for moved, turned, seconds in part
    ]
)
"""Noise that is suddenly many times as much, or as little, and a roll among it."""


@given(st.one_of(looks, bursts))
def test_the_sum_is_that_of_its_formulas(looks: list[Look]) -> None:
    test, found = SignTest(LIMITS), []
    expected = sums_of(looks)
    for moved, turned, seconds, judged in looks:
        found.append(test.update(moved * S, turned * S, seconds, judged=judged))
        assert test.sum == pytest.approx(expected[len(found) - 1], rel=1e-6, abs=1e-6)
    assert found == [each > 8 for each in expected]


@pytest.mark.parametrize("jump", [-1000.0, -300.0, 300.0, 1000.0])
@pytest.mark.parametrize("noise", [0.0, 20.0, 60.0, 200.0])
def test_a_jump_is_cut_to_the_limit_or_to_the_noise(noise: float, jump: float) -> None:
    looks = [(noise * (-1) ** k, 0.0, 0.05, True) for k in range(60)]
    looks += [(jump, 30.0, 0.05, True), *[(-10.0, 10.0, 0.05, True)] * 30]
    test, sums = SignTest(LIMITS), []
    for moved, turned, seconds, judged in looks:
        test.update(moved * S, turned * S, seconds, judged=judged)
        sums.append(test.sum)
    assert sums == pytest.approx(sums_of(looks), rel=1e-6, abs=1e-6)


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
        test.update(-4 * S, 4 * S, 0.05, judged=True)
        sums.append(test.sum)
    assert sums[:11] == [0.0] * 11
    assert 1.0 < sums[11] < 5.0


@pytest.mark.parametrize("times", [1.0, 2.0, 4.0])
def test_noise_of_a_rate_that_does_not_turn_is_no_evidence(times: float) -> None:
    """In a calm, or in the dock: with the default figures of a sensor, and with noisier ones."""
    test, draw = SignTest(THRESHOLDS), np.random.default_rng(1)
    rolls = 2e-4 * draw.standard_normal(50_000)
    turns = times * 5e-4 * 0.01 * math.sqrt(5) * draw.standard_normal(50_000)
    largest = 0.0
    for moved_rad, turned_rad in zip(np.diff(rolls, prepend=0.0), turns, strict=True):
        test.update(float(moved_rad), float(turned_rad), 0.05, judged=True)
        largest = max(largest, test.sum)
    assert largest < (0.1 if times <= 2 else 6.0)


def evidence(turned_s: list[float]) -> float:
    """Log-likelihood ratio of a wrong sign by the samples of a step, in units of S, one by one."""
    return float(np.var(np.cumsum([0.0, *turned_s])) * (len(turned_s) + 1) / 2)


def first_found(test: SignTest, turned_s: float, step_s: float) -> int:
    """After how many looks a wrong sign is found."""
    return next(
        number
        for number in range(1, 99)
        if test.update(-turned_s * S, turned_s * S, step_s, judged=True)
    )


@pytest.mark.parametrize("way", [-1, 1])
@pytest.mark.parametrize(
    ("step_s", "turned_s", "steps"),
    [
        # as short as they may be, where each says all that one step may
        (0.14, 4.5, 1),
        (0.13, 2.25, 2),
        (0.07, 2.25, 2),
        (0.05, 1.5, 3),
        # until they do
        (0.14, 3.1, 2),
        (0.05, 0.8, 5),
        # but no longer than 0.6 s, of which each says 4.1, or the least that counts
        (0.05, 0.2122, 12),
        (0.05, 0.15, 12),
    ],
)
def test_steps_last_until_they_say_enough(
    step_s: float, turned_s: float, steps: int, way: int
) -> None:
    needed = math.floor(8 / min(evidence([turned_s] * steps), 5)) + 1
    assert first_found(SignTest(LIMITS), way * turned_s, step_s) == needed * steps
    # a gap forgets the step that was begun, and all before it
    test = SignTest(LIMITS)
    for _ in range(needed * steps - 1):
        test.update(-turned_s * S, turned_s * S, step_s, judged=True)
    test.restart()
    assert first_found(test, way * turned_s, step_s) == needed * steps


def test_a_turning_point_takes_nothing_from_a_step() -> None:
    """At its end the ship has rolled back to where it began."""
    test, sums = SignTest(LIMITS), []
    there_and_back = [2.0, 2.0, -2.0, -2.0]
    assert evidence(there_and_back[:3]) < 5 < evidence(there_and_back)
    for turned_s in (*there_and_back, *there_and_back):
        test.update(-turned_s * S, turned_s * S, 0.1, judged=True)
        sums.append(test.sum)
    assert sums == [0.0] * 3 + [5.0] * 4 + [10.0]


def test_neither_a_right_sign_nor_a_roll_that_does_not_move_is_found() -> None:
    test = SignTest(LIMITS)
    for way in (-1, 1):
        for _ in range(20):
            assert not test.update(way * 4 * S, way * 4 * S, 0.6, judged=True)
            assert not test.update(0.0, way * 4 * S, 0.6, judged=True)
    assert test.sum == 0.0


def test_a_sum_of_eight_is_not_yet_too_much() -> None:
    test = SignTest(LIMITS)
    for _ in range(2):
        assert not test.update(-4 * S, 4 * S, 0.6, judged=True)
    assert test.sum == 8.0
    assert test.update(-4 * S, 4 * S, 0.6, judged=True)
